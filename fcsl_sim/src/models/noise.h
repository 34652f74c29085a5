/* SPDX-License-Identifier: Apache-2.0
 *
 * Seeded random numbers: Philox4x32-10 (J. K. Salmon et al., Parallel random numbers: as easy as 1, 2, 3, SC11), a counter that is
 * enciphered. The key is the seed; the counter holds the instance (a hash of its name), the stream and the number of the
 * block. So every instance has streams of its own, and adding or reordering instances changes none of them. The bits are
 * the same on every target: integer arithmetic, IEEE + - * / sqrt, and the correctly rounded log, sin and cos of fcsl_math.
 */
#ifndef FCSL_SIM_NOISE_H
#define FCSL_SIM_NOISE_H

#include "fcsl/fcsl_model.h"

typedef struct {
    uint64_t drawn; /* blocks */
    double spare;   /* the second number of a Box-Muller pair */
    uint64_t has_spare;
} fcsl_noise_stream_t;

struct fcsl_noise {
    uint64_t seed;
    uint64_t instance;
    fcsl_noise_stream_t streams[FCSL_NOISE_STREAMS];
};

void fcsl_noise_seed(fcsl_noise_t *noise, uint64_t seed, const char *name);
/* [0, 1), a multiple of 2^-53; NaN: no such stream. */
double fcsl_noise_uniform(fcsl_noise_t *noise, uint32_t stream);
/* Mean 0, standard deviation 1; never beyond 8.6 in magnitude. NaN: no such stream. */
double fcsl_noise_gaussian(fcsl_noise_t *noise, uint32_t stream);

/* The block of one counter. */
void fcsl_philox(const uint32_t counter[4], const uint32_t key[2], uint32_t block[4]);

#endif /* FCSL_SIM_NOISE_H */
