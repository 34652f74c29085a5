/* SPDX-License-Identifier: Apache-2.0
 *
 * A thread that follows a host's history tick by tick, and hands each to a sink. It never meets the step thread. Ticks that are
 * overwritten before the sink has room for them are dropped whole and counted.
 */
#ifndef FCSL_OBSERVERS_FOLLOWER_H
#define FCSL_OBSERVERS_FOLLOWER_H

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
} followed_tick_t;

typedef struct {
    void *ctx;
    /* Whether a tick is wanted. */
    int (*wants)(void *ctx);
    /* Nothing of the ticks until now was wanted. */
    void (*pass_over)(void *ctx);
    /* Whether there is room for another tick. */
    int (*ready)(void *ctx);
    /* Every publication, before its tick is put; also one that a command made, which has no tick. May be null. */
    void (*see)(void *ctx, const fcsl_moment_t *moment, const uint8_t *publication);
    /* Returns 0, or -1: the tick is lost. */
    int (*put)(void *ctx, const followed_tick_t *tick);
} follower_sink_t;

typedef struct {
    const fcsl_history_t *history;
    follower_sink_t sink;
    uint64_t nap_ns;
    uint8_t *publication;
    uint64_t cursor;    /* publications looked at */
    uint64_t overtaken; /* of them, since the last one that was seen */
    uint64_t completed; /* ticks, in the last one that was seen */
    _Atomic uint64_t ticks;
    _Atomic uint64_t dropped;
    pthread_t thread;
    int started;
    atomic_int stop;
} follower_t;

/* Begins at the history's end. Returns 0, or -1 without memory. */
int follower_open(follower_t *follower, const fcsl_history_t *history, uint64_t tick_hz, const follower_sink_t *sink);
int follower_start(follower_t *follower, fcsl_error_t *error);
/* Hands on what the history still has, for a second at most, and ends the thread. The counters stay. */
void follower_stop(follower_t *follower);
/* Stops, too. */
void follower_close(follower_t *follower);

/* Ticks that the sink took, and those that were lost while it wanted them. */
uint64_t follower_ticks(const follower_t *follower);
uint64_t follower_dropped(const follower_t *follower);

#endif /* FCSL_OBSERVERS_FOLLOWER_H */
