/* SPDX-License-Identifier: Apache-2.0
 *
 * The plants of machines/plants integrated by hand: the classical Runge-Kutta method at 1 kHz, with states in local arrays, and
 * the derivative inlined. Events are located to the nanosecond by bisection.
 */
#ifndef BENCH_PLANTS_BY_HAND_H
#define BENCH_PLANTS_BY_HAND_H

#include <stddef.h>
#include <stdint.h>

#include "ball.h"
#include "bodies.h"
#include "lander.h"
#include "quadrotor.h"
#include "satellite.h"

/* Goes on for so many steps of 1 ms; `plant` is a struct of its header, and `step` the number of the first one. */
typedef void by_hand_run_t(void *plant, uint64_t step, uint32_t steps);

typedef struct {
    const char *name;
    by_hand_run_t *run;
    by_hand_run_t *run_apart; /* with the derivative in a function of its own: what any library of models costs */
    size_t size;    /* of the struct */
    size_t states;  /* where they are in it */
    uint32_t count; /* of states */
} by_hand_plant_t;

extern const by_hand_plant_t by_hand_plants[];
extern const uint32_t by_hand_count;

#endif /* BENCH_PLANTS_BY_HAND_H */
