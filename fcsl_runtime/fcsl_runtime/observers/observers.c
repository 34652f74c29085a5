/* SPDX-License-Identifier: Apache-2.0
 *
 * The library's interface, and what the thread that follows the history does with a tick.
 */
#include "fcsl/fcsl_observers.h"

#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "descriptor.h"
#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_tick_publisher.h"
#include "fcsl/fcsl_tick_time.h"
#include "history_reader.h"
#include "reproduction.h"

struct fcsl_observers {
    history_reader_t reader;
    fcsl_tick_publisher_t *publisher;
    reproduction_t reproduction;
    int unwritten; /* writes of the coming tick are lost */
    uint64_t tick_hz;
};

static int is_watched(void *ctx)
{
    const fcsl_observers_t *o = ctx;
    fcsl_write_queue_enable(o->reproduction.writes, fcsl_tick_publisher_writes_watched(o->publisher));
    return fcsl_tick_publisher_watched(o->publisher);
}

static void skip(void *ctx)
{
    fcsl_observers_t *o = ctx;
    fcsl_tick_publisher_begin(o->publisher);
    fcsl_write_queue_skip(o->reproduction.writes);
}

static int is_ready(void *ctx)
{
    return fcsl_tick_publisher_ready(((fcsl_observers_t *)ctx)->publisher);
}

static void see(void *ctx, const fcsl_moment_t *moment, const uint8_t *publication)
{
    fcsl_observers_t *o = ctx;
    o->unwritten = reproduction_put(&o->reproduction, o->publisher, moment, publication) != 0;
}

static int put(void *ctx, const published_tick_t *tick)
{
    const fcsl_observers_t *o = ctx;
    const uint64_t time_ns = fcsl_tick_time_ns(o->tick_hz, tick->number);
    return o->unwritten ? -1
                        : fcsl_tick_publisher_post(o->publisher, tick->publication, tick->number, time_ns,
                                                   tick->requires_arming);
}

static int listen_on(fcsl_observers_t *o, const fcsl_observers_options_t *options, fcsl_error_t *error)
{
    fcsl_error_t reason;
    const fcsl_machine_t *machine = fcsl_run_machine(options->run);
    char *descriptor = fcsl_observers_descriptor(machine, error);
    if (descriptor == NULL) {
        return -1;
    }
    const size_t write_bytes = reproduction_write_bytes(&o->reproduction);
    const fcsl_tick_publisher_options_t publisher = {
        .endpoint = options->endpoint,
        .name_space = options->name_space,
        .descriptor = descriptor,
        .write_bytes = write_bytes < FCSL_BUS_MESSAGE_MAX ? (uint32_t)write_bytes : FCSL_BUS_MESSAGE_MAX};
    const int failed = fcsl_tick_publisher_open(&publisher, machine, &o->publisher, &reason);
    free(descriptor);
    return failed ? fcsl_fail(error, "no observers: %s", reason.text) : 0;
}

fcsl_observers_t *fcsl_observers_open(const fcsl_observers_options_t *options, const fcsl_history_t *history,
                                      fcsl_error_t *error)
{
    fcsl_observers_t *o = calloc(1, sizeof *o);
    if (o == NULL) {
        (void)fcsl_fail(error, "out of memory for observers");
        return NULL;
    }
    const history_reader_sink_t sink = {
        .ctx = o, .wants = is_watched, .skip = skip, .ready = is_ready, .observe = see, .put = put};
    fcsl_write_queue_t *writes = fcsl_run_write_queue(options->run, error);
    o->tick_hz = fcsl_run_machine(options->run)->tick_hz;
    if (writes != NULL) {
        if (history_reader_open(&o->reader, history, o->tick_hz, &sink) != 0 ||
            reproduction_open(&o->reproduction, writes) != 0) {
            (void)fcsl_fail(error, "out of memory for observers");
        } else if (listen_on(o, options, error) == 0) {
            return o;
        }
    }
    fcsl_observers_close(o);
    return NULL;
}

int fcsl_observers_start(fcsl_observers_t *observers, fcsl_error_t *error)
{
    return history_reader_start(&observers->reader, error);
}

void fcsl_observers_stop(fcsl_observers_t *observers)
{
    if (observers != NULL && observers->reader.started) {
        history_reader_stop(&observers->reader);
        fcsl_write_queue_enable(observers->reproduction.writes, 0);
    }
}

void fcsl_observers_close(fcsl_observers_t *observers)
{
    if (observers == NULL) {
        return;
    }
    fcsl_observers_stop(observers);
    history_reader_close(&observers->reader);
    fcsl_tick_publisher_close(observers->publisher);
    reproduction_close(&observers->reproduction);
    free(observers);
}

void fcsl_observers_count(const fcsl_observers_t *observers, fcsl_observers_counters_t *counters)
{
    *counters = (fcsl_observers_counters_t){.ticks = history_reader_ticks(&observers->reader),
                                            .dropped = history_reader_dropped(&observers->reader)};
}

void fcsl_observers_stats(const fcsl_observers_t *observers, fcsl_vars_out_t *out)
{
    fcsl_observers_counters_t counters;
    fcsl_observers_count(observers, &counters);
    fcsl_vars_begin(out, "observers");
    fcsl_vars_number(out, "ticks", counters.ticks);
    fcsl_vars_number(out, "dropped", counters.dropped);
    fcsl_vars_end(out);
}
