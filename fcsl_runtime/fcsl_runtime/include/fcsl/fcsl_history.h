/* SPDX-License-Identifier: Apache-2.0
 *
 * The memory of a host as the last ticks left it, for the threads that look on: variable server, telemetry, watchdog.
 *
 * One thread publishes and never waits, whatever the readers do: a publication costs it the copy of the memory and nothing
 * that depends on who reads. Any number of threads read; one that is too slow finds its publication overwritten.
 */
#ifndef FCSL_HISTORY_H
#define FCSL_HISTORY_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

/* What is known of a publication besides the memory. */
typedef struct {
    uint64_t tick;    /* ticks completed */
    uint64_t time_ns; /* on the host's monotonic clock */
    uint64_t paused;  /* 0 or 1 */
    uint64_t next_write; /* fcsl_run_next_write, of a host that queues its writes */
    uint64_t requires_arming; /* fcsl_run_requires_arming */
} fcsl_moment_t;

/* A piece of memory that is published: a machine struct, a model's variables. */
typedef struct {
    const void *data;
    uint32_t size;
} fcsl_part_t;

typedef struct {
    _Atomic uint64_t published;
    size_t slot_words;
    uint32_t slots;
    uint32_t part_count;
    fcsl_part_t *parts;
    _Atomic uint64_t *words;
} fcsl_history_t;

typedef enum {
    FCSL_HISTORY_OK,
    FCSL_HISTORY_COMING, /* not published yet */
    FCSL_HISTORY_OVERWRITTEN    /* overwritten */
} fcsl_history_status_t;

/* Allocates room for `slots` (a power of two, at least 2) publications of these parts, whose data stay where they are.
 * 0, or -1 without memory. */
int fcsl_history_open(fcsl_history_t *history, const fcsl_part_t *parts, uint32_t part_count, uint32_t slots);
void fcsl_history_free(fcsl_history_t *history);

/* Bytes of one publication: the parts one after another, each at a multiple of 8. */
size_t fcsl_history_bytes(const fcsl_history_t *history);
/* Where part number `part` begins in a publication. */
size_t fcsl_history_part(const fcsl_history_t *history, uint32_t part);

/* Copies the parts as they are now; from the one thread that owns them. */
void fcsl_history_publish(fcsl_history_t *history, const fcsl_moment_t *moment);

/* Publications so far; the newest has the number before. */
uint64_t fcsl_history_published(const fcsl_history_t *history);
/* Copies publication `number` (counted from 0) into `bytes` (fcsl_history_bytes of them). */
fcsl_history_status_t fcsl_history_read(const fcsl_history_t *history, uint64_t number, fcsl_moment_t *moment,
                                        uint8_t *bytes);
/* Where a reader goes on that found publication `number` overwritten: in the middle of what is there, so that it is not
 * overtaken again at once. Above `number`. */
uint64_t fcsl_history_catch_up(const fcsl_history_t *history, uint64_t number);
/* How long a reader may rest that follows ticks at this rate: an eighth of what the history holds, so that one that is kept
 * waiting is not overtaken at once; 0.05 ms to 2 ms. */
uint64_t fcsl_history_poll_ns(const fcsl_history_t *history, uint64_t tick_hz);
/* Copies the newest: FCSL_HISTORY_OK, or FCSL_HISTORY_COMING before the first. A reader that is overtaken again and again
 * gives up after a bounded number of tries with FCSL_HISTORY_OVERWRITTEN. */
fcsl_history_status_t fcsl_history_latest(const fcsl_history_t *history, fcsl_moment_t *moment, uint8_t *bytes);

#endif /* FCSL_HISTORY_H */
