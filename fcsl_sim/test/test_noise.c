/* SPDX-License-Identifier: Apache-2.0
 *
 * Noise: known bits, the distribution's moments and tails, independence of the streams of different instances.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "check.h"
#include "noise.h"

enum { SAMPLES = 1000000 };

/* The published first outputs of xoshiro256++ from the state 1, 2, 3, 4. */
static void generator_is_xoshiro(void)
{
    static const uint64_t published[] = {UINT64_C(41943041),
                                         UINT64_C(58720359),
                                         UINT64_C(3588806011781223),
                                         UINT64_C(3591011842654386),
                                         UINT64_C(9228616714210784205),
                                         UINT64_C(9973669472204895162)};
    fcsl_noise_t noise = {.word = {1, 2, 3, 4}};
    for (size_t i = 0; i < sizeof published / sizeof *published; i++) {
        CHECK(fcsl_noise_uniform(&noise) == (double)(published[i] >> 11) * 0x1p-53);
    }
}

/* Computed from the definitions with mpmath (correctly rounded log, sin, cos) and CPython's doubles. */
static void gaussian_keeps_its_bits(void)
{
    static const struct {
        uint64_t seed;
        const char *name;
        double values[6];
    } golden[] = {
        {0,
         "altimeter",
         {-0x1.9e4721dc79031p+1, 0x1.3d4b890046a3fp-2, 0x1.6325c324e566ep-3, 0x1.d9f0260398d83p-1,
          -0x1.de9987284c4dap-3, 0x1.ce49836e6d27cp-1}},
        {1,
         "altimeter",
         {-0x1.0037e1565a014p-1, 0x1.39b9f3d392d82p-2, 0x1.e9bd9c879bc4ap+0, 0x1.dc7a6d7cd73cap-5,
          -0x1.7feb30b719d26p-1, 0x1.2425af275ae90p-1}},
        {1,
         "velocimeter",
         {-0x1.33a490cefb498p-2, -0x1.bdac6100abc72p-1, -0x1.9901d417f02d0p-2, -0x1.f88362ac23d7dp-3,
          0x1.7fbe0c6d1565ep-2, 0x1.57c3beb203406p+0}},
        {UINT64_MAX,
         "a",
         {-0x1.347923ee1dcf3p+1, -0x1.064a09dbaf07ap-2, 0x1.992ffdfee0709p-1, 0x1.79bde1d1ae0edp-1,
          -0x1.bdd63f3a2428cp-1, 0x1.f888716451f82p-2}},
    };
    for (size_t i = 0; i < sizeof golden / sizeof *golden; i++) {
        fcsl_noise_t noise;
        fcsl_noise_seed(&noise, golden[i].seed, golden[i].name);
        for (int j = 0; j < 6; j++) {
            const double value = fcsl_noise_gaussian(&noise);
            CHECK(memcmp(&value, &golden[i].values[j], sizeof value) == 0);
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
        const double z = fcsl_noise_gaussian(&noise);
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
        const double u = fcsl_noise_uniform(&noise);
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

static double correlation(uint64_t seed_a, const char *name_a, uint64_t seed_b, const char *name_b)
{
    fcsl_noise_t a;
    fcsl_noise_t b;
    fcsl_noise_seed(&a, seed_a, name_a);
    fcsl_noise_seed(&b, seed_b, name_b);
    double sum = 0.0;
    for (int i = 0; i < SAMPLES / 10; i++) {
        sum += fcsl_noise_gaussian(&a) * fcsl_noise_gaussian(&b);
    }
    return sum / (SAMPLES / 10.0);
}

/* Neighbouring seeds and similar names give unrelated streams; the same ones give the same stream. */
static void streams_are_independent(void)
{
    const double limit = 5.0 / sqrt(SAMPLES / 10.0);
    CHECK(fabs(correlation(1, "a", 1, "b")) < limit);
    CHECK(fabs(correlation(1, "imu1", 1, "imu2")) < limit);
    CHECK(fabs(correlation(1, "a", 2, "a")) < limit);
    CHECK(fabs(correlation(0, "", 1, "")) < limit);
    CHECK(fabs(correlation(1, "a", 1, "a") - 1.0) < 0.05);
}

int main(void)
{
    generator_is_xoshiro();
    gaussian_keeps_its_bits();
    gaussian_is_normal();
    uniform_is_flat();
    streams_are_independent();
    return 0;
}
