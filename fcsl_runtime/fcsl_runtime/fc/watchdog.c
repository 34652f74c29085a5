/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds a step that takes too long while it runs.
 */
#include "watchdog.h"

#include <inttypes.h>
#include <stdio.h>

int watchdog_finds(watchdog_t *watchdog, uint64_t begun_ns, uint64_t now_ns)
{
    if (watchdog->limit_ns == 0 || begun_ns == 0 || begun_ns == watchdog->reported_ns ||
        now_ns < begun_ns + watchdog->limit_ns) {
        return 0;
    }
    watchdog->reported_ns = begun_ns;
    return 1;
}

/* The number that a step stores before each execute, for this purpose alone. Step is plain C for targets without atomics, so
 * a race detector must not look here; an aligned word is read whole. */
__attribute__((no_sanitize_thread)) static int32_t current_instance(const loop_t *loop)
{
    const uint8_t *data = fcsl_run_data(loop->run);
    return *(const volatile int32_t *)(const volatile void *)(data + fcsl_run_machine(loop->run)->current_offset);
}

void watchdog_describe(const loop_t *loop, uint64_t now_ns, char *text, size_t capacity)
{
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    const uint64_t begun_ns = fcsl_tick_stats_get(&loop->stats.begun_ns);
    const int32_t current = current_instance(loop);
    const uint64_t tick = fcsl_tick_stats_get(&loop->stats.tick);
    if (begun_ns == 0) {
        (void)snprintf(text, capacity, "the step thread is between two ticks, behind tick %" PRIu64, tick);
        return;
    }
    const int length = snprintf(text, capacity, "tick %" PRIu64 " has run for %" PRIu64 " ms, now ", tick,
                                now_ns > begun_ns ? (now_ns - begun_ns) / 1000000u : 0u);
    if (length < 0 || (size_t)length >= capacity) {
        return;
    }
    if (current >= 0 && (uint32_t)current < machine->instance_count) {
        const fcsl_instance_t *instance = &machine->instances[current];
        (void)snprintf(text + length, capacity - (size_t)length, "in instance '%s' (%s:%" PRIu32 ")", instance->name,
                       instance->source_file, instance->source_line);
    } else {
        (void)snprintf(text + length, capacity - (size_t)length, "outside its instances");
    }
}
