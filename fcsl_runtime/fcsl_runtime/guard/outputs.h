/* SPDX-License-Identifier: Apache-2.0
 *
 * The opened devices, and which of their signals each channel drives.
 */
#ifndef GUARD_OUTPUTS_H
#define GUARD_OUTPUTS_H

#include "fcsl/fcsl_driver.h"
#include "output_plan.h"

enum { OUTPUT_REASON_BYTES = 160 };

typedef struct {
    const char *name; /* of its driver as the plan says it: LIBRARY.so:NAME */
    const char *device;
    const fcsl_driver_t *driver;
    void *library; /* null: a driver built in */
    uint8_t *used; /* one byte per signal */
    void *state;
    int opened;
    uint64_t missed; /* writes that failed */
    char reason[OUTPUT_REASON_BYTES]; /* of the last one */
} output_device_t;

/* A value of the machine struct, and its place in the struct of a device. */
typedef struct {
    uint32_t device;
    uint32_t from;
    uint32_t to;
    uint32_t size;
} output_binding_t;

typedef struct {
    const fcsl_machine_t *machine;
    output_device_t *devices;
    uint32_t device_count;
    output_binding_t *bindings;
    uint32_t binding_count;
} outputs_t;

/* Finds the drivers of the plan, probes and opens each device once. `entries` must last until outputs_close. 0, or -1 with the
 * first error; a device that does not open keeps no other one from opening. */
int outputs_open(const fcsl_machine_t *machine, const plan_entry_t *entries, uint32_t count, outputs_t *outputs,
                 fcsl_error_t *error);
/* Writes the channels of the machine struct `data` to all devices that are open. Returns how many failed. */
uint32_t outputs_write(outputs_t *outputs, const void *data);
uint64_t outputs_missed(const outputs_t *outputs);
void outputs_close(outputs_t *outputs);

#endif /* GUARD_OUTPUTS_H */
