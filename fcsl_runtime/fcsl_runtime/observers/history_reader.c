/* SPDX-License-Identifier: Apache-2.0
 *
 * One round reads the history to its end, or until the sink has no room, and naps. While no tick is wanted, it only keeps up.
 */
#define _GNU_SOURCE
#include "history_reader.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"

/* How long the last ticks may take to leave. */
static const uint64_t LAST_NS = 1000000000u;

static void count(_Atomic uint64_t *number, uint64_t more)
{
    atomic_fetch_add_explicit(number, more, memory_order_relaxed);
}

static void nap(const history_reader_t *f)
{
    const struct timespec time = {.tv_nsec = (long)f->poll_ns};
    (void)nanosleep(&time, NULL);
}

static int at_end(const history_reader_t *f)
{
    return f->cursor >= fcsl_history_published(f->history);
}

/* Ticks between this publication and the one seen before it, if some were overtaken. Ticks that a restore jumped over were
 * never there: at most as many as publications were lost. */
static uint64_t dropped_before(const history_reader_t *f, uint64_t completed)
{
    const uint64_t between = completed > f->completed ? completed - f->completed - 1u : 0u;
    return between < f->overtaken ? between : f->overtaken;
}

/* A publication: that of a tick is put; a command's, of the same tick once more, is not. */
static void take_publication(history_reader_t *f, const fcsl_moment_t *moment)
{
    const uint64_t completed = moment->tick;
    if (f->sink.observe != NULL) {
        f->sink.observe(f->sink.ctx, moment, f->publication);
    }
    if (completed == f->completed || completed == 0) {
        return;
    }
    const published_tick_t tick = {.publication = f->publication,
                                   .number = completed - 1u,
                                   .begun_ns = moment->time_ns,
                                   .requires_arming = moment->requires_arming != 0u};
    count(&f->dropped, dropped_before(f, completed));
    f->overtaken = 0;
    f->completed = completed;
    count(f->sink.put(f->sink.ctx, &tick) == 0 ? &f->ticks : &f->dropped, 1);
}

static void skip(history_reader_t *f)
{
    f->sink.skip(f->sink.ctx);
    f->cursor = fcsl_history_published(f->history);
    f->overtaken = 0;
}

/* Puts what has been published. 1 when that was all, or all that there is room for; bounded, since a host may publish faster
 * than this. */
static int read_history(history_reader_t *f)
{
    fcsl_moment_t moment;
    if (!f->sink.wants(f->sink.ctx)) {
        skip(f);
        return 1;
    }
    for (uint32_t i = 0; i < 2u * f->history->slots; i++) {
        if (!f->sink.ready(f->sink.ctx)) {
            return 1;
        }
        const fcsl_history_status_t status = fcsl_history_read(f->history, f->cursor, &moment, f->publication);
        if (status == FCSL_HISTORY_COMING) {
            return 1;
        }
        if (status == FCSL_HISTORY_OVERWRITTEN) {
            const uint64_t cursor = fcsl_history_catch_up(f->history, f->cursor);
            f->overtaken += cursor - f->cursor;
            f->cursor = cursor;
        } else {
            f->cursor++;
            take_publication(f, &moment);
        }
    }
    return 0;
}

/* Ticks up to the host's last publication that were not put. */
static uint64_t left_behind(history_reader_t *f)
{
    fcsl_moment_t last;
    const uint64_t published = fcsl_history_published(f->history);
    if (published == 0u || fcsl_history_read(f->history, published - 1u, &last, f->publication) != FCSL_HISTORY_OK) {
        return 0;
    }
    f->overtaken += published - f->cursor;
    return dropped_before(f, last.tick + 1u);
}

/* The host publishes nothing more. */
static void finish(history_reader_t *f)
{
    const uint64_t deadline_ns = fcsl_monotonic_ns() + LAST_NS;
    (void)read_history(f);
    while (!at_end(f) && fcsl_monotonic_ns() < deadline_ns) {
        nap(f);
        (void)read_history(f);
    }
    count(&f->dropped, left_behind(f));
}

static void *run(void *reader)
{
    history_reader_t *f = reader;
    while (!atomic_load(&f->stop)) {
        if (read_history(f)) {
            nap(f);
        }
    }
    finish(f);
    return NULL;
}

int history_reader_open(history_reader_t *reader, const fcsl_history_t *history, uint64_t tick_hz,
                        const history_reader_sink_t *sink)
{
    reader->history = history;
    reader->sink = *sink;
    reader->poll_ns = fcsl_history_poll_ns(history, tick_hz);
    reader->cursor = fcsl_history_published(history);
    reader->publication = malloc(fcsl_history_bytes(history) + 1u);
    return reader->publication != NULL ? 0 : -1;
}

int history_reader_start(history_reader_t *reader, fcsl_error_t *error)
{
    const int code = pthread_create(&reader->thread, NULL, run, reader);
    reader->started = code == 0;
    return code == 0 ? 0 : fcsl_fail(error, "cannot start the thread of observers: %s", strerror(code));
}

void history_reader_stop(history_reader_t *reader)
{
    if (reader->started) {
        atomic_store(&reader->stop, 1);
        (void)pthread_join(reader->thread, NULL);
        reader->started = 0;
    }
}

void history_reader_close(history_reader_t *reader)
{
    history_reader_stop(reader);
    free(reader->publication);
    reader->publication = NULL;
}

uint64_t history_reader_ticks(const history_reader_t *reader)
{
    return atomic_load_explicit(&reader->ticks, memory_order_relaxed);
}

uint64_t history_reader_dropped(const history_reader_t *reader)
{
    return atomic_load_explicit(&reader->dropped, memory_order_relaxed);
}
