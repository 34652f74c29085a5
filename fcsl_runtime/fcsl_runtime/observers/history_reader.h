/* SPDX-License-Identifier: Apache-2.0
 *
 * A thread that reads a host's history tick by tick, and hands each to a sink. It never meets the step thread. Ticks that are
 * overwritten before the sink has room for them are dropped whole and counted.
 */
#ifndef FCSL_OBSERVERS_HISTORY_READER_H
#define FCSL_OBSERVERS_HISTORY_READER_H

#include <pthread.h>
#include <stdatomic.h>

#include "fcsl/fcsl_history.h"
#include "fcsl/fcsl_run.h"

/* A completed tick. */
typedef struct {
    const uint8_t *publication; /* of the history */
    uint64_t number;
    uint64_t begun_ns; /* on the host's clock, as the host published it */
    int requires_arming;
} published_tick_t;

typedef struct {
    void *ctx;
    /* Whether a tick is wanted. */
    int (*wants)(void *ctx);
    /* Nothing of the ticks until now was wanted. */
    void (*skip)(void *ctx);
    /* Whether there is room for another tick. */
    int (*ready)(void *ctx);
    /* Every publication, before its tick is put; also one that a command made, which has no tick. May be null. */
    void (*observe)(void *ctx, const fcsl_moment_t *moment, const uint8_t *publication);
    /* Returns 0, or -1: the tick is lost. */
    int (*put)(void *ctx, const published_tick_t *tick);
} history_reader_sink_t;

typedef struct {
    const fcsl_history_t *history;
    history_reader_sink_t sink;
    uint64_t poll_ns;
    uint8_t *publication;
    uint64_t cursor;    /* publications read */
    uint64_t overtaken; /* of them, since the last one that was seen */
    uint64_t completed; /* ticks, in the last one that was seen */
    _Atomic uint64_t ticks;
    _Atomic uint64_t dropped;
    pthread_t thread;
    int started;
    atomic_int stop;
} history_reader_t;

/* Begins at the history's end. Returns 0, or -1 without memory. */
int history_reader_open(history_reader_t *reader, const fcsl_history_t *history, uint64_t tick_hz,
                        const history_reader_sink_t *sink);
int history_reader_start(history_reader_t *reader, fcsl_error_t *error);
/* Hands on what the history still has, for a second at most, and ends the thread. The counters stay. */
void history_reader_stop(history_reader_t *reader);
/* Stops, too. */
void history_reader_close(history_reader_t *reader);

/* Ticks that the sink took, and those that were lost while it wanted them. */
uint64_t history_reader_ticks(const history_reader_t *reader);
uint64_t history_reader_dropped(const history_reader_t *reader);

#endif /* FCSL_OBSERVERS_HISTORY_READER_H */
