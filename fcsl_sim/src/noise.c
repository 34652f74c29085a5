/* SPDX-License-Identifier: Apache-2.0
 *
 * Seeded random numbers, one stream per instance.
 */
#include "noise.h"

#include <math.h>

#include "fcsl/fcsl_math.h"

/* Spreads a counter over all bits; it seeds the main generator, as its authors recommend. */
static uint64_t next_splitmix64(uint64_t *state)
{
    uint64_t z = (*state += UINT64_C(0x9e3779b97f4a7c15));
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* FNV-1a, 64 bits. */
static uint64_t hash_name(const char *name)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    for (const char *c = name; *c; c++) {
        hash = (hash ^ (uint8_t)*c) * UINT64_C(0x100000001b3);
    }
    return hash;
}

void fcsl_noise_seed(fcsl_noise_t *noise, uint64_t seed, const char *name)
{
    uint64_t state = seed;
    state = next_splitmix64(&state) ^ hash_name(name);
    for (int i = 0; i < 4; i++) {
        noise->word[i] = next_splitmix64(&state);
    }
    noise->spare = 0.0;
    noise->has_spare = 0;
}

static uint64_t rotate_left(uint64_t x, int bits)
{
    return (x << bits) | (x >> (64 - bits));
}

/* xoshiro256++ (Blackman, Vigna). */
static uint64_t next_xoshiro(uint64_t word[4])
{
    const uint64_t result = rotate_left(word[0] + word[3], 23) + word[0];
    const uint64_t shifted = word[1] << 17;
    word[2] ^= word[0];
    word[3] ^= word[1];
    word[1] ^= word[2];
    word[0] ^= word[3];
    word[2] ^= shifted;
    word[3] = rotate_left(word[3], 45);
    return result;
}

double fcsl_noise_uniform(fcsl_noise_t *noise)
{
    return (double)(next_xoshiro(noise->word) >> 11) * 0x1p-53;
}

/* Box and Muller: two uniform numbers make two normal ones, without a rejection loop. */
double fcsl_noise_gaussian(fcsl_noise_t *noise)
{
    if (noise->has_spare) {
        noise->has_spare = 0;
        return noise->spare;
    }
    const double u = 1.0 - fcsl_noise_uniform(noise); /* (0, 1]: its logarithm is finite */
    const double angle = 0x1.921fb54442d18p+2 * fcsl_noise_uniform(noise);
    const double radius = sqrt(-2.0 * cr_log(u));
    noise->spare = radius * cr_sin(angle);
    noise->has_spare = 1;
    return radius * cr_cos(angle);
}
