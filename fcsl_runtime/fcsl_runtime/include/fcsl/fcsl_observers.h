/* SPDX-License-Identifier: Apache-2.0
 *
 * Observers: the channels of a host's machine on a bus of their own (docs/reference/transports.md). Flight program and simulator serve them
 * through this file.
 *
 * A thread reads the host's history and never meets the step thread; all memory is taken by open. Ticks that are overwritten
 * before there is room for them on the bus are dropped whole and counted; nobody waits for an observer. Who asks for them gets
 * a checkpoint and the host's writes, too (fcsl_write_queue.h).
 */
#ifndef FCSL_OBSERVERS_H
#define FCSL_OBSERVERS_H

#include "fcsl/fcsl_vars.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_observers fcsl_observers_t;

typedef struct {
    const char *endpoint;          /* tcp:HOST:PORT, to listen on */
    const char *name_space; /* before the keys, "" for none */
    fcsl_run_t *run;        /* its machine's struct is part 0 of the history */
} fcsl_observers_options_t;

/* Listens; nothing is put before fcsl_observers_start. History and run must outlive it. Null with `error`. */
fcsl_observers_t *fcsl_observers_open(const fcsl_observers_options_t *options, const fcsl_history_t *history,
                                      fcsl_error_t *error);
int fcsl_observers_start(fcsl_observers_t *observers, fcsl_error_t *error);
/* Puts what the history still has, for a second at most, and ends the thread. The counters stay. Accepts null. */
void fcsl_observers_stop(fcsl_observers_t *observers);
/* Stops, too. Accepts null. */
void fcsl_observers_close(fcsl_observers_t *observers);

typedef struct {
    uint64_t ticks;   /* put while anybody observed */
    uint64_t dropped; /* not put, because there was no room in time */
} fcsl_observers_counters_t;

void fcsl_observers_count(const fcsl_observers_t *observers, fcsl_observers_counters_t *counters);
/* The same as member `observers` of the reply to `stats`. */
void fcsl_observers_stats(const fcsl_observers_t *observers, fcsl_vars_out_t *out);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_OBSERVERS_H */
