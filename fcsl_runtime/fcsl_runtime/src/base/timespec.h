/* SPDX-License-Identifier: Apache-2.0
 *
 * Nanoseconds as the system's calls want them.
 */
#ifndef BASE_TIMESPEC_H
#define BASE_TIMESPEC_H

#include <stdint.h>
#include <time.h>

static inline struct timespec timespec_of(uint64_t ns)
{
    enum { NS_PER_S = 1000000000 };
    return (struct timespec){.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = (long)(ns % NS_PER_S)};
}

#endif /* BASE_TIMESPEC_H */
