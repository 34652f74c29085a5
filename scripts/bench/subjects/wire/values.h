/* SPDX-License-Identifier: Apache-2.0
 *
 * The values of a tick, which follow from its number, so that a receiver can tell right ones from wrong ones; and random numbers.
 */
#ifndef BENCH_WIRE_VALUES_H
#define BENCH_WIRE_VALUES_H

#include "wire.h"

#include <string.h>

enum { FIRST_TICK = 1000 };

/* Marsaglia's xorshift; the state is never 0. */
static inline uint64_t next_random(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

/* From -1 to 1. */
static inline void fill(float *values, int count, uint64_t *state)
{
    for (int i = 0; i < count; i++) {
        values[i] = (float)((int64_t)next_random(state) >> 40) / 8388608.0f;
    }
}

static inline values_t values_of(uint64_t tick)
{
    uint64_t state = tick * UINT64_C(0x9e3779b97f4a7c15) + 1u;
    values_t values = {.tick = tick, .armed = 1};
    fill(values.accelerometer, 3, &state);
    fill(values.gyroscope, 3, &state);
    fill(values.attitude, 4, &state);
    fill(values.motors, 4, &state);
    return values;
}

/* Whether what a direction carries is the same. */
static inline int equal_values(direction_t direction, const values_t *a, const values_t *b)
{
    if (direction == ACTUATORS) {
        return a->tick == b->tick && a->armed == b->armed && memcmp(a->motors, b->motors, sizeof a->motors) == 0;
    }
    return a->tick == b->tick && memcmp(a->accelerometer, b->accelerometer, sizeof a->accelerometer) == 0 &&
           memcmp(a->gyroscope, b->gyroscope, sizeof a->gyroscope) == 0 &&
           memcmp(a->attitude, b->attitude, sizeof a->attitude) == 0;
}

#endif /* BENCH_WIRE_VALUES_H */
