/* SPDX-License-Identifier: Apache-2.0
 *
 * The library's interface: everything is made here, before the thread starts.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_observers.h"

#include <stdlib.h>
#include <string.h>

#include "base/error.h"
#include "descriptor.h"
#include "fcsl/fcsl_bus.h"
#include "publisher.h"
#include "reproduction.h"

static int listen_on(fcsl_observers_t *o, const fcsl_observers_options_t *options, fcsl_error_t *error)
{
    char reason[256];
    const fcsl_machine_t *machine = fcsl_run_machine(options->run);
    char *descriptor = fcsl_observers_descriptor(machine, error);
    if (descriptor == NULL) {
        return -1;
    }
    const size_t write_bytes = fcsl_observers_write_bytes(o->journal);
    const fcsl_mirror_options_t mirror = {.endpoint = options->endpoint,
                                          .name_space = options->name_space,
                                          .descriptor = descriptor,
                                          .write_bytes = write_bytes < FCSL_BUS_MESSAGE_MAX ? (uint32_t)write_bytes
                                                                                            : FCSL_BUS_MESSAGE_MAX};
    const int failed = fcsl_mirror_open(&mirror, machine, &o->mirror, reason, sizeof reason);
    free(descriptor);
    return failed ? fcsl_fail(error, "no observers: %s", reason) : 0;
}

fcsl_observers_t *fcsl_observers_open(const fcsl_observers_options_t *options, const fcsl_history_t *history,
                                      fcsl_error_t *error)
{
    fcsl_observers_t *o = calloc(1, sizeof *o);
    if (o == NULL) {
        (void)fcsl_fail(error, "out of memory for observers");
        return NULL;
    }
    o->history = history;
    o->journal = fcsl_run_journal(options->run, error);
    if (o->journal == NULL) {
        fcsl_observers_close(o);
        return NULL;
    }
    o->tick_hz = fcsl_run_machine(options->run)->tick_hz;
    o->nap_ns = fcsl_history_nap_ns(history, o->tick_hz);
    o->cursor = fcsl_history_published(history);
    o->publication = malloc(fcsl_history_bytes(history) + 1u);
    o->message = malloc(fcsl_observers_write_bytes(o->journal));
    if (o->publication == NULL || o->message == NULL) {
        (void)fcsl_fail(error, "out of memory for observers");
    } else if (listen_on(o, options, error) == 0) {
        return o;
    }
    fcsl_observers_close(o);
    return NULL;
}

int fcsl_observers_start(fcsl_observers_t *observers, fcsl_error_t *error)
{
    const int code = pthread_create(&observers->thread, NULL, fcsl_observers_publish, observers);
    observers->started = code == 0;
    return code == 0 ? 0 : fcsl_fail(error, "cannot start the thread of observers: %s", strerror(code));
}

void fcsl_observers_stop(fcsl_observers_t *observers)
{
    if (observers != NULL && observers->started) {
        atomic_store(&observers->stop, 1);
        (void)pthread_join(observers->thread, NULL);
        fcsl_journal_follow(observers->journal, 0);
        observers->started = 0;
    }
}

void fcsl_observers_close(fcsl_observers_t *observers)
{
    if (observers == NULL) {
        return;
    }
    fcsl_observers_stop(observers);
    fcsl_mirror_close(observers->mirror);
    free(observers->publication);
    free(observers->message);
    free(observers);
}

void fcsl_observers_count(const fcsl_observers_t *observers, fcsl_observers_counters_t *counters)
{
    *counters = (fcsl_observers_counters_t){.ticks = atomic_load_explicit(&observers->ticks, memory_order_relaxed),
                                            .dropped = atomic_load_explicit(&observers->dropped, memory_order_relaxed)};
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
