/* SPDX-License-Identifier: Apache-2.0
 *
 * Seeded random numbers. Every instance has a separate stream, seeded from (seed, instance name), so adding or
 * reordering instances does not change the numbers of other instances. The bits are the same on every target: integer arithmetic,
 * IEEE + - * / sqrt, and the correctly rounded log, sin and cos of fcsl_math.
 */
#ifndef FCSL_SIM_NOISE_H
#define FCSL_SIM_NOISE_H

#include "fcsl/fcsl_model.h"

struct fcsl_noise {
    uint64_t word[4]; /* xoshiro256++ */
    double spare;     /* the second number of a Box-Muller pair */
    int has_spare;
};

void fcsl_noise_seed(fcsl_noise_t *noise, uint64_t seed, const char *name);
/* [0, 1), a multiple of 2^-53. */
double fcsl_noise_uniform(fcsl_noise_t *noise);
/* Mean 0, standard deviation 1; never beyond 8.6 in magnitude. */
double fcsl_noise_gaussian(fcsl_noise_t *noise);

#endif /* FCSL_SIM_NOISE_H */
