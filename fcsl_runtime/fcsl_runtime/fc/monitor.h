/* SPDX-License-Identifier: Apache-2.0
 *
 * The monitor thread runs beside the step thread. It takes the signals that end the run, finds steps that take too long, and
 * logs faults, events and a recording that failed.
 */
#ifndef FC_MONITOR_H
#define FC_MONITOR_H

#include <pthread.h>
#include <signal.h>

#include "event_log.h"
#include "fault_log.h"
#include "watchdog.h"

typedef struct {
    loop_t *loop;
    watchdog_t watchdog;
    int exit_on_stdin_eof; /* the end of standard input ends the run, too */
    /* Called on this thread when the step thread does not end after a signal; it ends the process. */
    void (*abandon)(void *ctx, const char *what);
    void *ctx;

    fault_log_t faults;
    event_log_t events;
    sigset_t signals;
    atomic_int loop_over;
    pthread_t thread;
    int started;
} monitor_t;

/* Blocks SIGINT and SIGTERM in this thread and all that it starts: they wait for the monitor thread. */
void monitor_block_signals(monitor_t *monitor);
/* Lets them end the program until they are blocked again. */
void monitor_let_signals(const monitor_t *monitor);
/* 0, or -1. */
int monitor_start(monitor_t *monitor);
/* After the loop: ends the thread, if there is one. */
void monitor_end(monitor_t *monitor);

#endif /* FC_MONITOR_H */
