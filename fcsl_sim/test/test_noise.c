/* SPDX-License-Identifier: Apache-2.0
 *
 * Noise: known bits, the distribution's moments and tails, independence of the streams of different instances.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "check.h"
#include "models/noise.h"

enum { SAMPLES = 1000000 };

/* The known answers that the authors publish with Random123 (kat_vectors, philox4x32 10). */
static void generator_is_philox(void)
{
    static const uint32_t published[][10] = {
        {0, 0, 0, 0, 0, 0, 0x6627e8d5u, 0xe169c58du, 0xbc57ac4cu, 0x9b00dbd8u},
        {0xffffffffu, 0xffffffffu, 0xffffffffu, 0xffffffffu, 0xffffffffu, 0xffffffffu, 0x408f276du, 0x41c83b0eu,
         0xa20bc7c6u, 0x6d5451fdu},
        {0x243f6a88u, 0x85a308d3u, 0x13198a2eu, 0x03707344u, 0xa4093822u, 0x299f31d0u, 0xd16cfe09u, 0x94fdccebu,
         0x5001e420u, 0x24126ea1u},
    };
    for (size_t i = 0; i < sizeof published / sizeof *published; i++) {
        uint32_t block[4];
        fcsl_philox(published[i], published[i] + 4, block);
        CHECK(memcmp(block, published[i] + 6, sizeof block) == 0);
    }
}

/* Computed from the definitions with mpmath (correctly rounded log, sin, cos) and CPython's doubles. */
static void gaussian_keeps_its_bits(void)
{
    static const struct {
        uint64_t seed;
        const char *name;
        uint32_t stream;
        double values[6];
    } golden[] = {
        {0,
         "altimeter",
         0u,
         {-0x1.a669848501af4p-2, -0x1.c46e3f7c9a3b9p-4, 0x1.39728d5843ce3p-2, 0x1.57c8324ea5d3cp+0,
          0x1.037ac76e060fep+0, 0x1.89a04372a3005p-2}},
        {1,
         "altimeter",
         0u,
         {-0x1.804ff6bb40223p-4, 0x1.16413545a8a6cp-2, -0x1.26ee7df0be88ap-1, -0x1.2b80447ef7c57p+0,
          0x1.309b91f726749p+0, 0x1.50d2c2f8cf68cp-1}},
        {1,
         "altimeter",
         15u,
         {-0x1.fa8a3cec912a3p+0, 0x1.1482d04485333p-4, -0x1.34483b6deda36p-3, -0x1.dde6b4d1a2663p-3,
          0x1.95474e398c6f1p-4, -0x1.30c858178fd8ap+0}},
        {1,
         "velocimeter",
         3u,
         {-0x1.d2ae73e90e03dp-1, 0x1.09bafd16b1e10p+0, -0x1.c22b92ab19f1ep-2, -0x1.8cccc6a12c345p+0,
          0x1.6380d91ac51e0p-1, -0x1.59005ec9c8428p+0}},
        {UINT64_MAX,
         "a",
         1u,
         {-0x1.63d7ca06aa806p-1, 0x1.ae8f186306f5ep-1, 0x1.528f77b631c4fp+0, 0x1.91cb3e8a5df3fp-2,
          -0x1.5f6f294c1f466p-3, -0x1.2a81224921916p+0}},
    };
    for (size_t i = 0; i < sizeof golden / sizeof *golden; i++) {
        fcsl_noise_t noise;
        fcsl_noise_seed(&noise, golden[i].seed, golden[i].name);
        for (int j = 0; j < 6; j++) {
            const double value = fcsl_noise_gaussian(&noise, golden[i].stream);
            CHECK(memcmp(&value, &golden[i].values[j], sizeof value) == 0);
            (void)fcsl_noise_gaussian(&noise, 7); /* another stream changes nothing */
        }
    }
}

/* Moments within 5 standard errors; the share beyond 1, 2 and 3 sigma likewise. */
static void gaussian_is_normal(void)
{
    fcsl_noise_t noise;
    fcsl_noise_seed(&noise, 42, "statistics");
    double sum[5] = {0};
    double beyond[4] = {0};
    for (int i = 0; i < SAMPLES; i++) {
        const double z = fcsl_noise_gaussian(&noise, 0);
        double power = z;
        for (int k = 1; k <= 4; k++, power *= z) {
            sum[k] += power;
        }
        for (int k = 1; k <= 3; k++) {
            beyond[k] += fabs(z) > k;
        }
        CHECK(fabs(z) < 8.6);
    }
    const double n = SAMPLES;
    CHECK(fabs(sum[1] / n) < 5.0 * sqrt(1.0 / n));
    CHECK(fabs(sum[2] / n - 1.0) < 5.0 * sqrt(2.0 / n));
    CHECK(fabs(sum[3] / n) < 5.0 * sqrt(15.0 / n));
    CHECK(fabs(sum[4] / n - 3.0) < 5.0 * sqrt(96.0 / n));
    for (int k = 1; k <= 3; k++) {
        const double share = erfc(k / sqrt(2.0));
        CHECK(fabs(beyond[k] / n - share) < 5.0 * sqrt(share * (1.0 - share) / n));
    }
}

