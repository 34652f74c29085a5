/* SPDX-License-Identifier: Apache-2.0
 *
 * Log-linear histograms: buckets, sums and quantiles.
 */
#include "fcsl/fcsl_histogram.h"

#include <stddef.h>

enum { SUB = 1 << FCSL_HISTOGRAM_BITS };

/* Values below SUB have a bucket each; of larger ones the highest bit says the power of two, the next BITS bits which of
 * its buckets. */
static uint32_t bucket_of(uint64_t value)
{
    if (value < SUB) {
        return (uint32_t)value;
    }
    const uint32_t shift = 63u - (uint32_t)__builtin_clzll(value) - FCSL_HISTOGRAM_BITS;
    return shift * SUB + (uint32_t)(value >> shift);
}

uint64_t fcsl_histogram_end(uint32_t bucket)
{
    if (bucket < SUB) {
        return bucket;
    }
    const uint32_t shift = bucket / SUB - 1u;
    return ((uint64_t)(bucket % SUB + SUB) << shift) + (((uint64_t)1 << shift) - 1u);
}

static uint64_t load(const _Atomic uint64_t *number)
{
    return atomic_load_explicit(number, memory_order_relaxed);
}

void fcsl_histogram_add(fcsl_histogram_t *histogram, uint64_t value)
{
    _Atomic uint64_t *count = &histogram->counts[bucket_of(value)];
    /* One writer: a load and a store, no locked instruction. */
    atomic_store_explicit(count, load(count) + 1u, memory_order_relaxed);
    if (value > load(&histogram->max)) {
        atomic_store_explicit(&histogram->max, value, memory_order_relaxed);
    }
}

/* How many values make up at least `thousandths` of `count`: rounded up, and never none. */
static uint64_t rank_of(uint64_t count, uint64_t thousandths)
{
    return count / 1000u * thousandths + (count % 1000u * thousandths + 999u) / 1000u;
}

void fcsl_histogram_summary(const fcsl_histogram_t *histogram, fcsl_summary_t *summary)
{
    uint64_t counts[FCSL_HISTOGRAM_BUCKETS];
    *summary = (fcsl_summary_t){0};
    for (uint32_t i = 0; i < FCSL_HISTOGRAM_BUCKETS; i++) {
        counts[i] = load(&histogram->counts[i]);
        summary->count += counts[i];
    }
    summary->max = load(&histogram->max);
    const struct {
        uint64_t thousandths;
        uint64_t *value;
    } wanted[] = {{500, &summary->p50}, {990, &summary->p99}, {999, &summary->p999}};
    uint64_t below = 0;
    size_t next = 0;
    for (uint32_t i = 0; i < FCSL_HISTOGRAM_BUCKETS && summary->count > 0; i++) {
        below += counts[i];
        while (next < 3 && below >= rank_of(summary->count, wanted[next].thousandths)) {
            const uint64_t end = fcsl_histogram_end(i);
            *wanted[next].value = end < summary->max ? end : summary->max;
            next++;
        }
    }
}
