/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_LAST_STATE_H
#define FC_LAST_STATE_H

#include "loop.h"

/* Finds out at the start whether `path` can be written at the end. 0, or -1 with `error`. */
int last_state_check(const char *path, fcsl_error_t *error);

/* Writes what a run left as JSON (docs/hardware/flight_computer.md): tick, state and health of the machine struct `data` as published at
 * `moment`, what was counted, both histograms, and why it ended. From any thread. 0, or -1 with `error`. */
int last_state_write(const char *path, const loop_t *loop, const fcsl_moment_t *moment, const uint8_t *data,
                     const char *ended, fcsl_error_t *error);

#endif /* FC_LAST_STATE_H */
