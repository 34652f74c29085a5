/* SPDX-License-Identifier: Apache-2.0
 *
 * The thread that hands to Zenoh what was posted. A put may wait for a receiver; then the ring fills, and posts are refused.
 */
#define _GNU_SOURCE
#include "bus_session.h"

#include "fcsl/fcsl_monotonic.h"

enum { POLL_NS = 50 * FCSL_NS_PER_MS, TURN = 64 };

/* Puts what is in the ring, at most TURN messages: 1 when there may be more. */
static int put_some(fcsl_bus_t *bus)
{
    uint32_t output = 0;
    const uint8_t *bytes = NULL;
    size_t size = 0;
    for (int i = 0; i < TURN; i++) {
        if (!ring_front(&bus->ring, &output, &bytes, &size)) {
            return 0;
        }
        const int failed = fcsl_zenoh_put(bus->zenoh, output, bytes, size) != 0;
        bus_count(failed ? &bus->counters.put_failed : &bus->counters.put, 1);
        ring_pop(&bus->ring);
    }
    return 1;
}

/* Zenoh does not tell of sessions that come and go: they are looked at. */
static void check_peers(fcsl_bus_t *bus, uint64_t *checked_ns)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (now_ns < *checked_ns + POLL_NS) {
        return;
    }
    const uint32_t before = atomic_load(&bus->peers);
    const uint32_t now = fcsl_zenoh_peers(bus->zenoh);
    *checked_ns = now_ns;
    if (now != before) {
        bus_count(now > before ? &bus->counters.connects : &bus->counters.disconnects,
                  now > before ? now - before : before - now);
        atomic_store(&bus->peers, now);
        bus_notify(bus);
    }
}

static void sleep_until_posted(fcsl_bus_t *bus)
{
    uint32_t output = 0;
    const uint8_t *bytes = NULL;
    size_t size = 0;
    event_arm(&bus->posted);
    if (!ring_front(&bus->ring, &output, &bytes, &size) && !atomic_load(&bus->stopping)) {
        const struct timespec poll = fcsl_timespec_of(POLL_NS);
        (void)event_sleep(&bus->posted, &poll);
    }
}

/* Tries until somebody listens. What was posted meanwhile is of the past. */
static void connect_later(fcsl_bus_t *bus)
{
    uint32_t output = 0;
    const uint8_t *bytes = NULL;
    size_t size = 0;
    fcsl_error_t reason;
    const struct timespec pause = fcsl_timespec_of(POLL_NS);
    while (bus->zenoh == NULL && !atomic_load(&bus->stopping)) { /* until the session is closed at the latest */
        if (bus_connect(bus, &bus->options, &reason) != 0) {
            (void)nanosleep(&pause, NULL);
        }
    }
    while (ring_front(&bus->ring, &output, &bytes, &size) && !atomic_load(&bus->stopping)) {
        bus_count(&bus->counters.put_failed, 1);
        ring_pop(&bus->ring);
    }
}

/* Puts, or sleeps, until the session is closed. */
static void serve(fcsl_bus_t *bus)
{
    uint64_t checked_ns = 0;
    for (;;) { /* each turn puts, or sleeps */
        const int stopping = atomic_load(&bus->stopping); /* nothing is posted any more */
        const int more = put_some(bus);
        if (stopping && !more) {
            break;
        }
        check_peers(bus, &checked_ns);
        if (!more) {
            sleep_until_posted(bus);
        }
    }
    fcsl_zenoh_close(bus->zenoh);
}

void *bus_serve(void *argument)
{
    fcsl_bus_t *bus = argument;
    if (bus->zenoh == NULL) {
        connect_later(bus);
    }
    if (bus->zenoh != NULL) {
        serve(bus);
    }
    (void)pthread_mutex_lock(&bus->ending);
    bus->has_ended = 1;
    (void)pthread_cond_signal(&bus->ended);
    (void)pthread_mutex_unlock(&bus->ending);
    bus_disown(bus);
    return NULL;
}
