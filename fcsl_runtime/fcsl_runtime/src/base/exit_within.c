/* SPDX-License-Identifier: Apache-2.0
 *
 * A thread that ends the process, where Python's own threads cannot: a destructor may keep Python's lock.
 */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <stddef.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_exit_within.h"

typedef struct {
    struct timespec time;
    int status;
} end_t;

static void *end_later(void *context)
{
    const end_t *end = context;
    struct timespec left = end->time;
    while (nanosleep(&left, &left) != 0) { /* a signal came here; what is left gets less each time */
    }
    _exit(end->status);
}

int fcsl_exit_within(uint32_t ms, int status)
{
    static end_t end; /* outlives the caller */
    end = (end_t){.time = {.tv_sec = ms / 1000u, .tv_nsec = (long)(ms % 1000u) * 1000000L}, .status = status};
    pthread_t thread;
    if (pthread_create(&thread, NULL, end_later, &end) != 0) {
        return -1;
    }
    return pthread_detach(thread) == 0 ? 0 : -1;
}
