/* SPDX-License-Identifier: Apache-2.0
 *
 * The sender's thread: one round follows the history to its end, sends a part of the configuration if one is under way, and
 * naps.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_telemetry.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "channels.h"
#include "error.h"
#include "fcsl/fcsl_codec.h"
#include "link.h"
#include "resend.h"
#include "tick_time.h"

/* Datagrams of the configuration in one round: what a socket of the usual size holds while its reader is busy. */
enum { BURST = 32 };
static const uint64_t SECOND_NS = 1000000000u;
/* A nap is an eighth of what the history holds, so that a thread that is kept waiting is not overtaken at once. */
static const uint64_t NAP_MIN_NS = 50000u;
static const uint64_t NAP_MAX_NS = 2000000u;

struct fcsl_telemetry {
    const fcsl_history_t *history;
    catalog_t catalog;
    channels_t channels;
    link_t link;
    resend_t resend;
    packet_t configuration;    /* as it was last begun */
    uint32_t configuration_at; /* how much of it is sent */
    packet_t data;             /* the coming one */
    uint64_t tick_hz;
    uint64_t nap_ns;
    uint8_t *publication;
    uint8_t *body;
    uint64_t cursor;    /* publications looked at */
    uint64_t overtaken; /* of them, since the last one that was seen */
    uint64_t completed; /* ticks, in the last one that was seen */
    _Atomic uint64_t packets;
    _Atomic uint64_t configurations;
    _Atomic uint64_t missed;
    pthread_t thread;
    int started;
    atomic_int stop;
};

static uint64_t now_ns(void)
{
    return fcsl_run_monotonic_ns(NULL);
}

static void count(_Atomic uint64_t *number, uint64_t more)
{
    atomic_fetch_add_explicit(number, more, memory_order_relaxed);
}

/* ---- the configuration ---------------------------------------------------------------------------------------------- */

static void continue_configuration(fcsl_telemetry_t *t, uint32_t most)
{
    t->configuration_at = fcsl_link_send(&t->link, &t->configuration, t->configuration_at, most);
}

/* One that is still under way serves as well. */
static void begin_configuration(fcsl_telemetry_t *t)
{
    if (t->configuration_at < t->configuration.total) {
        return;
    }
    t->configuration_at = 0;
    t->configuration.sequence = t->data.sequence;
    count(&t->configurations, 1);
    continue_configuration(t, BURST);
}

/* ---- data ----------------------------------------------------------------------------------------------------------- */

/* How many of the first `completed` ticks are due. */
static uint64_t due(const fcsl_telemetry_t *t, uint64_t completed)
{
    return completed / t->link.every + (completed % t->link.every != 0);
}

/* What was due between this publication and the one seen before it, if some were overtaken. Ticks that a restore jumped
 * over were never there: at most as many as publications were lost. */
static uint64_t missed_before(const fcsl_telemetry_t *t, uint64_t completed)
{
    if (t->overtaken == 0 || completed <= t->completed) {
        return 0;
    }
    const uint64_t between = due(t, completed - 1u) - due(t, t->completed);
    return between < t->overtaken ? between : t->overtaken;
}

static void send_data(fcsl_telemetry_t *t, uint64_t tick)
{
    const data_head_t head = {.tick = tick,
                              .time_ns = fcsl_tick_time_ns(t->tick_hz, tick),
                              .missed = atomic_load_explicit(&t->missed, memory_order_relaxed)};
    if (fcsl_resend_due(&t->resend, t->data.sequence, 1, now_ns())) {
        begin_configuration(t);
    }
    fcsl_channels_pack(&t->channels, &head, t->publication, t->body);
    (void)fcsl_link_send(&t->link, &t->data, 0, UINT32_MAX);
    t->data.sequence++;
    count(&t->packets, 1);
}

/* A publication: that of a tick is sent if it is due; a command's, of the same tick once more, is not. */
static void see(fcsl_telemetry_t *t, uint64_t completed)
{
    if (completed == t->completed) {
        return;
    }
    count(&t->missed, missed_before(t, completed));
    t->overtaken = 0;
    t->completed = completed;
    if (completed > 0 && (completed - 1u) % t->link.every == 0) {
        send_data(t, completed - 1u);
    }
}

