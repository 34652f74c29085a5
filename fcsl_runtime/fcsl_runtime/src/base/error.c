/* SPDX-License-Identifier: Apache-2.0
 *
 * Error texts.
 */
#include "error.h"

#include <stdarg.h>
#include <stdio.h>

int fcsl_fail(fcsl_error_t *error, const char *format, ...)
{
    if (error != NULL) {
        va_list arguments;
        va_start(arguments, format);
        (void)vsnprintf(error->text, sizeof error->text, format, arguments);
        va_end(arguments);
    }
    return -1;
}
