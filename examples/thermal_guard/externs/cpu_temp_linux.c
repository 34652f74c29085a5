/* SPDX-License-Identifier: Apache-2.0
 *
 * Linux: the first thermal zone, a file that holds millidegrees.
 */
#define _POSIX_C_SOURCE 200809L
#include "cpu_temp.h"

#include <fcntl.h>
#include <math.h>
#include <unistd.h>

#ifndef THERMAL_ZONE
#define THERMAL_ZONE "/sys/class/thermal/thermal_zone0/temp"
#endif

enum { TEXT_BYTES = 16, DIGITS_MAX = 9 };

/* "[-]digits[newline]" as an integer; -1 for any other text. */
static int parse(const char *text, int length, long *value)
{
    const int negative = length > 0 && text[0] == '-';
    int at = negative;
    long sum = 0;
    while (at < length && at - negative < DIGITS_MAX && text[at] >= '0' && text[at] <= '9') {
        sum = sum * 10 + (text[at] - '0');
        at++;
    }
    if (at == negative || (at < length && text[at] != '\n')) {
        return -1;
    }
    *value = negative ? -sum : sum;
    return 0;
}

double cpu_temp_c(void)
{
    char text[TEXT_BYTES];
    long millidegrees = 0;
    const int file = open(THERMAL_ZONE, O_RDONLY | O_CLOEXEC);
    if (file < 0) {
        return (double)NAN;
    }
    const int length = (int)read(file, text, sizeof text);
    (void)close(file);
    return length > 0 && parse(text, length, &millidegrees) == 0 ? (double)millidegrees / 1000.0 : (double)NAN;
}
