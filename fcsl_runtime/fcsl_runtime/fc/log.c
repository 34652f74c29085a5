/* SPDX-License-Identifier: Apache-2.0
 *
 * Lines on standard output and standard error that never wait for a reader.
 */
#define _GNU_SOURCE
#include "log.h"

#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#ifndef FCSL_PROGRAM /* CMake defines it */
#define FCSL_PROGRAM "fcsl"
#endif

/* A pipe with any room takes this much at once. */
enum { LINE_BYTES = PIPE_BUF };

void log_fill_standard(void)
{
    int fd = 0;
    while (fd >= 0 && fd <= STDERR_FILENO) {
        fd = open("/dev/null", O_RDWR);
    }
    if (fd > STDERR_FILENO) {
        (void)close(fd);
    }
}

static void put_line(int fd, const char *format, va_list arguments)
{
    char line[LINE_BYTES] = FCSL_PROGRAM ": ";
    const size_t begin = strlen(line);
    (void)vsnprintf(line + begin, sizeof line - begin - 1u, format, arguments);
    const size_t length = strlen(line);
    line[length] = '\n';
    struct pollfd output = {.fd = fd, .events = POLLOUT};
    if (poll(&output, 1, 0) > 0 && (output.revents & POLLOUT) != 0) {
        const ssize_t written = write(fd, line, length + 1u);
        (void)written; /* there is nowhere left to say it */
    }
}

void log_info(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    put_line(STDOUT_FILENO, format, arguments);
    va_end(arguments);
}

void log_error(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    put_line(STDERR_FILENO, format, arguments);
    va_end(arguments);
}
