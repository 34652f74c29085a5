/* SPDX-License-Identifier: Apache-2.0
 *
 * The plan of a board, which `fcsl board` writes: its devices, the sensors of the machine that they are, how their readings are
 * corrected and judged, and what the hw_* builtins of algorithms reach. Text, one statement per line, words separated by one space:
 *
 *   fcsl-board-plan 1
 *   machine NAME TICK_HZ
 *   device NAME PERIOD_NS DRIVER ADDRESS         PERIOD_NS 0: it is read as it waits; ADDRESS: to the end of the line
 *   pace DEVICE TIMEOUT_NS                       each of its samples is a tick; silent for longer, it ends the flight
 *   sensor NAME KIND                             what follows, up to the next one, belongs to it
 *   health MAX_AGE_NS STUCK_NS RECOVER_NS        STUCK_NS 0: never stuck
 *   limits QUANTITY LOW HIGH                     bits; of each element, before the correction
 *   tolerance QUANTITY DISTANCE                  bits; of disagreement
 *   bind QUANTITY CHANNEL                        a sensor channel of the machine
 *   backend DEVICE                               in order of preference; what follows belongs to it
 *   signal QUANTITY SIGNAL                       the device's signal has another name
 *   correct QUANTITY MATRIX OFFSET PER_KELVIN CELSIUS     9, 3, 3 words and one, bits
 *   stick CHANNEL MINIMUM MIDDLE MAXIMUM DEADBAND         bits, in us; CHANNEL from 0
 *   section QUANTITY B0 B1 B2 A1 A2              bits; a biquad that the quantity goes through, in order
 *   output CHANNEL DEVICE                        an actuator channel; what follows, up to the next one, belongs to it
 *   pulse INDEX SIGNAL LOW HIGH MINIMUM MIDDLE MAXIMUM SLEW SAFE     bits; see board_pulse_t
 *   undriven CHANNEL                             an actuator channel that nothing drives, on purpose
 *   gpio_in PIN DEVICE SIGNAL                    what hw_read_gpio of the pin gives
 *   gpio_out PIN DEVICE SIGNAL SAFE              what hw_write_gpio of the pin drives; SAFE 0 or 1: at the start and at the end
 *   adc CHANNEL DEVICE SIGNAL                    what hw_read_adc of the channel gives
 *   registers ADDRESS BYTES OFFSET ACCESS FILE   what hw_read_u32 and hw_write_u32 reach: BYTES of FILE from OFFSET on, as if they were
 *                                                at ADDRESS; ACCESS: read or read_write
 *   end CRC                                      8 hexadecimal digits: the CRC-32 of all before this line. A plan written by hand
 *                                                ends with `end` alone
 *
 * BITS are 16 hexadecimal digits, those of a double. A plan that was cut off lacks `end`.
 */
#ifndef BOARD_BOARD_PLAN_H
#define BOARD_BOARD_PLAN_H

#include "fcsl/fcsl_frontend.h"
#include "fcsl/fcsl_run.h"

#define BOARD_NO_DEVICE UINT32_MAX

enum {
    BOARD_BYTES_MAX = 1 << 20,
    BOARD_DEVICES_MAX = 32,
    BOARD_SENSORS_MAX = 32,
    BOARD_OUTPUTS_MAX = 16,
    BOARD_PULSES_MAX = 16, /* of an output */
    BOARD_PINS_MAX = 64,
    BOARD_CONVERTERS_MAX = 32,
    BOARD_REGISTERS_MAX = 8,
    BOARD_NAME_BYTES = 65
};

typedef struct {
    const char *name;
    const char *driver;
    const char *address;
    uint64_t period_ns;
} board_device_t;

typedef struct {
    uint32_t quantity;
    const char *channel;
} board_binding_t;

