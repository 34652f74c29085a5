/* SPDX-License-Identifier: Apache-2.0
 *
 * Wakes a thread that has nothing to do. Who brings something changes a shared variable, then calls event_signal; who waits calls
 * event_arm, looks at the variable, and sleeps only if it finds nothing. Both do so with sequentially consistent operations: one
 * of the two sees what the other one did. No system call is made while nobody sleeps.
 */
#ifndef FCSL_BUS_EVENT_H
#define FCSL_BUS_EVENT_H

#include <poll.h>
#include <stdatomic.h>
#include <stdint.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

typedef struct {
    int fd;
    atomic_int armed;
} event_t;

static inline int event_open(event_t *event)
{
    event->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    return event->fd >= 0 ? 0 : -1;
}

static inline void event_close(event_t *event)
{
    if (event->fd >= 0) {
        (void)close(event->fd);
    }
}

static inline void event_signal(event_t *event)
{
    const uint64_t one = 1;
    if (atomic_load(&event->armed) && atomic_exchange(&event->armed, 0)) {
        const ssize_t done = write(event->fd, &one, sizeof one);
        (void)done; /* fails only when the count is full, and then who waits wakes, too */
    }
}

static inline void event_arm(event_t *event)
{
    atomic_store(&event->armed, 1);
}

/* Sleeps until a signal of the event, for `left`, or until a signal of the system: then -1. */
static inline int event_sleep(event_t *event, const struct timespec *left)
{
    uint64_t count = 0;
    struct pollfd entry = {.fd = event->fd, .events = POLLIN};
    const int woken = ppoll(&entry, 1, left, NULL);
    if (woken > 0) {
        const ssize_t done = read(event->fd, &count, sizeof count);
        (void)done; /* nothing to read is as good */
    }
    return woken < 0 ? -1 : 0;
}

#endif /* FCSL_BUS_EVENT_H */
