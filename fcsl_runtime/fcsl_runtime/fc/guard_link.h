/* SPDX-License-Identifier: Apache-2.0
 *
 * The link to fcsl-guard, which takes the commands to the actuators (docs/hardware/arming.md).
 */
#ifndef FC_GUARD_LINK_H
#define FC_GUARD_LINK_H

#include "loop.h"

/* Gets the slot of the guard that listens on `path`; null: none. 0, or -1. */
int guard_link_open(loop_t *loop, const char *path, fcsl_error_t *error);
/* On the monitor thread: logs once that the guard has ended. */
void guard_link_check(loop_t *loop);
/* After the loop and the monitor thread: looks for the last time, and tells the guard that no command comes any more. */
void guard_link_close(loop_t *loop);
/* For the summary of a run: "none", "there" to the end, "ended" before. */
const char *guard_state_name(guard_state_t state);

#endif /* FC_GUARD_LINK_H */