typedef struct {
    const char *name;
    fcsl_frontend_config_t config;
    uint32_t devices[FCSL_BACKENDS_MAX]; /* by backend: index into the plan's */
    const char *signals[FCSL_BACKENDS_MAX][FCSL_QUANTITIES_MAX]; /* of the device; null: that of the quantity's name */
    board_binding_t bindings[FCSL_QUANTITIES_MAX];
    uint32_t binding_count;
} board_sensor_t;

/* How element `index` of an actuator channel becomes a signal of its device, a pulse for example: a command from `low` over the middle
 * to `high` goes to `minimum`, `middle`, `maximum` in straight lines (minimum > maximum: reversed); beyond them it stays there, and what
 * is no number is the safe value. The pulse moves by `slew` per second at most (0: at once). Safe actuators get `safe` at once. */
typedef struct {
    const char *signal;
    uint32_t index;
    double low;
    double high;
    double minimum;
    double middle;
    double maximum;
    double slew;
    double safe;
} board_pulse_t;

typedef struct {
    const char *channel;
    uint32_t device; /* index into the plan's */
    board_pulse_t pulses[BOARD_PULSES_MAX];
    uint32_t pulse_count;
} board_output_t;

/* A digital pin, as hw_read_gpio and hw_write_gpio number it. */
typedef struct {
    uint32_t number;
    uint32_t device; /* index into the plan's */
    const char *signal;
    int is_output;
    int safe; /* of an output: its level before the first tick, and after the last one */
} board_pin_t;

/* An input of an analog-digital converter, as hw_read_adc numbers it. */
typedef struct {
    uint32_t number;
    uint32_t device;
    const char *signal;
} board_converter_t;

/* A part of a file in memory, whose words are registers for hw_read_u32 and hw_write_u32. */
typedef struct {
    uint32_t address; /* of the first register */
    uint32_t bytes;
    uint64_t offset; /* in the file */
    int is_written;
    const char *file;
} board_registers_t;

/* Whether the machine gets this quantity of the sensor, or one that is computed from it. */
int board_sensor_needs(const board_sensor_t *sensor, uint32_t quantity);

/* All strings point into `text`. */
typedef struct {
    char *text;
    const char *machine;
    uint64_t tick_hz;
    board_device_t devices[BOARD_DEVICES_MAX];
    uint32_t device_count;
    uint32_t pacing; /* the device that paces the loop; BOARD_NO_DEVICE: the clock does */
    uint64_t pace_timeout_ns;
    board_sensor_t sensors[BOARD_SENSORS_MAX];
    uint32_t sensor_count;
    board_output_t outputs[BOARD_OUTPUTS_MAX];
    uint32_t output_count;
    const char *undriven[BOARD_OUTPUTS_MAX]; /* actuator channels without an output */
    uint32_t undriven_count;
    board_pin_t pins[BOARD_PINS_MAX];
    uint32_t pin_count;
    board_converter_t converters[BOARD_CONVERTERS_MAX];
    uint32_t converter_count;
    board_registers_t registers[BOARD_REGISTERS_MAX];
    uint32_t registers_count;
} board_plan_t;

/* Reads the file. Returns a plan for board_plan_free, or null with a message that names file and line. */
board_plan_t *board_plan_read(const char *file, fcsl_error_t *error);
/* The same of its text, at most BOARD_BYTES_MAX; `name` is for messages. */
board_plan_t *board_plan_parse(const char *name, const char *text, size_t size, fcsl_error_t *error);
void board_plan_free(board_plan_t *plan);
/* Whether it has pins, converters or registers. */
int board_plan_has_hardware(const board_plan_t *plan);
/* Whether the flight program opens the device: outputs belong to fcsl-guard. */
int board_plan_flies(const board_plan_t *plan, uint32_t device);
/* Whether the plan of this file is for the machine. 0, or -1. */
int board_plan_check_machine(const board_plan_t *plan, const char *file, const fcsl_machine_t *machine,
                             fcsl_error_t *error);

#endif /* BOARD_BOARD_PLAN_H */
