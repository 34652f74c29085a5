/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "tell.h"

#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* A pipe with any room takes this much at once. */
enum { LINE_BYTES = 1024 };

void tell(const char *format, ...)
{
    char line[LINE_BYTES] = "fcsl-fc: ";
    const size_t begin = strlen(line);
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(line + begin, sizeof line - begin - 1u, format, arguments);
    va_end(arguments);
    const size_t length = strlen(line);
    line[length] = '\n';
    struct pollfd output = {.fd = STDERR_FILENO, .events = POLLOUT};
    if (poll(&output, 1, 0) > 0 && (output.revents & POLLOUT) != 0) {
        const ssize_t written = write(STDERR_FILENO, line, length + 1u);
        (void)written; /* there is nowhere left to say it */
    }
}
