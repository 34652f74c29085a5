/* SPDX-License-Identifier: Apache-2.0
 *
 * A histogram of durations, log-linear: 32 equal buckets from one power of two to the next, so that a bucket is at most
 * 1/32 of its values wide (3.2 %), from 0 to the largest 64-bit number. One thread adds and never waits, any thread reads.
 */
#ifndef FCSL_HISTOGRAM_H
#define FCSL_HISTOGRAM_H

#include <stdatomic.h>
#include <stdint.h>

enum {
    FCSL_HISTOGRAM_BITS = 5, /* 2^5 buckets from one power of two to the next */
    FCSL_HISTOGRAM_BUCKETS = (64 - FCSL_HISTOGRAM_BITS + 1) << FCSL_HISTOGRAM_BITS
};

/* All zero is an empty one. */
typedef struct {
    _Atomic uint64_t counts[FCSL_HISTOGRAM_BUCKETS];
    _Atomic uint64_t max; /* exact */
} fcsl_histogram_t;

/* Quantile q is the smallest value that at least q of all values do not exceed, rounded up to the end of its bucket:
 * at most 1/32 above the exact one, and never above `max`. All are 0 where nothing was added. */
typedef struct {
    uint64_t count;
    uint64_t p50;
    uint64_t p99;
    uint64_t p999;
    uint64_t max;
} fcsl_summary_t;

/* From the one thread that writes. */
void fcsl_histogram_add(fcsl_histogram_t *histogram, uint64_t value);

/* What was added so far; values added meanwhile may or may not be in it. */
void fcsl_histogram_summary(const fcsl_histogram_t *histogram, fcsl_summary_t *summary);

/* The largest value of a bucket. */
uint64_t fcsl_histogram_end(uint32_t bucket);

#endif /* FCSL_HISTOGRAM_H */
