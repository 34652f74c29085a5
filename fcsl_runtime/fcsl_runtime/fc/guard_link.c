/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens, watches and closes the link to fcsl-guard. The loop writes to it.
 */
#include "guard_link.h"

#include "log.h"

int guard_link_open(loop_t *loop, const char *path, fcsl_error_t *error)
{
    return path == NULL
               ? 0
               : fcsl_guard_connect(path, fcsl_run_machine(loop->run), &loop->guard, error->text, sizeof error->text);
}

void guard_link_check(loop_t *loop)
{
    if (!loop->guard_gone && fcsl_guard_is_gone(&loop->guard)) {
        loop->guard_gone = 1;
        log_error("fcsl-guard has ended: from here on the actuators get no command of this run");
    }
}

void guard_link_close(loop_t *loop)
{
    fcsl_guard_disconnect(&loop->guard);
}
