/* SPDX-License-Identifier: Apache-2.0
 *
 * The library's interface: everything is made here, before the thread starts.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_telemetry.h"

#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_codec.h"
#include "sender.h"
#include "fcsl/fcsl_tick_time.h"

static const uint64_t SECOND_NS = 1000000000u;

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
    if (draw_session(&session) != 0) {
        return fcsl_fail(error, "telemetry cannot draw its session: the system gives no random numbers");
    }
    if (fcsl_history_latest(t->history, &moment, t->publication) != FCSL_HISTORY_OK) {
        return fcsl_fail(error, "telemetry begins behind the first publication of its host");
    }
    const announcement_t announcement = {.machine = options->machine,
                                         .views = options->views != NULL ? options->views : options->machine->views,
                                         .every = t->udp.every,
                                         .wall_ns = wall_of(options, moment.tick)};
    if (fcsl_channels_open(&t->channels, &t->catalog, options->fields, &announcement, error) != 0) {
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
    t->poll_ns = fcsl_history_poll_ns(history, t->tick_hz);
    if (fcsl_udp_open(&t->udp, options->address, error) != 0 || prepare(t, options, blocks, block_count, error) != 0) {
        fcsl_telemetry_close(t);
        return NULL;
    }
    return t;
}

int fcsl_telemetry_start(fcsl_telemetry_t *telemetry, fcsl_error_t *error)
{
    const int code = pthread_create(&telemetry->thread, NULL, fcsl_telemetry_send, telemetry);
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
    fcsl_udp_close(&telemetry->udp);
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
        .datagrams = atomic_load_explicit(&telemetry->udp.datagrams, memory_order_relaxed),
        .failures = atomic_load_explicit(&telemetry->udp.failures, memory_order_relaxed),
        .overwritten = atomic_load_explicit(&telemetry->overwritten, memory_order_relaxed)};
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
    fcsl_vars_number(out, "overwritten", counters.overwritten);
    fcsl_vars_end(out);
}
