/* SPDX-License-Identifier: Apache-2.0
 *
 * What the files of a session share: bus.c (opening, closing, the thread that steps), bus_service.c (the thread that puts) and
 * bus_events.c (the threads of Zenoh).
 */
#ifndef FCSL_BUS_SESSION_H
#define FCSL_BUS_SESSION_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

#include "bus_event.h"
#include "bus_inbox.h"
#include "bus_ring.h"
#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_bus.h"
#include "zenoh_session.h"

/* As fcsl_bus_counters_t. Each has one writer at a time. */
typedef struct {
    _Atomic uint64_t posted;
    _Atomic uint64_t refused;
    _Atomic uint64_t put;
    _Atomic uint64_t put_failed;
    _Atomic uint64_t received;
    _Atomic uint64_t replaced;
    _Atomic uint64_t overflowed;
    _Atomic uint64_t wrong_size;
    _Atomic uint64_t misfits;
    _Atomic uint64_t deletions;
    _Atomic uint64_t strays;
    _Atomic uint64_t connects;
    _Atomic uint64_t disconnects;
} counters_t;

struct fcsl_bus {
    fcsl_zenoh_t *zenoh; /* of the service thread, once that runs; null: not connected yet */
    fcsl_bus_options_t options; /* of a session that connects later */
    pthread_t service;

    /* Out. */
    ring_t ring;
    event_t posted;
    uint32_t output_count;
    atomic_int *matched; /* of each output */

    /* In. Zenoh's threads put one after the other. */
    pthread_mutex_t putting;
    uint32_t input_count;
    inbox_t *inboxes;
    uint32_t watched_count;
    _Atomic uint32_t *token_counts; /* of each watched token */
    _Atomic uint32_t peers;

    /* News for who waits: how much there was, and how much they know of. */
    event_t news;
    _Atomic uint64_t news_count;
    uint64_t news_seen;

    counters_t counters;

    atomic_int stopping;
    pthread_mutex_t ending;
    pthread_cond_t ended; /* on CLOCK_MONOTONIC */
    int has_ended;
    atomic_int owners; /* the user, the service thread, and Zenoh's callbacks: the last one frees */
};

static inline void bus_count(_Atomic uint64_t *counter, uint64_t more)
{
    (void)atomic_fetch_add_explicit(counter, more, memory_order_relaxed);
}

/* Something that fcsl_bus_wait waits for happened. */
static inline void bus_notify(fcsl_bus_t *bus)
{
    (void)atomic_fetch_add(&bus->news_count, 1);
    event_signal(&bus->news);
}

/* Opens Zenoh's session and declares all that is in `options`. Returns 0, or -1 with `error` filled. */
int bus_connect(fcsl_bus_t *bus, const fcsl_bus_options_t *options, fcsl_error_t *error);

/* Gives up one of the owners. */
void bus_disown(fcsl_bus_t *bus);

/* What Zenoh calls. Its release gives up an owner. */
fcsl_zenoh_events_t bus_events(fcsl_bus_t *bus);

/* The service thread. It owns `bus`. */
void *bus_serve(void *bus);

#endif /* FCSL_BUS_SESSION_H */
