/* SPDX-License-Identifier: Apache-2.0
 *
 * One round follows the history to its end, sends a part of the configuration if one is under way, and naps.
 */
#define _GNU_SOURCE
#include "sender.h"

#include <time.h>

#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_tick_time.h"

/* Datagrams of the configuration in one round: what a socket of the usual size holds while its reader is busy. */
enum { BURST = 32 };

static void count(_Atomic uint64_t *number, uint64_t more)
{
    atomic_fetch_add_explicit(number, more, memory_order_relaxed);
}

/* ---- the configuration ---------------------------------------------------------------------------------------------- */

static void continue_configuration(fcsl_telemetry_t *t, uint32_t most)
{
    t->configuration_at = fcsl_udp_send(&t->udp, &t->configuration, t->configuration_at, most);
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
    return completed / t->udp.every + (completed % t->udp.every != 0);
}

/* What was due between this publication and the one seen before it, if some were overtaken. Ticks that a restore jumped
 * over were never there: at most as many as publications were lost. */
static uint64_t overwritten_before(const fcsl_telemetry_t *t, uint64_t completed)
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
                              .overwritten = atomic_load_explicit(&t->overwritten, memory_order_relaxed)};
    if (fcsl_resend_due(&t->resend, t->data.sequence, 1, fcsl_monotonic_ns())) {
        begin_configuration(t);
    }
    fcsl_channels_pack(&t->channels, &head, t->publication, t->body);
    count(&t->packets, 1); /* before it goes out: who has received it finds it counted */
    (void)fcsl_udp_send(&t->udp, &t->data, 0, UINT32_MAX);
    t->data.sequence++;
}

/* A publication: that of a tick is sent if it is due; a command's, of the same tick once more, is not. */
static void see(fcsl_telemetry_t *t, uint64_t completed)
{
    if (completed == t->completed) {
        return;
    }
    count(&t->overwritten, overwritten_before(t, completed));
    t->overtaken = 0;
    t->completed = completed;
    if (completed > 0 && (completed - 1u) % t->udp.every == 0) {
        send_data(t, completed - 1u);
    }
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
        if (status == FCSL_HISTORY_OVERWRITTEN) {
            const uint64_t cursor = fcsl_history_catch_up(t->history, t->cursor);
            t->overtaken += cursor - t->cursor;
            t->cursor = cursor;
        } else {
            t->cursor++;
            see(t, moment.tick);
        }
    }
    return 0;
}

void *fcsl_telemetry_send(void *telemetry)
{
    fcsl_telemetry_t *t = telemetry;
    const struct timespec nap = {.tv_nsec = (long)t->poll_ns};
    t->resend = fcsl_resend_begin(fcsl_monotonic_ns());
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
        } else if (fcsl_resend_due(&t->resend, t->data.sequence, 0, fcsl_monotonic_ns())) {
            begin_configuration(t);
        }
        if (all) {
            (void)nanosleep(&nap, NULL);
        }
    }
}
