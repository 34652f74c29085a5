/* SPDX-License-Identifier: Apache-2.0
 *
 * What a machine reports: the list that it appends to, how often each event may be told, and the last ones, for any thread.
 */
#include "events.h"

#include <inttypes.h>
#include <stdlib.h>

#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_seqlock.h"
#include "record/recorder.h"

enum {
    KEPT_WORDS = (sizeof(fcsl_told_event_t) + FCSL_SEQLOCK_WORD_BYTES - 1u) / FCSL_SEQLOCK_WORD_BYTES,
};

/* Of a site: the second of the machine in which it was told last, how often, and what was suppressed since. */
typedef struct {
    uint64_t second;
    uint32_t told;
    uint32_t suppressed;
} limit_t;

/* Event number n of the run is in slot n % FCSL_EVENTS_KEPT, with the sequence 2 * n + 2. */
typedef struct {
    _Atomic uint64_t sequence;
    _Atomic uint64_t words[KEPT_WORDS];
} slot_t;

struct fcsl_event_run {
    fcsl_events_t list;      /* of the tick that runs, or of the last one */
    fcsl_events_t recorded;  /* of a replay: for the tick that comes */
    limit_t *limits;         /* by site */
    uint64_t first;          /* number of the first one of the last tick */
    _Atomic uint64_t told;
    _Atomic uint64_t suppressed;
    _Atomic uint64_t lost;
    slot_t kept[FCSL_EVENTS_KEPT];
};

int fcsl_events_open(fcsl_run_t *run, fcsl_error_t *error)
{
    const uint32_t count = run->machine->event_site_count;
    if (count == 0) {
        return 0;
    }
    run->events = calloc(1, sizeof *run->events);
    if (run->events != NULL) {
        run->events->limits = calloc(count, sizeof *run->events->limits);
    }
    if (run->events == NULL || run->events->limits == NULL) {
        return fcsl_fail(error, "out of memory for the events of machine '%s'", run->machine->name);
    }
    run->host.events = &run->events->list;
    return 0;
}

void fcsl_events_free(fcsl_run_t *run)
{
    if (run->events != NULL) {
        free(run->events->limits);
        free(run->events);
    }
}

void fcsl_events_begin(fcsl_run_t *run)
{
    run->events->list.count = 0;
    run->events->list.lost = 0;
}

void fcsl_events_restart(fcsl_run_t *run)
{
    if (run->events != NULL) {
        memset(run->events->limits, 0, run->machine->event_site_count * sizeof *run->events->limits);
    }
}

static void count(_Atomic uint64_t *number, uint64_t more)
{
    const uint64_t before = atomic_load_explicit(number, memory_order_relaxed);
    atomic_store_explicit(number, before + more, memory_order_release);
}

static void keep(struct fcsl_event_run *events, const fcsl_told_event_t *event)
{
    const uint64_t number = atomic_load_explicit(&events->told, memory_order_relaxed);
    slot_t *slot = &events->kept[number % FCSL_EVENTS_KEPT];
    fcsl_seqlock_begin(&slot->sequence, 2u * number + 1u);
    fcsl_seqlock_store(slot->words, event, sizeof *event);
    fcsl_seqlock_end(&slot->sequence, 2u * number + 2u);
    count(&events->told, 1);
}

void fcsl_events_tell(fcsl_run_t *run, uint64_t tick)
{
    struct fcsl_event_run *events = run->events;
    events->first = atomic_load_explicit(&events->told, memory_order_relaxed);
    if (events->list.count == 0 && events->list.lost == 0) {
        return;
    }
    const uint64_t second = tick / run->machine->tick_hz;
    count(&events->lost, events->list.lost);
    for (uint32_t i = 0; i < events->list.count; i++) {
        const fcsl_event_t *reported = &events->list.list[i];
        if (reported->site >= run->machine->event_site_count) {
            count(&events->lost, 1);
            continue;
        }
        limit_t *limit = &events->limits[reported->site];
        if (limit->second != second) {
            limit->second = second;
            limit->told = 0;
        }
        if (limit->told >= FCSL_EVENTS_PER_SECOND) {
            limit->suppressed++;
            count(&events->suppressed, 1);
            continue;
        }
        fcsl_told_event_t event = {.tick = tick, .site = reported->site, .suppressed = limit->suppressed};
        memcpy(event.values, reported->values, sizeof event.values);
        limit->told++;
        limit->suppressed = 0;
        keep(events, &event);
    }
}

void fcsl_events_record(fcsl_run_t *run, uint64_t tick)
{
    const uint64_t told = atomic_load_explicit(&run->events->told, memory_order_relaxed);
    fcsl_told_event_t events[FCSL_EVENTS_PER_TICK];
    uint32_t recorded = 0;
    for (uint64_t number = run->events->first; number < told; number++) {
        recorded += fcsl_run_event(run, number, &events[recorded]) == 0;
    }
    if (recorded > 0) {
        fcsl_recorder_events(run->recorder, fcsl_run_stamp(run, tick), events, recorded);
    }
}

/* ---- the record of instances with I/O ---------------------------------------------------------------------------- */

