/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick has to show, as fcsl_msgs messages: the recorder writes them into bags, hosts publish them.
 */
#ifndef FCSL_TELEMETRY_H
#define FCSL_TELEMETRY_H

#include "cdr.h"
#include "run_internal.h"

/* Begins a message of `tick` with the header and tick number that all of them begin with. */
void fcsl_telemetry_begin(fcsl_cdr_t *cdr, const fcsl_run_t *run, uint64_t tick, uint8_t *bytes, size_t capacity);

/* The message of `tick`, which is the last one completed; returns as fcsl_run_telemetry does. */
int64_t fcsl_telemetry_write(const fcsl_run_t *run, fcsl_telemetry_t what, uint64_t tick, uint8_t *bytes,
                             size_t capacity);

#endif /* FCSL_TELEMETRY_H */
