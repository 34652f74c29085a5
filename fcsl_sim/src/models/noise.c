/* SPDX-License-Identifier: Apache-2.0
 *
 * Seeded random numbers, a stream per instance and use.
 */
#include "noise.h"

#include <math.h>

#include "fcsl/fcsl_math.h"

enum { ROUNDS = 10, STREAM_BITS = 8 };

void fcsl_philox(const uint32_t counter[4], const uint32_t key[2], uint32_t block[4])
{
    uint32_t c0 = counter[0];
    uint32_t c1 = counter[1];
    uint32_t c2 = counter[2];
    uint32_t c3 = counter[3];
    uint32_t k0 = key[0];
    uint32_t k1 = key[1];
    for (int round = 0; round < ROUNDS; round++) {
        const uint64_t a = (uint64_t)0xD2511F53u * c0;
        const uint64_t b = (uint64_t)0xCD9E8D57u * c2;
        c0 = (uint32_t)(b >> 32) ^ c1 ^ k0;
        c1 = (uint32_t)b;
        c2 = (uint32_t)(a >> 32) ^ c3 ^ k1;
        c3 = (uint32_t)a;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    block[0] = c0;
    block[1] = c1;
    block[2] = c2;
    block[3] = c3;
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
    *noise = (fcsl_noise_t){.seed = seed, .instance = hash_name(name)};
}

/* Two uniform numbers of the next block, in [0, 1). */
static void draw(fcsl_noise_t *noise, uint32_t stream, double uniform[2])
{
    const uint64_t number = noise->streams[stream].drawn++ << STREAM_BITS | stream;
    const uint32_t counter[4] = {(uint32_t)number, (uint32_t)(number >> 32), (uint32_t)noise->instance,
                                 (uint32_t)(noise->instance >> 32)};
    const uint32_t key[2] = {(uint32_t)noise->seed, (uint32_t)(noise->seed >> 32)};
    uint32_t block[4];
    fcsl_philox(counter, key, block);
    uniform[0] = (double)(((uint64_t)block[1] << 32 | block[0]) >> 11) * 0x1p-53;
    uniform[1] = (double)(((uint64_t)block[3] << 32 | block[2]) >> 11) * 0x1p-53;
}

double fcsl_noise_uniform(fcsl_noise_t *noise, uint32_t stream)
{
    double uniform[2];
    if (stream >= FCSL_NOISE_STREAMS) {
        return NAN;
    }
    draw(noise, stream, uniform);
    return uniform[0];
}

/* Box and Muller: two uniform numbers make two normal ones, without a rejection loop. */
double fcsl_noise_gaussian(fcsl_noise_t *noise, uint32_t stream)
{
    double uniform[2];
    if (stream >= FCSL_NOISE_STREAMS) {
        return NAN;
    }
    fcsl_noise_stream_t *at = &noise->streams[stream];
    if (at->has_spare) {
        at->has_spare = 0;
        return at->spare;
    }
    draw(noise, stream, uniform);
    const double radius = sqrt(-2.0 * cr_log(1.0 - uniform[0])); /* of (0, 1]: it is finite */
    const double angle = 0x1.921fb54442d18p+2 * uniform[1];
    at->spare = radius * cr_sin(angle);
    at->has_spare = 1;
    return radius * cr_cos(angle);
}
