/* SPDX-License-Identifier: Apache-2.0
 *
 * A session on the bus: opening, closing, and what the thread that steps calls.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_error.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_monotonic.h"
#include "bus_config.h"
#include "bus_session.h"

/* ---- the thread that steps ------------------------------------------------------------------------------------------ */

int fcsl_bus_post(fcsl_bus_t *bus, uint32_t output, const void *bytes, size_t size)
{
    if (output >= bus->output_count || ring_push(&bus->ring, output, bytes, size) != 0) {
        bus_count(&bus->counters.refused, 1);
        return -1;
    }
    bus_count(&bus->counters.posted, 1);
    event_signal(&bus->posted);
    return 0;
}

int fcsl_bus_take(fcsl_bus_t *bus, uint32_t input, void *bytes, size_t *size)
{
    return input < bus->input_count && inbox_take(&bus->inboxes[input], bytes, size);
}

int fcsl_bus_wait(fcsl_bus_t *bus, uint64_t deadline_ns)
{
    for (;;) { /* ends with news or at the deadline */
        event_arm(&bus->news);
        const uint64_t count = atomic_load(&bus->news_count);
        if (count != bus->news_seen) {
            bus->news_seen = count;
            return 1;
        }
        const struct timespec left = fcsl_time_left(deadline_ns);
        if (fcsl_monotonic_ns() >= deadline_ns || event_sleep(&bus->news, &left) != 0) {
            return 0;
        }
    }
}

int fcsl_bus_matched(const fcsl_bus_t *bus, uint32_t output)
{
    return output < bus->output_count && atomic_load(&bus->matched[output]);
}

uint32_t fcsl_bus_token_count(const fcsl_bus_t *bus, uint32_t watched)
{
    return watched < bus->watched_count ? atomic_load(&bus->token_counts[watched]) : 0u;
}

uint32_t fcsl_bus_peers(const fcsl_bus_t *bus)
{
    return atomic_load(&bus->peers);
}

static uint64_t read_counter(const _Atomic uint64_t *counter)
{
    return atomic_load_explicit(counter, memory_order_relaxed);
}

void fcsl_bus_count(const fcsl_bus_t *bus, fcsl_bus_counters_t *counters)
{
    const counters_t *now = &bus->counters;
    *counters = (fcsl_bus_counters_t){
        .posted = read_counter(&now->posted),
        .refused = read_counter(&now->refused),
        .put = read_counter(&now->put),
        .put_failed = read_counter(&now->put_failed),
        .received = read_counter(&now->received),
        .replaced = read_counter(&now->replaced),
        .overflowed = read_counter(&now->overflowed),
        .wrong_size = read_counter(&now->wrong_size),
        .misfits = read_counter(&now->misfits),
        .deletions = read_counter(&now->deletions),
        .strays = read_counter(&now->strays),
        .connects = read_counter(&now->connects),
        .disconnects = read_counter(&now->disconnects),
    };
}

