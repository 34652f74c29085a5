/* SPDX-License-Identifier: Apache-2.0
 *
 * One round follows the history to its end, or until the bus has no room, and naps. While nobody observes, it only keeps up.
 */
#define _GNU_SOURCE
#include "publisher.h"

#include <time.h>

#include "fcsl/fcsl_tick_time.h"
#include "reproduction.h"

/* How long the last ticks may take to leave. */
static const uint64_t LAST_NS = 1000000000u;

static void count(_Atomic uint64_t *number, uint64_t more)
{
    atomic_fetch_add_explicit(number, more, memory_order_relaxed);
}

static void nap(const fcsl_observers_t *o)
{
    const struct timespec time = {.tv_nsec = (long)o->nap_ns};
    (void)nanosleep(&time, NULL);
}

static int at_end(const fcsl_observers_t *o)
{
    return o->cursor >= fcsl_history_published(o->history);
}

/* Ticks between this publication and the one seen before it, if some were overtaken. Ticks that a restore jumped over were
 * never there: at most as many as publications were lost. */
static uint64_t dropped_before(const fcsl_observers_t *o, uint64_t completed)
{
    const uint64_t between = completed > o->completed ? completed - o->completed - 1u : 0u;
    return between < o->overtaken ? between : o->overtaken;
}

/* A publication: that of a tick is put; a command's, of the same tick once more, is not. */
static void see(fcsl_observers_t *o, const fcsl_moment_t *moment)
{
    const uint64_t completed = moment->tick;
    const int written = fcsl_observers_post_writes(o, moment) == 0;
    fcsl_observers_answer_checkpoint(o, moment);
    if (completed == o->completed || completed == 0) {
        return;
    }
    const uint64_t tick = completed - 1u;
    count(&o->dropped, dropped_before(o, completed));
    o->overtaken = 0;
    o->completed = completed;
    const int posted =
        written && fcsl_mirror_post(o->mirror, o->publication, tick, fcsl_tick_time_ns(o->tick_hz, tick)) == 0;
    count(posted ? &o->ticks : &o->dropped, 1);
}

static void pass_over(fcsl_observers_t *o)
{
    fcsl_mirror_begin(o->mirror);
    fcsl_journal_pass(o->journal);
    o->cursor = fcsl_history_published(o->history);
    o->overtaken = 0;
}

/* Puts what has been published. 1 when that was all, or all that there is room for; bounded, since a host may publish faster
 * than this. */
static int follow(fcsl_observers_t *o)
{
    fcsl_moment_t moment;
    fcsl_journal_follow(o->journal, fcsl_mirror_writes_watched(o->mirror));
    if (!fcsl_mirror_watched(o->mirror)) {
        pass_over(o);
        return 1;
    }
    for (uint32_t i = 0; i < 2u * o->history->slots; i++) {
        if (!fcsl_mirror_ready(o->mirror)) {
            return 1;
        }
        const fcsl_history_status_t status = fcsl_history_read(o->history, o->cursor, &moment, o->publication);
        if (status == FCSL_HISTORY_COMING) {
            return 1;
        }
        if (status == FCSL_HISTORY_GONE) {
            const uint64_t cursor = fcsl_history_catch_up(o->history, o->cursor);
            o->overtaken += cursor - o->cursor;
            o->cursor = cursor;
        } else {
            o->cursor++;
            see(o, &moment);
        }
    }
    return 0;
}

/* The host publishes nothing more. */
static void finish(fcsl_observers_t *o)
{
    const uint64_t deadline_ns = fcsl_run_monotonic_ns(NULL) + LAST_NS;
    (void)follow(o);
    while (!at_end(o) && fcsl_run_monotonic_ns(NULL) < deadline_ns) {
        nap(o);
        (void)follow(o);
    }
    count(&o->dropped, o->overtaken + fcsl_history_published(o->history) - o->cursor);
}

void *fcsl_observers_publish(void *observers)
{
    fcsl_observers_t *o = observers;
    while (!atomic_load(&o->stop)) {
        if (follow(o)) {
            nap(o);
        }
    }
    finish(o);
    return NULL;
}
