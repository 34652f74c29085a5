/* SPDX-License-Identifier: Apache-2.0
 *
 * Pins, converters and registers of a board.
 */
#define _POSIX_C_SOURCE 200809L
#include "board_hardware.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "output_device.h"
#include "register_window.h"

enum { NEWS_BYTES = 512, POLL_NS = 1000000 };
static const uint64_t TIMEOUT_NS = 100000000u; /* a write that lasts longer has failed */
static const uint64_t END_NS = 1000000000u;
static const uint64_t NEWS_NS = 1000000000u; /* between two texts of a device */
static const double ON = 0.5; /* the least value of a signal that is on */

/* A device that has driven pins. */
typedef struct {
    output_device_t *device; /* null: it has none */
    uint64_t missed; /* writes, as of the last tick */
    uint64_t lost; /* how often it began to fail */
    int is_failing;
    int is_reported; /* that it fails */
    uint64_t reported_ns;
} output_t;

struct board_hardware {
    const board_plan_t *plan;
    board_devices_t *inputs;
    output_t outputs[BOARD_DEVICES_MAX]; /* by device of the plan */
    uint32_t pin_at[BOARD_PINS_MAX]; /* of inputs: in the samples of the device; of outputs: among its values */
    uint8_t levels[BOARD_PINS_MAX]; /* of outputs */
    uint32_t converter_at[BOARD_CONVERTERS_MAX];
    register_window_t windows[BOARD_REGISTERS_MAX];
    struct fcsl_hw table;
    int is_started;
    char news[NEWS_BYTES];
};

/* ---- levels --------------------------------------------------------------------------------------------------------- */

static void put_levels(board_hardware_t *hardware, uint32_t device)
{
    const board_plan_t *plan = hardware->plan;
    output_device_t *output = hardware->outputs[device].device;
    uint8_t *values = output_device_values(output);
    for (uint32_t i = 0; i < plan->pin_count; i++) {
        if (plan->pins[i].is_output && plan->pins[i].device == device) {
            const double level = hardware->levels[i] != 0u ? 1.0 : 0.0;
            memcpy(values + hardware->pin_at[i], &level, sizeof level);
        }
    }
    output_device_put(output, fcsl_monotonic_ns());
}

static int is_open(const output_t *output)
{
    return output->device != NULL && output_device_is_open(output->device);
}

/* By the writes before this one: one that still lasts says nothing yet. */
static void judge(output_t *output)
{
    const uint64_t missed = output_device_missed(output->device);
    const int was_failing = output->is_failing;
    if (missed != output->missed) {
        output->is_failing = 1;
    } else if (!output_device_is_busy(output->device)) {
        output->is_failing = 0;
    }
    output->missed = missed;
    output->lost += output->is_failing && !was_failing;
}

void board_hardware_tick(board_hardware_t *hardware)
{
    for (uint32_t d = 0; d < hardware->plan->device_count; d++) {
        if (is_open(&hardware->outputs[d])) {
            judge(&hardware->outputs[d]);
            put_levels(hardware, d);
        }
    }
}

static void set_safe_levels(board_hardware_t *hardware)
{
    for (uint32_t i = 0; i < hardware->plan->pin_count; i++) {
        hardware->levels[i] = hardware->plan->pins[i].safe != 0;
    }
}

/* ---- the table ------------------------------------------------------------------------------------------------------ */

/* Index of the pin, or the count of pins. */
static uint32_t find_pin(const board_plan_t *plan, uint32_t number)
{
    uint32_t i = 0;
    while (i < plan->pin_count && plan->pins[i].number != number) {
        i++;
    }
    return i;
}

/* A value of a device that is read. 0, or -1. */
static int32_t latest(const board_hardware_t *hardware, uint32_t device, uint32_t at, double *value)
{
    const device_sample_t *sample = board_devices_latest(hardware->inputs, device);
    *value = sample != NULL ? sample->values[at] : 0.0;
    return sample != NULL ? 0 : -1;
}

static int32_t read_gpio(void *ctx, uint32_t number, bool *level)
{
    const board_hardware_t *hardware = ctx;
    const board_plan_t *plan = hardware->plan;
    const uint32_t i = find_pin(plan, number);
    double value = 0.0;
    if (i == plan->pin_count) {
        return -1;
    }
    if (plan->pins[i].is_output) {
        *level = hardware->levels[i] != 0u;
        return 0;
    }
    if (latest(hardware, plan->pins[i].device, hardware->pin_at[i], &value) != 0 || isnan(value)) {
        return -1; /* NaN: the device does not tell */
    }
    *level = value >= ON;
    return 0;
}

static int32_t write_gpio(void *ctx, uint32_t number, bool level)
{
    board_hardware_t *hardware = ctx;
    const board_plan_t *plan = hardware->plan;
    const uint32_t i = find_pin(plan, number);
    if (i == plan->pin_count || !plan->pins[i].is_output) {
        return -1;
    }
    hardware->levels[i] = level ? 1u : 0u;
    return 0;
}

