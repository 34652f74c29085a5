/* SPDX-License-Identifier: Apache-2.0
 *
 * The thread that puts ticks on the observers' bus, and what it works with.
 */
#ifndef FCSL_OBSERVERS_PUBLISHER_H
#define FCSL_OBSERVERS_PUBLISHER_H

#include <pthread.h>
#include <stdatomic.h>

#include "fcsl/fcsl_journal.h"
#include "fcsl/fcsl_mirror.h"
#include "fcsl/fcsl_observers.h"

struct fcsl_observers {
    const fcsl_history_t *history;
    fcsl_journal_t *journal;
    fcsl_mirror_t *mirror;
    uint64_t tick_hz;
    uint64_t nap_ns;
    uint8_t *publication;
    uint64_t cursor;    /* publications looked at */
    uint64_t overtaken; /* of them, since the last one that was seen */
    uint64_t completed; /* ticks, in the last one that was seen */
    uint8_t *message;       /* a write or a checkpoint, with its number */
    uint64_t answered_ns;   /* when the checkpoint was last replaced */
    _Atomic uint64_t ticks;
    _Atomic uint64_t dropped;
    pthread_t thread;
    int started;
    atomic_int stop;
};

/* The thread's function; `observers` is an fcsl_observers_t. Ends when it is told to stop. */
void *fcsl_observers_publish(void *observers);

#endif /* FCSL_OBSERVERS_PUBLISHER_H */
