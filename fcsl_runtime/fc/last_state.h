/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_LAST_STATE_H
#define FC_LAST_STATE_H

#include "loop.h"

/* Finds out at the start whether `path` can be written at the end. 0, or -1 with `error`. */
int last_state_check(const char *path, fcsl_error_t *error);

/* Writes the last published tick, state and health, what was counted and both histograms as JSON (docs/flight.md); `ended`
 * says why the run is over. From any thread. 0, or -1 with `error`. */
int last_state_write(const char *path, const loop_t *loop, const char *ended, fcsl_error_t *error);

#endif /* FC_LAST_STATE_H */