static int32_t read_adc(void *ctx, uint32_t number, uint32_t *counts)
{
    const board_hardware_t *hardware = ctx;
    const board_plan_t *plan = hardware->plan;
    double value = 0.0;
    for (uint32_t i = 0; i < plan->converter_count; i++) {
        if (plan->converters[i].number == number) {
            if (latest(hardware, plan->converters[i].device, hardware->converter_at[i], &value) != 0 ||
                !(value >= 0.0 && value <= (double)UINT32_MAX)) {
                return -1;
            }
            *counts = (uint32_t)value;
            return 0;
        }
    }
    return -1;
}

/* The register, of a window that is written if `write`; or null. */
static volatile uint32_t *find_register(const board_hardware_t *hardware, uint32_t address, int write)
{
    for (uint32_t i = 0; i < hardware->plan->registers_count; i++) {
        volatile uint32_t *found = register_window_at(&hardware->windows[i], address);
        if (found != NULL) {
            return write && !hardware->plan->registers[i].is_written ? NULL : found;
        }
    }
    return NULL;
}

static int32_t read_u32(void *ctx, uint32_t address, uint32_t *value)
{
    const volatile uint32_t *found = find_register(ctx, address, 0);
    *value = found != NULL ? *found : 0u;
    return found != NULL ? 0 : -1;
}

static int32_t write_u32(void *ctx, uint32_t address, uint32_t value)
{
    volatile uint32_t *found = find_register(ctx, address, 1);
    if (found == NULL) {
        return -1;
    }
    *found = value;
    return 0;
}

const struct fcsl_hw *board_hardware_table(const board_hardware_t *hardware)
{
    return &hardware->table;
}

/* ---- opening -------------------------------------------------------------------------------------------------------- */

static int use_output(board_hardware_t *hardware, uint32_t i, fcsl_error_t *error)
{
    const board_pin_t *pin = &hardware->plan->pins[i];
    const board_device_t *device = &hardware->plan->devices[pin->device];
    output_t *output = &hardware->outputs[pin->device];
    fcsl_error_t why;
    if (output->device == NULL) {
        output->device = output_device_new(device->driver, device->address, &why);
    }
    if (output->device == NULL) {
        return fcsl_fail(error, "device '%.60s': %.400s", device->name, why.text);
    }
    const fcsl_driver_t *driver = output_device_driver(output->device);
    for (uint32_t s = 0; s < driver->signal_count; s++) {
        const fcsl_driver_signal_t *signal = &driver->signals[s];
        if (strcmp(signal->name, pin->signal) != 0 || signal->type != FCSL_F64 || signal->count != 1u) {
            continue;
        }
        hardware->pin_at[i] = signal->offset;
        return output_device_use(output->device, s) == 0
                   ? 0
                   : fcsl_fail(error, "device '%.60s': two pins drive signal '%.60s'", device->name, pin->signal);
    }
    return fcsl_fail(error, "device '%.60s': driver '%.60s' has no signal '%.60s' that is one f64", device->name,
                     device->driver, pin->signal);
}

static int use_input(const board_hardware_t *hardware, uint32_t device, const char *signal, uint32_t *at,
                     fcsl_error_t *error)
{
    const int found = board_devices_use(hardware->inputs, device, signal, error);
    *at = found >= 0 ? (uint32_t)found : 0u;
    return found >= 0 ? 0 : -1;
}

static int use_signals(board_hardware_t *hardware, fcsl_error_t *error)
{
    const board_plan_t *plan = hardware->plan;
    for (uint32_t i = 0; i < plan->pin_count; i++) {
        const board_pin_t *pin = &plan->pins[i];
        const int status = pin->is_output ? use_output(hardware, i, error)
                                          : use_input(hardware, pin->device, pin->signal, &hardware->pin_at[i], error);
        if (status != 0) {
            return -1;
        }
    }
    for (uint32_t i = 0; i < plan->converter_count; i++) {
        if (use_input(hardware, plan->converters[i].device, plan->converters[i].signal, &hardware->converter_at[i],
                      error) != 0) {
            return -1;
        }
    }
    return 0;
}

/* What the plan lacks stays null: the builtin fails then, and is counted. */
static void make_table(board_hardware_t *hardware)
{
    const board_plan_t *plan = hardware->plan;
    hardware->table.ctx = hardware;
    if (plan->pin_count > 0u) {
        hardware->table.read_gpio = read_gpio;
        hardware->table.write_gpio = write_gpio;
    }
    if (plan->converter_count > 0u) {
        hardware->table.read_adc = read_adc;
    }
    if (plan->registers_count > 0u) {
        hardware->table.read_u32 = read_u32;
        hardware->table.write_u32 = write_u32;
    }
}

board_hardware_t *board_hardware_new(const board_plan_t *plan, board_devices_t *inputs, fcsl_error_t *error)
{
    board_hardware_t *hardware = calloc(1, sizeof *hardware);
    if (hardware == NULL) {
        (void)fcsl_fail(error, "out of memory for pins and registers");
        return NULL;
    }
    hardware->plan = plan;
    hardware->inputs = inputs;
    make_table(hardware);
    if (use_signals(hardware, error) != 0) {
        board_hardware_free(hardware);
        return NULL;
    }
    return hardware;
}

