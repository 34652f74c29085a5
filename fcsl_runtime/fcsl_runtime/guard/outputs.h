/* SPDX-License-Identifier: Apache-2.0
 *
 * The devices of a machine's actuators, and how the channels become their signals.
 */
#ifndef GUARD_OUTPUTS_H
#define GUARD_OUTPUTS_H

#include "board/output_device.h"
#include "board/output_map.h"
#include "output_assignment.h"

/* A value of the machine struct, and its place among the values of a device. */
typedef struct {
    output_device_t *device;
    const fcsl_channel_t *channel;
    uint32_t from; /* in the machine struct */
    uint32_t to;
    uint32_t size; /* bytes */
    uint8_t type; /* fcsl_type_t */
    const board_pulse_t *rule; /* of a scalar that becomes a pulse; null: it is copied */
    output_map_t map;
} output_binding_t;

typedef struct {
    const fcsl_machine_t *machine;
    output_device_t **devices;
    uint32_t device_count;
    output_binding_t *bindings;
    uint32_t binding_count;
} outputs_t;

/* No devices, and room for so many of each. 0, or -1. */
int outputs_open(outputs_t *outputs, const fcsl_machine_t *machine, uint32_t devices, uint32_t bindings,
                 fcsl_error_t *error);
/* Adds what --actuator assigns: finds drivers, opens none. 0, or -1. */
int outputs_add_actuators(outputs_t *outputs, const output_assignment_t *assignments, uint32_t count,
                          fcsl_error_t *error);
/* Adds what the plan of a board, read from `file`, says. Every element of every actuator channel must have a pulse. `plan` must last
 * until outputs_close. 0, or -1. */
int outputs_add_board(outputs_t *outputs, const board_plan_t *plan, const char *file, fcsl_error_t *error);

/* The device of this driver and address, which several channels may name; added when it is new. Null with `error`. */
output_device_t *outputs_find_device(outputs_t *outputs, const char *driver, const char *address, fcsl_error_t *error);
/* Drives a signal of the device with what the binding says, which lacks `to`. 0, or -1. */
int outputs_bind(outputs_t *outputs, const output_binding_t *binding, uint32_t signal, fcsl_error_t *error);

/* Opens each device, starts its thread and hands it the safe values of the machine struct `data`. A write that lasts for longer than `timeout_ns` is missed. 0, or -1 with the first error; a
 * device that does not open keeps no other one from starting. */
int outputs_start(outputs_t *outputs, const void *data, int priority, uint64_t timeout_ns, fcsl_error_t *error);
/* Hands the channels of the machine struct `data` to all devices that run, and waits for none. */
void outputs_put(outputs_t *outputs, const void *data, int armed, uint64_t now_ns);
/* Hands over safe values as outputs_put does, and waits until all devices have taken them; all get them again every period until then.
 * Returns how many have not taken them within `limit_ns`. */
uint32_t outputs_make_safe(outputs_t *outputs, const void *data, uint64_t period_ns, uint64_t limit_ns);
uint64_t outputs_missed(const outputs_t *outputs);
void outputs_close(outputs_t *outputs);

#endif /* GUARD_OUTPUTS_H */
