/* SPDX-License-Identifier: Apache-2.0
 *
 * What drives which channel, as the command line says it.
 */
#ifndef GUARD_OUTPUT_ASSIGNMENT_H
#define GUARD_OUTPUT_ASSIGNMENT_H

#include "fcsl/fcsl_run.h"

enum { ASSIGNMENT_TEXT_BYTES = 512 };

/* One --actuator: CHANNEL=DRIVER[.SIGNAL][:DEVICE], or CHANNEL=none. */
typedef struct {
    uint32_t channel; /* index in the machine's channels */
    char driver[ASSIGNMENT_TEXT_BYTES]; /* NAME or LIBRARY.so:NAME; "": nothing drives the channel */
    char signal[ASSIGNMENT_TEXT_BYTES]; /* "": the only one that fits */
    const char *device; /* "" without one; lasts as long as the text */
} output_assignment_t;

/* Reads `count` texts into as many entries: each actuator channel of the machine must be in exactly one. 0, or -1. */
int output_assignments_read(const fcsl_machine_t *machine, const char *const *texts, uint32_t count,
                            output_assignment_t *assignments, fcsl_error_t *error);

#endif /* GUARD_OUTPUT_ASSIGNMENT_H */
