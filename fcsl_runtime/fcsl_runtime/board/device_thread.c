/* SPDX-License-Identifier: Apache-2.0
 *
 * The thread of a device.
 */
#define _GNU_SOURCE
#include "device_thread.h"

#include <errno.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_monotonic.h"

enum { STACK_BYTES = 256 << 10, LINE_BYTES = 64 /* of a cache */ };

void *device_state_new(const fcsl_driver_t *driver)
{
    const size_t align = driver->state_align < LINE_BYTES ? LINE_BYTES : driver->state_align;
    const size_t size = (driver->state_size + align - 1u) / align * align;
    void *state = aligned_alloc(align, size);
    return state != NULL ? memset(state, 0, size) : NULL;
}

int device_thread_start(pthread_t *thread, int priority, void *(*run)(void *), void *ctx)
{
    const struct sched_param parameters = {.sched_priority = priority};
    pthread_attr_t attributes;
    sigset_t all;
    sigset_t before;
    int code = pthread_attr_init(&attributes);
    if (code != 0) {
        return code;
    }
    code = pthread_attr_setstacksize(&attributes, STACK_BYTES);
    if (code == 0 && priority > 0) {
        /* realtime_begin leaves no priority to other threads by itself. */
        code = pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        code = code == 0 ? pthread_attr_setschedpolicy(&attributes, SCHED_FIFO) : code;
        code = code == 0 ? pthread_attr_setschedparam(&attributes, &parameters) : code;
    }
    (void)sigfillset(&all);
    code = code == 0 ? pthread_sigmask(SIG_SETMASK, &all, &before) : code;
    if (code == 0) {
        code = pthread_create(thread, &attributes, run, ctx);
        (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    }
    (void)pthread_attr_destroy(&attributes);
    return code;
}

int device_thread_end(pthread_t thread, sem_t *finished, uint64_t until_ns)
{
    const struct timespec until = fcsl_timespec_of(until_ns);
    int waited = 0;
    do {
        waited = sem_clockwait(finished, CLOCK_MONOTONIC, &until);
    } while (waited != 0 && errno == EINTR);
    (void)(waited == 0 ? pthread_join(thread, NULL) : pthread_detach(thread));
    return waited;
}