int board_hardware_start(board_hardware_t *hardware, int priority, fcsl_error_t *error)
{
    const board_plan_t *plan = hardware->plan;
    fcsl_error_t why;
    for (uint32_t i = 0; i < plan->registers_count; i++) {
        if (register_window_open(&hardware->windows[i], &plan->registers[i], error) != 0) {
            return -1;
        }
    }
    for (uint32_t d = 0; d < plan->device_count; d++) {
        if (hardware->outputs[d].device != NULL &&
            output_device_start(hardware->outputs[d].device, priority, TIMEOUT_NS, &why) != 0) {
            return fcsl_fail(error, "device '%.60s': %.400s", plan->devices[d].name, why.text);
        }
    }
    hardware->is_started = 1;
    set_safe_levels(hardware);
    board_hardware_tick(hardware);
    return 0;
}

/* ---- what became of it ---------------------------------------------------------------------------------------------- */

int board_hardware_counts(const board_hardware_t *hardware, uint32_t device, device_counts_t *counts)
{
    const output_t *output = &hardware->outputs[device];
    if (output->device == NULL) {
        return 0;
    }
    *counts = (device_counts_t){
        .errors = output->missed, .lost = output->lost, .open = (uint64_t)(is_open(output) && !output->is_failing)};
    return 1;
}

static const char *reason_of(const output_t *output)
{
    const char *reason = output_device_reason(output->device);
    return reason[0] != '\0' ? reason : "the driver gives no reason";
}

const char *board_hardware_news(board_hardware_t *hardware)
{
    const uint64_t now = fcsl_monotonic_ns();
    for (uint32_t d = 0; d < hardware->plan->device_count; d++) {
        output_t *output = &hardware->outputs[d];
        if (output->is_failing == output->is_reported || now - output->reported_ns < NEWS_NS) {
            continue;
        }
        output->is_reported = output->is_failing;
        output->reported_ns = now;
        (void)snprintf(hardware->news, sizeof hardware->news, "device '%.60s' %s%s", hardware->plan->devices[d].name,
                       output->is_failing ? "fails: " : "takes its levels again",
                       output->is_failing ? reason_of(output) : "");
        return hardware->news;
    }
    return NULL;
}

/* ---- the end -------------------------------------------------------------------------------------------------------- */

/* Hands the levels to the devices that have written the last ones, and returns how many have not taken them; *one: the last of those. */
static uint32_t count_unsafe(board_hardware_t *hardware, int puts, uint32_t *one)
{
    uint32_t count = 0;
    for (uint32_t d = 0; d < hardware->plan->device_count; d++) {
        output_t *output = &hardware->outputs[d];
        if (!is_open(output) || output_device_has_taken(output->device)) {
            continue;
        }
        if (puts && !output_device_is_busy(output->device)) {
            put_levels(hardware, d);
        }
        *one = d;
        count++;
    }
    return count;
}

int board_hardware_end(board_hardware_t *hardware, fcsl_error_t *error)
{
    const struct timespec look = {.tv_nsec = POLL_NS};
    const uint64_t end_ns = fcsl_monotonic_ns() + END_NS;
    uint32_t one = 0;
    if (!hardware->is_started) {
        return 0;
    }
    hardware->is_started = 0;
    set_safe_levels(hardware);
    board_hardware_tick(hardware);
    for (uint32_t d = 0; d < hardware->plan->device_count; d++) {
        if (is_open(&hardware->outputs[d])) {
            output_device_await(hardware->outputs[d].device);
        }
    }
    uint32_t missing = count_unsafe(hardware, 0, &one);
    while (missing > 0u && fcsl_monotonic_ns() < end_ns) {
        (void)nanosleep(&look, NULL);
        missing = count_unsafe(hardware, 1, &one);
    }
    if (missing == 0u) {
        return 0;
    }
    return fcsl_fail(error, "pins of %s'%.60s' are NOT safe: %.200s",
                     missing > 1u ? "several devices, such as " : "device ", hardware->plan->devices[one].name,
                     reason_of(&hardware->outputs[one]));
}

void board_hardware_free(board_hardware_t *hardware)
{
    fcsl_error_t ignored; /* the flight has told it, or never began */
    if (hardware == NULL) {
        return;
    }
    (void)board_hardware_end(hardware, &ignored);
    const uint64_t until_ns = fcsl_monotonic_ns() + END_NS;
    for (uint32_t d = 0; d < hardware->plan->device_count; d++) {
        if (hardware->outputs[d].device != NULL) {
            output_device_end(hardware->outputs[d].device);
        }
    }
    for (uint32_t d = 0; d < hardware->plan->device_count; d++) {
        if (hardware->outputs[d].device != NULL) {
            output_device_free(hardware->outputs[d].device, until_ns);
        }
    }
    for (uint32_t i = 0; i < hardware->plan->registers_count; i++) {
        register_window_close(&hardware->windows[i]);
    }
    free(hardware);
}