int fcsl_bus_answer(fcsl_bus_t *bus, uint32_t answer, const void *bytes, size_t size)
{
    return size <= FCSL_BUS_MESSAGE_MAX ? fcsl_zenoh_answer(bus->zenoh, answer, bytes, size) : -1;
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

void bus_disown(fcsl_bus_t *bus)
{
    if (atomic_fetch_sub(&bus->owners, 1) > 1) {
        return;
    }
    for (uint32_t i = 0; i < bus->input_count; i++) {
        inbox_close(&bus->inboxes[i]);
    }
    ring_close(&bus->ring);
    event_close(&bus->posted);
    event_close(&bus->news);
    (void)pthread_mutex_destroy(&bus->putting);
    (void)pthread_mutex_destroy(&bus->ending);
    (void)pthread_cond_destroy(&bus->ended);
    free(bus->matched);
    free(bus->inboxes);
    free((void *)bus->token_counts);
    free(bus);
}

/* At least one element: calloc(0) may return null. */
static void *array(uint32_t count, size_t bytes)
{
    return calloc(count + 1u, bytes);
}

static int allocate(fcsl_bus_t *bus, const fcsl_bus_options_t *options)
{
    bus->output_count = options->output_count + options->service_count;
    bus->matched = array(bus->output_count, sizeof bus->matched[0]);
    bus->inboxes = array(options->input_count, sizeof bus->inboxes[0]);
    bus->token_counts = array(options->watched_count, sizeof bus->token_counts[0]);
    if (bus->matched == NULL || bus->inboxes == NULL || bus->token_counts == NULL ||
        ring_open(&bus->ring, options->ring_bytes) != 0) {
        return -1;
    }
    bus->watched_count = options->watched_count;
    for (uint32_t i = 0; i < options->input_count; i++) {
        const fcsl_bus_input_t *input = &options->inputs[i];
        bus->input_count = i + 1u; /* as many are closed */
        if (inbox_open(&bus->inboxes[i], input->bytes, input->least, input->depth) != 0) {
            return -1;
        }
        bus->inboxes[i].quiet = input->quiet;
        bus->inboxes[i].fits = input->fits;
        bus->inboxes[i].what = input->what;
    }
    return 0;
}

static int make_locks(fcsl_bus_t *bus)
{
    pthread_condattr_t attributes;
    if (pthread_mutex_init(&bus->putting, NULL) != 0 || pthread_mutex_init(&bus->ending, NULL) != 0 ||
        pthread_condattr_init(&attributes) != 0) {
        return -1;
    }
    const int code = pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC) != 0 ||
                     pthread_cond_init(&bus->ended, &attributes) != 0;
    (void)pthread_condattr_destroy(&attributes);
    return code ? -1 : 0;
}

/* Everything but the session of Zenoh; null without memory. */
static fcsl_bus_t *create(const fcsl_bus_options_t *options)
{
    fcsl_bus_t *bus = calloc(1, sizeof *bus);
    if (bus == NULL) {
        return NULL;
    }
    bus->posted.fd = -1;
    bus->news.fd = -1;
    bus->owners = 1;
    if (make_locks(bus) != 0 || event_open(&bus->posted) != 0 || event_open(&bus->news) != 0 ||
        allocate(bus, options) != 0) {
        bus_disown(bus);
        return NULL;
    }
    return bus;
}

static int declare(fcsl_bus_t *bus, const fcsl_bus_options_t *options, fcsl_error_t *error)
{
    fcsl_zenoh_t *zenoh = bus->zenoh;
    int failed = 0;
    const uint32_t subscribed = options->input_count - options->service_count;
    for (uint32_t i = 0; i < subscribed && !failed; i++) {
        failed = fcsl_zenoh_declare_input(zenoh, i, options->inputs[i].key, error->text, sizeof error->text);
    }
    if (options->strays != NULL && !failed) {
        failed = fcsl_zenoh_declare_strays(zenoh, options->strays, error->text, sizeof error->text);
    }
    for (uint32_t i = 0; i < options->output_count && !failed; i++) {
        failed = fcsl_zenoh_declare_output(zenoh, i, options->outputs[i], options->observer, i < options->latched_count,
                                           options->attaches, error->text, sizeof error->text);
    }
    for (uint32_t i = subscribed; i < options->input_count && !failed; i++) {
        const fcsl_bus_input_t *input = &options->inputs[i];
        failed = fcsl_zenoh_declare_service(zenoh, i, input->key, input->bytes, options->busy, options->busy_bytes,
                                            error->text, sizeof error->text);
    }
    for (uint32_t i = 0; i < options->answer_count && !failed; i++) {
        const fcsl_bus_answer_t *answer = &options->answers[i];
        failed =
            fcsl_zenoh_declare_answer(zenoh, answer->key, answer->bytes, answer->size, error->text, sizeof error->text);
    }
    for (uint32_t i = 0; i < options->watched_count && !failed; i++) {
        failed = fcsl_zenoh_watch_token(zenoh, i, options->watched[i], error->text, sizeof error->text);
    }
    /* Last: who sees a token finds everything else. */
    for (uint32_t i = 0; i < options->token_count && !failed; i++) {
        failed = fcsl_zenoh_declare_token(zenoh, options->tokens[i], error->text, sizeof error->text);
    }
    return failed;
}

