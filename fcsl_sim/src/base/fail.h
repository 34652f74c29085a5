/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_SIM_FAIL_H
#define FCSL_SIM_FAIL_H

#include <stdarg.h>
#include <stdio.h>

#include "fcsl/fcsl_run.h"

/* Fills `error` (may be null) and returns -1, so that a failing function reads `return fcsl_sim_fail(error, …)`. */
__attribute__((format(printf, 2, 3))) static inline int fcsl_sim_fail(fcsl_error_t *error, const char *format, ...)
{
    if (error) {
        va_list arguments;
        va_start(arguments, format);
        (void)vsnprintf(error->text, sizeof error->text, format, arguments); /* a longer message is truncated */
        va_end(arguments);
    }
    return -1;
}

#endif /* FCSL_SIM_FAIL_H */
