/* SPDX-License-Identifier: Apache-2.0
 *
 * Lines from one thread to another.
 */
#include "fcsl/fcsl_log.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

void fcsl_log_write(fcsl_log_t *log, const char *text)
{
    const uint32_t number = atomic_load_explicit(&log->written, memory_order_relaxed);
    if (number - atomic_load_explicit(&log->read, memory_order_acquire) >= FCSL_LOG_LINES) {
        atomic_fetch_add_explicit(&log->dropped, 1u, memory_order_relaxed);
        return;
    }
    char *line = log->lines[number % FCSL_LOG_LINES];
    size_t length = 0;
    while (length < FCSL_LOG_BYTES - 1u && text[length] != '\0') {
        length++;
    }
    memcpy(line, text, length);
    line[length] = '\0';
    atomic_store_explicit(&log->written, number + 1u, memory_order_release);
}

static int read_dropped(fcsl_log_t *log, char text[FCSL_LOG_BYTES])
{
    const uint64_t dropped = atomic_load_explicit(&log->dropped, memory_order_relaxed);
    if (dropped == log->dropped_reported) {
        return 0;
    }
    (void)snprintf(text, FCSL_LOG_BYTES, "%" PRIu64 " lines were not printed: whoever takes them was too slow",
                   dropped - log->dropped_reported);
    log->dropped_reported = dropped;
    return 1;
}

int fcsl_log_read(fcsl_log_t *log, char text[FCSL_LOG_BYTES])
{
    const uint32_t number = atomic_load_explicit(&log->read, memory_order_relaxed);
    if (number == atomic_load_explicit(&log->written, memory_order_acquire)) {
        return read_dropped(log, text);
    }
    memcpy(text, log->lines[number % FCSL_LOG_LINES], FCSL_LOG_BYTES);
    atomic_store_explicit(&log->read, number + 1u, memory_order_release);
    return 1;
}
