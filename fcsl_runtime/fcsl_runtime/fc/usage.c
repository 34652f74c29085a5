/* SPDX-License-Identifier: Apache-2.0
 *
 * Errors of a command line, numbers, and the machine library.
 */
#define _GNU_SOURCE
#include "usage.h"

#include <errno.h>
#include <getopt.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#ifndef FCSL_PROGRAM /* CMake defines it */
#define FCSL_PROGRAM "fcsl"
#endif

enum { MESSAGE_BYTES = 128 };

int usage_error(const char *what, const char *which)
{
    (void)fprintf(stderr, FCSL_PROGRAM ": %s%s\nTry `" FCSL_PROGRAM " --help`.\n", what, which);
    return -1;
}

int usage_number(const char *name, const char *text, uint64_t min, uint64_t max, uint64_t *value)
{
    char *end = NULL;
    errno = 0;
    const unsigned long long number = strtoull(text, &end, 10);
    if (text[0] >= '0' && text[0] <= '9' && *end == '\0' && errno == 0 && number >= min && number <= max) {
        *value = number;
        return 0;
    }
    char message[MESSAGE_BYTES];
    if (max == INT64_MAX) {
        (void)snprintf(message, sizeof message, "--%s needs a positive integer, not ", name);
    } else {
        (void)snprintf(message, sizeof message, "--%s needs an integer from %" PRIu64 " to %" PRIu64 ", not ", name,
                       min, max);
    }
    return usage_error(message, text);
}

/* ms of a number of seconds with at most three decimals. Returns 0 if it is one. */
static int milliseconds(const char *text, uint64_t *value)
{
    enum { DECIMALS = 3, SECONDS_MAX = 1000000 };
    char *end = NULL;
    errno = 0;
    const unsigned long long seconds = strtoull(text, &end, 10);
    if (text[0] < '0' || text[0] > '9' || errno != 0 || seconds > SECONDS_MAX) {
        return -1;
    }
    uint64_t ms = 0;
    const char *decimals = *end == '.' ? end + 1 : end;
    for (int i = 0; i < DECIMALS; i++) {
        const int is_digit = *decimals >= '0' && *decimals <= '9';
        ms = 10u * ms + (is_digit ? (uint64_t)(*decimals - '0') : 0u);
        decimals += is_digit;
    }
    *value = 1000u * seconds + ms;
    return *decimals == '\0' ? 0 : -1;
}

int usage_seconds(const char *name, const char *text, uint64_t min_ms, uint64_t max_ms, uint64_t *value_ms)
{
    uint64_t ms = 0;
    if (milliseconds(text, &ms) == 0 && ms >= min_ms && ms <= max_ms) {
        *value_ms = ms;
        return 0;
    }
    char message[MESSAGE_BYTES];
    (void)snprintf(message, sizeof message, "--%s needs seconds from %g to %g, with at most three decimals, not ", name,
                   (double)min_ms / 1e3, (double)max_ms / 1e3);
    return usage_error(message, text);
}

int usage_library(int argc, char **argv, const char **library)
{
    if (optind + 1 != argc) {
        return usage_error(optind == argc ? "which machine library?" : "one machine library, not also ",
                           optind == argc ? "" : argv[optind + 1]);
    }
    *library = argv[optind];
    return 0;
}