/* The first site of an instance; those of the others follow in their order. */
static uint32_t first_site(const fcsl_machine_t *machine, uint32_t instance)
{
    uint32_t site = 0;
    while (site < machine->event_site_count && machine->event_sites[site].instance < instance) {
        site++;
    }
    return site;
}

static int is_of(const fcsl_machine_t *machine, uint32_t site, uint32_t instance)
{
    return site < machine->event_site_count && machine->event_sites[site].instance == instance;
}

uint32_t fcsl_events_left(const fcsl_run_t *run, uint32_t instance, uint8_t bytes[FCSL_EVENTS_LEFT_MAX])
{
    const fcsl_machine_t *machine = run->machine;
    const uint32_t first = first_site(machine, instance);
    uint8_t *at = bytes;
    for (uint32_t i = 0; i < run->events->list.count; i++) {
        const fcsl_event_t *event = &run->events->list.list[i];
        if (!is_of(machine, event->site, instance)) {
            continue;
        }
        const uint64_t site = event->site - first;
        fcsl_scalars_export(at, &site, FCSL_U64, 1);
        fcsl_scalars_export(at + 8, event->values, FCSL_U64, FCSL_EVENT_VALUES);
        at += FCSL_EVENT_RECORD_BYTES;
    }
    return (uint32_t)(at - bytes);
}

int fcsl_run_substitute_events(fcsl_run_t *run, uint32_t instance, const void *bytes, uint32_t size,
                               fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (instance >= machine->instance_count || run->impure[instance].size == 0 || run->events == NULL) {
        return fcsl_fail(error, "instance number %" PRIu32 " has no recorded events: it is run in a replay", instance);
    }
    fcsl_events_t *recorded = &run->events->recorded;
    if (size % FCSL_EVENT_RECORD_BYTES != 0 ||
        size / FCSL_EVENT_RECORD_BYTES > FCSL_EVENTS_PER_TICK - recorded->count) {
        return fcsl_fail(error, "%" PRIu32 " bytes are no events of one tick", size);
    }
    const uint32_t first = first_site(machine, instance);
    const uint8_t *at = bytes;
    for (uint32_t i = 0; i < size / FCSL_EVENT_RECORD_BYTES; i++, at += FCSL_EVENT_RECORD_BYTES) {
        uint64_t site = 0;
        fcsl_scalars_import((uint8_t *)&site, at, FCSL_U64, 1);
        if (site >= machine->event_site_count || !is_of(machine, first + (uint32_t)site, instance)) {
            return fcsl_fail(error, "instance '%s' has no event number %" PRIu64, machine->instances[instance].name,
                             site);
        }
        fcsl_event_t *event = &recorded->list[recorded->count + i];
        event->site = first + (uint32_t)site;
        fcsl_scalars_import((uint8_t *)event->values, at + 8, FCSL_U64, FCSL_EVENT_VALUES);
    }
    recorded->count += size / FCSL_EVENT_RECORD_BYTES;
    return 0;
}

void fcsl_events_substitute(fcsl_run_t *run, uint32_t instance)
{
    const fcsl_events_t *recorded = &run->events->recorded;
    fcsl_events_t *list = &run->events->list;
    for (uint32_t i = 0; i < recorded->count && list->count < FCSL_EVENTS_PER_TICK; i++) {
        if (is_of(run->machine, recorded->list[i].site, instance)) {
            list->list[list->count++] = recorded->list[i];
        }
    }
}

void fcsl_events_settle(fcsl_run_t *run)
{
    run->events->recorded.count = 0;
}

/* ---- reading --------------------------------------------------------------------------------------------------------- */

fcsl_event_counts_t fcsl_run_event_counts(const fcsl_run_t *run)
{
    const struct fcsl_event_run *events = run->events;
    if (events == NULL) {
        return (fcsl_event_counts_t){0};
    }
    return (fcsl_event_counts_t){
        .told = atomic_load_explicit(&events->told, memory_order_acquire),
        .suppressed = atomic_load_explicit(&events->suppressed, memory_order_acquire),
        .lost = atomic_load_explicit(&events->lost, memory_order_acquire),
    };
}

int fcsl_run_event(const fcsl_run_t *run, uint64_t number, fcsl_told_event_t *event)
{
    if (run->events == NULL) {
        return -1;
    }
    const slot_t *slot = &run->events->kept[number % FCSL_EVENTS_KEPT];
    const uint64_t wanted = 2u * number + 2u;
    if (atomic_load_explicit(&slot->sequence, memory_order_acquire) != wanted) {
        return -1;
    }
    fcsl_seqlock_load(event, slot->words, sizeof *event);
    return fcsl_seqlock_unchanged(&slot->sequence, wanted) ? 0 : -1;
}

uint64_t fcsl_run_next_event(const fcsl_run_t *run, uint64_t number, fcsl_told_event_t *event)
{
    const uint64_t told = fcsl_run_event_counts(run).told;
    while (number < told) {
        const uint64_t oldest = told > FCSL_EVENTS_KEPT ? told - FCSL_EVENTS_KEPT : 0;
        number = number > oldest ? number : oldest;
        if (fcsl_run_event(run, number, event) == 0) {
            return number + 1u;
        }
        number++;
    }
    return 0;
}
