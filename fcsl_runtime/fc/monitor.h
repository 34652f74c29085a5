/* SPDX-License-Identifier: Apache-2.0
 *
 * A thread beside the step thread: takes the signals that end the run, is the watchdog, and tells of faults and of a recording
 * that failed.
 */
#ifndef FC_ATTENDANT_H
#define FC_ATTENDANT_H

#include <pthread.h>
#include <signal.h>

#include "fault_log.h"
#include "watchdog.h"

typedef struct {
    loop_t *loop;
    watchdog_t watchdog;
    int leash; /* the end of standard input ends the run, too */
    /* Called on this thread when the step thread does not end after a signal; it ends the process. */
    void (*abandon)(void *ctx, const char *what);
    void *ctx;

    fault_log_t faults;
    sigset_t signals;
    atomic_int loop_over;
    pthread_t thread;
    int started;
} attendant_t;

/* Blocks SIGINT and SIGTERM in this thread and all that it starts: they wait for the attendant. */
void attendant_block_signals(attendant_t *attendant);
/* Lets them end the program until they are blocked again. */
void attendant_let_signals(const attendant_t *attendant);
/* 0, or -1. */
int attendant_start(attendant_t *attendant);
/* After the loop: ends the thread, if there is one. */
void attendant_end(attendant_t *attendant);

#endif /* FC_ATTENDANT_H */