/* The history has overwritten what was to come: goes on in the middle of what it has. */
static void jump(fcsl_telemetry_t *t)
{
    const uint64_t published = fcsl_history_published(t->history);
    const uint64_t kept = t->history->slots / 2u;
    const uint64_t cursor = published > t->cursor + kept ? published - kept : t->cursor + 1u;
    t->overtaken += cursor - t->cursor;
    t->cursor = cursor;
}

/* Sends what has been published. 1 when that was all; bounded, since a host may publish faster than this. */
static int follow(fcsl_telemetry_t *t)
{
    fcsl_moment_t moment;
    for (uint32_t i = 0; i < 2u * t->history->slots; i++) {
        const fcsl_history_status_t status = fcsl_history_read(t->history, t->cursor, &moment, t->publication);
        if (status == FCSL_HISTORY_COMING) {
            return 1;
        }
        if (status == FCSL_HISTORY_GONE) {
            jump(t);
        } else {
            t->cursor++;
            see(t, moment.tick);
        }
    }
    return 0;
}

static void *send_all(void *argument)
{
    fcsl_telemetry_t *t = argument;
    const struct timespec nap = {.tv_nsec = (long)t->nap_ns};
    t->resend = fcsl_resend_begin(now_ns());
    begin_configuration(t);
    for (;;) {
        const int last = atomic_load(&t->stop);
        const int all = follow(t);
        if (last) {
            continue_configuration(t, UINT32_MAX);
            return NULL;
        }
        if (t->configuration_at < t->configuration.total) {
            continue_configuration(t, BURST);
        } else if (fcsl_resend_due(&t->resend, t->data.sequence, 0, now_ns())) {
            begin_configuration(t);
        }
        if (all) {
            (void)nanosleep(&nap, NULL);
        }
    }
}

/* ---- the library's interface ---------------------------------------------------------------------------------------- */

/* UNIX time of tick 0, were all ticks on time; 0 for ticks that do not keep to the clock. */
static int64_t wall_of(const fcsl_telemetry_options_t *options, uint64_t completed)
{
    struct timespec now;
    if (!options->realtime || clock_gettime(CLOCK_REALTIME, &now) != 0) {
        return 0;
    }
    return (int64_t)now.tv_sec * (int64_t)SECOND_NS + now.tv_nsec -
           (int64_t)fcsl_tick_time_ns(options->machine->tick_hz, completed);
}

static int draw_session(uint64_t *session)
{
    for (int i = 0; i < 8 && *session == 0; i++) {
        if (getrandom(session, sizeof *session, 0) != (ssize_t)sizeof *session) {
            return -1;
        }
    }
    return *session != 0 ? 0 : -1;
}

static int prepare(fcsl_telemetry_t *t, const fcsl_telemetry_options_t *options, const fcsl_vars_block_t *blocks,
                   uint32_t block_count, fcsl_error_t *error)
{
    uint64_t session = 0;
    fcsl_moment_t moment;
    t->publication = malloc(fcsl_history_bytes(t->history) + 1u);
    if (t->publication == NULL || fcsl_catalog_open(&t->catalog, blocks, block_count, t->history) != 0) {
        return fcsl_fail(error, "out of memory for telemetry");
    }
    if (draw_session(&session) != 0 || fcsl_history_latest(t->history, &moment, t->publication) != FCSL_HISTORY_OK) {
        return fcsl_fail(error, "telemetry needs a random number and a publication");
    }
    const announcement_t told = {
        .machine = options->machine, .every = t->link.every, .wall_ns = wall_of(options, moment.tick)};
    if (fcsl_channels_open(&t->channels, &t->catalog, options->fields, &told, error) != 0) {
        return -1;
    }
    t->body = malloc(t->channels.data_bytes);
    const uint32_t bytes = t->channels.configuration_bytes;
    t->configuration = (packet_t){.kind = PACKET_CONFIGURATION,
                                  .configuration = fcsl_crc32(0, t->channels.configuration, bytes),
                                  .session = session,
                                  .body = t->channels.configuration,
                                  .total = bytes};
    t->configuration_at = bytes;
    t->data = t->configuration;
    t->data.kind = PACKET_DATA;
    t->data.body = t->body;
    t->data.total = t->channels.data_bytes;
    t->cursor = fcsl_history_published(t->history) - 1u;
    return t->body != NULL ? 0 : fcsl_fail(error, "out of memory for telemetry");
}

