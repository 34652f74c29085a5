/* SPDX-License-Identifier: Apache-2.0
 *
 * Why something failed, for people.
 */
#ifndef FCSL_ERROR_H
#define FCSL_ERROR_H

#include <stdarg.h>
#include <stdio.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Every function that can fail fills this and returns a negative value (or null). */
typedef struct {
    char text[512];
} fcsl_error_t;

/* Fills `error` (may be null) as printf does, cut where there is no more room, and returns -1: a failing function says
 * `return fcsl_fail(error, …)`. */
__attribute__((format(printf, 2, 3))) static inline int fcsl_fail(fcsl_error_t *error, const char *format, ...)
{
    if (error != NULL) {
        va_list arguments;
        va_start(arguments, format);
        (void)vsnprintf(error->text, sizeof error->text, format, arguments);
        va_end(arguments);
    }
    return -1;
}

#ifdef __cplusplus
}
#endif

#endif /* FCSL_ERROR_H */