int bus_connect(fcsl_bus_t *bus, const fcsl_bus_options_t *options, fcsl_error_t *error)
{
    char config[BUS_CONFIG_BYTES] = "";
    fcsl_error_t reason = {""};
    const fcsl_zenoh_events_t events = bus_events(bus);
    const int listens = options->role == FCSL_BUS_LISTEN;
    if (options->endpoint != NULL && bus_config_write(options, config, error) != 0) {
        return -1;
    }
    (void)atomic_fetch_add(&bus->owners, 1); /* the callbacks, until their release */
    if (fcsl_zenoh_open(options->config_path, config, &events, &bus->zenoh, reason.text, sizeof reason.text) != 0) {
        return fcsl_fail(error, "cannot %s %s: %s",
                         options->config_path != NULL ? "open a session of the bus with"
                         : listens                    ? "listen on"
                                                      : "connect to",
                         options->config_path != NULL ? options->config_path : options->endpoint, reason.text);
    }
    if (declare(bus, options, &reason) != 0) {
        (void)fcsl_fail(error, "the bus refuses a key: %s", reason.text);
        fcsl_zenoh_close(bus->zenoh);
        bus->zenoh = NULL;
        return -1;
    }
    return 0;
}

static int start(fcsl_bus_t *bus)
{
    (void)atomic_fetch_add(&bus->owners, 1);
    if (pthread_create(&bus->service, NULL, bus_serve, bus) != 0) {
        if (bus->zenoh != NULL) {
            fcsl_zenoh_close(bus->zenoh);
        }
        bus_disown(bus);
        return -1;
    }
    return 0;
}

int fcsl_bus_open(const fcsl_bus_options_t *options, fcsl_bus_t **bus, fcsl_error_t *error)
{
    sigset_t all;
    sigset_t before;
    if (bus_config_check(options, error) != 0) {
        return -1;
    }
    fcsl_bus_t *self = create(options);
    if (self == NULL) {
        return fcsl_fail(error, "out of memory for the bus");
    }
    self->options = *options;
    /* Signals belong to the program's own threads; Zenoh's begin here. */
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int later = options->connects_later && options->role != FCSL_BUS_LISTEN;
    int failed = later ? 0 : bus_connect(self, options, error);
    if (!failed && start(self) != 0) {
        (void)fcsl_fail(error, "cannot start the thread of the bus");
        failed = -1;
    }
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (failed) {
        bus_disown(self);
        return -1;
    }
    *bus = self;
    return 0;
}

int fcsl_bus_close(fcsl_bus_t *bus, uint32_t timeout_ms)
{
    const uint64_t deadline_ns = fcsl_monotonic_ns() + (uint64_t)timeout_ms * FCSL_NS_PER_MS;
    const struct timespec deadline = fcsl_timespec_of(deadline_ns);
    int code = 0;
    atomic_store(&bus->stopping, 1);
    event_signal(&bus->posted);
    (void)pthread_mutex_lock(&bus->ending);
    while (!bus->has_ended && code == 0) {
        code = pthread_cond_timedwait(&bus->ended, &bus->ending, &deadline);
    }
    const int ended = bus->has_ended;
    (void)pthread_mutex_unlock(&bus->ending);
    if (ended) {
        (void)pthread_join(bus->service, NULL);
    } else {
        (void)pthread_detach(bus->service);
    }
    bus_disown(bus);
    return ended ? 0 : -1;
}