static uint64_t nap_of(const fcsl_telemetry_t *t)
{
    const uint64_t nap = SECOND_NS / t->tick_hz * t->history->slots / 8u;
    return nap < NAP_MIN_NS ? NAP_MIN_NS : nap > NAP_MAX_NS ? NAP_MAX_NS : nap;
}

fcsl_telemetry_t *fcsl_telemetry_open(const fcsl_telemetry_options_t *options, const fcsl_vars_block_t *blocks,
                                      uint32_t block_count, const fcsl_history_t *history, fcsl_error_t *error)
{
    fcsl_telemetry_t *t = calloc(1, sizeof *t);
    if (t == NULL) {
        (void)fcsl_fail(error, "out of memory for telemetry");
        return NULL;
    }
    t->history = history;
    t->tick_hz = options->machine->tick_hz;
    t->nap_ns = nap_of(t);
    if (fcsl_link_open(&t->link, options->address, error) != 0 ||
        prepare(t, options, blocks, block_count, error) != 0) {
        fcsl_telemetry_close(t);
        return NULL;
    }
    return t;
}

int fcsl_telemetry_start(fcsl_telemetry_t *telemetry, fcsl_error_t *error)
{
    const int code = pthread_create(&telemetry->thread, NULL, send_all, telemetry);
    telemetry->started = code == 0;
    return code == 0 ? 0 : fcsl_fail(error, "cannot start the thread of telemetry: %s", strerror(code));
}

void fcsl_telemetry_stop(fcsl_telemetry_t *telemetry)
{
    if (telemetry != NULL && telemetry->started) {
        atomic_store(&telemetry->stop, 1);
        (void)pthread_join(telemetry->thread, NULL);
        telemetry->started = 0;
    }
}

void fcsl_telemetry_close(fcsl_telemetry_t *telemetry)
{
    if (telemetry == NULL) {
        return;
    }
    fcsl_telemetry_stop(telemetry);
    fcsl_link_close(&telemetry->link);
    fcsl_channels_close(&telemetry->channels);
    fcsl_catalog_free(&telemetry->catalog);
    free(telemetry->publication);
    free(telemetry->body);
    free(telemetry);
}

void fcsl_telemetry_count(const fcsl_telemetry_t *telemetry, fcsl_telemetry_counters_t *counters)
{
    *counters = (fcsl_telemetry_counters_t){
        .packets = atomic_load_explicit(&telemetry->packets, memory_order_relaxed),
        .configurations = atomic_load_explicit(&telemetry->configurations, memory_order_relaxed),
        .datagrams = atomic_load_explicit(&telemetry->link.datagrams, memory_order_relaxed),
        .failures = atomic_load_explicit(&telemetry->link.failures, memory_order_relaxed),
        .missed = atomic_load_explicit(&telemetry->missed, memory_order_relaxed)};
}

void fcsl_telemetry_stats(const fcsl_telemetry_t *telemetry, fcsl_vars_out_t *out)
{
    fcsl_telemetry_counters_t counters;
    fcsl_telemetry_count(telemetry, &counters);
    fcsl_vars_begin(out, "telemetry");
    fcsl_vars_number(out, "packets", counters.packets);
    fcsl_vars_number(out, "configurations", counters.configurations);
    fcsl_vars_number(out, "datagrams", counters.datagrams);
    fcsl_vars_number(out, "failures", counters.failures);
    fcsl_vars_number(out, "missed", counters.missed);
    fcsl_vars_end(out);
}
