/* SPDX-License-Identifier: Apache-2.0
 *
 * The newest values from one thread to another; older ones are replaced. Neither waits for the other, whatever it does meanwhile.
 *
 * There are three slots. The writer owns one, the reader owns one, and the third lies in the middle. A put exchanges the writer's for
 * that in the middle and marks it as new; a take exchanges the reader's for it if it is new. So each slot has one owner at any time,
 * and its bytes need no atomic operations. Each exchange releases what its thread did with the slot that it gives, and acquires what
 * the other thread did with the slot that it gets. The look at the mark needs no order: a take that misses a put finds it next time.
 * Two threads that put at once, or two that take, break it.
 */
#ifndef FCSL_LATEST_H
#define FCSL_LATEST_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

enum { FCSL_LATEST_SLOTS = 3 };

typedef struct {
    uint8_t *slots;
    size_t slot_size;
    uint64_t numbers[FCSL_LATEST_SLOTS]; /* of the put that filled the slot */
    uint64_t puts;
    uint32_t back; /* the writer's slot */
    uint32_t front; /* the reader's slot */
    atomic_uint middle; /* the third slot, and whether it is new to the reader */
} fcsl_latest_t;

/* For values of `size` bytes, zero at first. 0, or -1: out of memory. */
int fcsl_latest_open(fcsl_latest_t *latest, size_t size);
void fcsl_latest_close(fcsl_latest_t *latest);

/* Writer: where the next values go, all of them; what lies there is old. */
void *fcsl_latest_back(const fcsl_latest_t *latest);
/* Writer: hands over what lies there. Puts are numbered from 1 on. Returns whether the reader had taken the one before: then it is to
 * be woken; else that one is lost. */
int fcsl_latest_put(fcsl_latest_t *latest);

/* Reader: takes the newest values and returns the number of their put; 0: there are none since the last ones. */
uint64_t fcsl_latest_take(fcsl_latest_t *latest);
/* Reader: the values that were taken last. */
const void *fcsl_latest_front(const fcsl_latest_t *latest);

#endif /* FCSL_LATEST_H */
