/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens, watches and closes the link to fcsl-guard. The loop writes to it.
 */
#include "guard_link.h"

#include "log.h"

int guard_link_open(loop_t *loop, const char *path, fcsl_error_t *error)
{
    if (path == NULL) {
        return 0;
    }
    if (fcsl_guard_connect(path, fcsl_run_machine(loop->run), &loop->guard, error) != 0) {
        return -1;
    }
    loop->guard_state = GUARD_THERE;
    return 0;
}

void guard_link_check(loop_t *loop)
{
    if (loop->guard_state == GUARD_THERE && fcsl_guard_has_ended(&loop->guard)) {
        loop->guard_state = GUARD_ENDED;
        log_error("fcsl-guard has ended: from here on the actuators get no command of this run");
    }
}

void guard_link_close(loop_t *loop)
{
    guard_link_check(loop);
    fcsl_guard_disconnect(&loop->guard);
}

const char *guard_state_name(guard_state_t state)
{
    switch (state) {
    case GUARD_THERE:
        return "there";
    case GUARD_ENDED:
        return "ended";
    default:
        return "none";
    }
}