static void uniform_is_flat(void)
{
    fcsl_noise_t noise;
    fcsl_noise_seed(&noise, 7, "uniform");
    double bins[16] = {0};
    for (int i = 0; i < SAMPLES; i++) {
        const double u = fcsl_noise_uniform(&noise, 0);
        CHECK(u >= 0.0 && u < 1.0);
        bins[(int)(16.0 * u)] += 1.0;
    }
    double chi_squared = 0.0;
    for (int i = 0; i < 16; i++) {
        const double excess = bins[i] - SAMPLES / 16.0;
        chi_squared += excess * excess / (SAMPLES / 16.0);
    }
    CHECK(chi_squared < 45.0); /* 15 degrees of freedom: exceeded once in 10 000 seeds */
}

typedef struct {
    uint64_t seed;
    const char *name;
    uint32_t stream;
} stream_t;

static double correlation(stream_t first, stream_t second)
{
    fcsl_noise_t a;
    fcsl_noise_t b;
    fcsl_noise_seed(&a, first.seed, first.name);
    fcsl_noise_seed(&b, second.seed, second.name);
    double sum = 0.0;
    for (int i = 0; i < SAMPLES / 10; i++) {
        sum += fcsl_noise_gaussian(&a, first.stream) * fcsl_noise_gaussian(&b, second.stream);
    }
    return sum / (SAMPLES / 10.0);
}

/* Neighbouring seeds and streams and similar names give unrelated numbers; the same ones give the same. */
static void streams_are_independent(void)
{
    const double limit = 5.0 / sqrt(SAMPLES / 10.0);
    CHECK(fabs(correlation((stream_t){1, "a", 0}, (stream_t){1, "b", 0})) < limit);
    CHECK(fabs(correlation((stream_t){1, "imu1", 0}, (stream_t){1, "imu2", 0})) < limit);
    CHECK(fabs(correlation((stream_t){1, "a", 0}, (stream_t){2, "a", 0})) < limit);
    CHECK(fabs(correlation((stream_t){0, "", 0}, (stream_t){1, "", 0})) < limit);
    CHECK(fabs(correlation((stream_t){1, "a", 0}, (stream_t){1, "a", 1})) < limit);
    CHECK(fabs(correlation((stream_t){1, "a", 3}, (stream_t){1, "a", 3}) - 1.0) < 0.05);
}

/* The correlation of a sequence with itself, shifted by 1 to LAGS. */
static void numbers_do_not_depend_on_those_before(void)
{
    enum { LAGS = 32 };
    static double z[SAMPLES];
    fcsl_noise_t noise;
    fcsl_noise_seed(&noise, 3, "autocorrelation");
    for (int i = 0; i < SAMPLES; i++) {
        z[i] = fcsl_noise_gaussian(&noise, 0);
    }
    for (int lag = 1; lag <= LAGS; lag++) {
        double sum = 0.0;
        for (int i = lag; i < SAMPLES; i++) {
            sum += z[i] * z[i - lag];
        }
        CHECK(fabs(sum / (SAMPLES - lag)) < 5.0 / sqrt(SAMPLES - lag));
    }
}

static void there_are_so_many_streams(void)
{
    fcsl_noise_t noise;
    fcsl_noise_seed(&noise, 3, "a");
    CHECK(isfinite(fcsl_noise_gaussian(&noise, FCSL_NOISE_STREAMS - 1u)));
    CHECK(isnan(fcsl_noise_gaussian(&noise, FCSL_NOISE_STREAMS)));
    CHECK(isnan(fcsl_noise_uniform(&noise, UINT32_MAX)));
}

int main(void)
{
    generator_is_philox();
    gaussian_keeps_its_bits();
    gaussian_is_normal();
    uniform_is_flat();
    streams_are_independent();
    numbers_do_not_depend_on_those_before();
    there_are_so_many_streams();
    return 0;
}
