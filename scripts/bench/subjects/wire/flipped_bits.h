/* SPDX-License-Identifier: Apache-2.0 */
#ifndef BENCH_WIRE_FLIPPED_BITS_H
#define BENCH_WIRE_FLIPPED_BITS_H

#include "wire.h"

typedef struct {
    long delivered; /* messages whose values arrived */
    long wrong;     /* messages that were accepted with other values */
} flipped_t;

/* Sends sensor messages one behind the other, each bit flipped with this probability: places from a fixed seed, the same in every
 * format's stream. */
flipped_t under_flipped_bits(const format_t *format, long messages, double probability);

#endif /* BENCH_WIRE_FLIPPED_BITS_H */
