/* SPDX-License-Identifier: Apache-2.0
 *
 * What generated code of `event(text, value, …)` calls: it appends to the list of its host, and a fault takes back what the
 * execute has appended. `host`, and its list, may be null.
 */
#ifndef FCSL_EVENT_H
#define FCSL_EVENT_H

#include <stdbool.h>
#include <string.h>

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Before an execute. `first_site`: of its instance. */
static inline void fcsl_event_begin(const fcsl_host_t *host, uint32_t first_site)
{
    if (host != NULL && host->events != NULL) {
        fcsl_events_t *events = host->events;
        events->first_site = first_site;
        events->count_before = events->count;
        events->lost_before = events->lost;
    }
}

/* After an execute that faulted. */
static inline void fcsl_event_undo(const fcsl_host_t *host)
{
    if (host != NULL && host->events != NULL) {
        host->events->count = host->events->count_before;
        host->events->lost = host->events->lost_before;
    }
}

/* `site`: counted from the first one of the instance. Values are as those below make them. */
static inline void fcsl_event(const fcsl_host_t *host, uint32_t site, uint64_t a, uint64_t b, uint64_t c, uint64_t d)
{
    if (host == NULL || host->events == NULL) {
        return;
    }
    fcsl_events_t *events = host->events;
    if (events->count >= FCSL_EVENTS_PER_TICK) {
        events->lost++;
        return;
    }
    fcsl_event_t *event = &events->list[events->count++];
    event->site = events->first_site + site;
    event->values[0] = a;
    event->values[1] = b;
    event->values[2] = c;
    event->values[3] = d;
}

static inline uint64_t fcsl_event_bool(bool value)
{
    return value ? 1u : 0u;
}

static inline uint64_t fcsl_event_i32(int32_t value)
{
    return (uint64_t)(int64_t)value;
}

static inline uint64_t fcsl_event_i64(int64_t value)
{
    return (uint64_t)value;
}

static inline uint64_t fcsl_event_u32(uint32_t value)
{
    return value;
}

static inline uint64_t fcsl_event_u64(uint64_t value)
{
    return value;
}

static inline uint64_t fcsl_event_f32(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline uint64_t fcsl_event_f64(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline uint64_t fcsl_event_health(int32_t value)
{
    return (uint64_t)(int64_t)value;
}

#ifdef __cplusplus
}
#endif

#endif /* FCSL_EVENT_H */
