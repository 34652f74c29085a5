/* SPDX-License-Identifier: Apache-2.0
 *
 * Lines from one thread to another.
 */
#include "fcsl/fcsl_log.h"

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

int fcsl_log_read(fcsl_log_t *log, char text[FCSL_LOG_BYTES])
{
    const uint32_t number = atomic_load_explicit(&log->read, memory_order_relaxed);
    if (number == atomic_load_explicit(&log->written, memory_order_acquire)) {
        return 0;
    }
    memcpy(text, log->lines[number % FCSL_LOG_LINES], FCSL_LOG_BYTES);
    atomic_store_explicit(&log->read, number + 1u, memory_order_release);
    return 1;
}
