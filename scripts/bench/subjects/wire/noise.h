/* SPDX-License-Identifier: Apache-2.0 */
#ifndef BENCH_WIRE_NOISE_H
#define BENCH_WIRE_NOISE_H

#include "wire.h"

typedef struct {
    long delivered; /* messages whose values arrived */
    long wrong;     /* messages that were accepted with other values */
} noise_t;

/* Sends sensor messages one behind the other, each bit flipped with this probability: places from a fixed seed, the same in every
 * format's stream. */
noise_t under_noise(const format_t *format, long messages, double probability);

#endif /* BENCH_WIRE_NOISE_H */
