/* SPDX-License-Identifier: Apache-2.0
 *
 * Frontends: corrections, which backend is healthy, which one is primary, and what the machine gets.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_frontend.h"
#include "fcsl_check.h"

enum { MS = 1000000 };

static fcsl_frontend_config_t config_of(fcsl_sensor_kind_t kind, uint32_t backends)
{
    fcsl_frontend_config_t config = {
        .kind = kind, .max_age_ns = 20 * MS, .recover_ns = 100 * MS, .backend_count = backends};
    for (uint32_t q = 0; q < FCSL_QUANTITIES_MAX; q++) {
        config.low[q] = -INFINITY;
        config.high[q] = INFINITY;
        config.tolerance[q] = INFINITY;
        for (uint32_t b = 0; b < backends; b++) {
            config.backends[b].corrections[q] = (fcsl_correction_t){.matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        }
    }
    config.needed[0] = fcsl_sensor_kinds[kind].quantities[0].count;
    for (uint32_t b = 0; b < backends; b++) {
        config.backends[b].period_ns = 10 * MS;
        for (uint32_t i = 0; i < FCSL_STICKS_MAX; i++) {
            config.backends[b].sticks[i] = (fcsl_stick_t){.minimum = 1000, .middle = 1500, .maximum = 2000};
        }
    }
    return config;
}

/* A frontend, and the tick that it has come to: one every 10 ms. */
typedef struct {
    fcsl_frontend_t *frontend;
    fcsl_frontend_output_t output;
    uint64_t now_ns;
} rig_t;

static rig_t begin(const fcsl_frontend_config_t *config)
{
    rig_t rig = {.frontend = calloc(1, fcsl_frontend_bytes()), .now_ns = 1000 * MS};
    CHECK(rig.frontend != NULL);
    fcsl_frontend_init(rig.frontend, config);
    return rig;
}

static void give(rig_t *rig, uint32_t backend, double first)
{
    fcsl_reading_t reading = {.sample_ns = rig->now_ns - 1 * MS, .backend = backend};
    for (uint32_t i = 0; i < FCSL_VALUES_MAX; i++) {
        reading.values[i] = NAN;
    }
    for (uint32_t i = 0; i < 3; i++) {
        reading.values[i] = first;
    }
    fcsl_frontend_take(rig->frontend, &reading);
}

static int32_t tick(rig_t *rig)
{
    fcsl_frontend_tick(rig->frontend, rig->now_ns, &rig->output);
    rig->now_ns += 10 * MS;
    return rig->output.primary;
}

static void test_correction(void)
{
    /* (raw - offset - per_kelvin·(T - celsius)), then turned by 90° about z and y doubled */
    fcsl_frontend_config_t config = config_of(FCSL_COMPASS, 1);
    config.backends[0].corrections[0] = (fcsl_correction_t){
        .matrix = {0, -1, 0, 2, 0, 0, 0, 0, 1}, .offset = {1, 2, 3}, .per_kelvin = {0.5, 0, 0}, .celsius = 20};
    rig_t rig = begin(&config);
    fcsl_reading_t reading = {.sample_ns = rig.now_ns, .values = {10, 20, 30, 24}};
    fcsl_frontend_take(rig.frontend, &reading);
    CHECK(tick(&rig) == 0 && rig.output.fresh && rig.output.sample_ns == 1000 * MS);
    CHECK(rig.output.values[0] == -18 && rig.output.values[1] == 14 && rig.output.values[2] == 27);
    /* Without a temperature its term is left out. */
    reading.sample_ns = rig.now_ns;
    reading.values[3] = NAN;
    fcsl_frontend_take(rig.frontend, &reading);
    CHECK(tick(&rig) == 0 && rig.output.values[1] == 18);
    free(rig.frontend);
}

static void test_sticks(void)
{
    fcsl_frontend_config_t config = config_of(FCSL_RC, 1);
    config.backends[0].sticks[1] = (fcsl_stick_t){.minimum = 2000, .middle = 1500, .maximum = 1000}; /* reversed */
    config.backends[0].sticks[2] = (fcsl_stick_t){.minimum = 1000, .middle = 1400, .maximum = 2000, .deadband = 100};
    const double pulses[][2] = {{1000, -1}, {1500, 0}, {1750, 0.5}, {2200, 1}, {800, -1}};
    for (size_t i = 0; i < sizeof pulses / sizeof pulses[0]; i++) {
        rig_t rig = begin(&config);
        give(&rig, 0, pulses[i][0]);
        CHECK(tick(&rig) == -1); /* 18 channels are needed, and 3 are there */
        config.needed[0] = 3;
        give(&rig, 0, pulses[i][0]);
        CHECK(tick(&rig) == 0);
        CHECK(rig.output.values[0] == pulses[i][1] && rig.output.values[1] == -pulses[i][1]);
        CHECK(isnan(rig.output.values[3]));
        config.needed[0] = FCSL_STICKS_MAX;
        free(rig.frontend);
    }
    config.needed[0] = 3;
    const double with_deadband[][2] = {{1000, -1}, {1300, 0}, {1500, 0}, {1750, 0.5}, {1150, -0.5}};
    for (size_t i = 0; i < sizeof with_deadband / sizeof with_deadband[0]; i++) {
        rig_t rig = begin(&config);
        give(&rig, 0, with_deadband[i][0]);
        CHECK(tick(&rig) == 0 && rig.output.values[2] == with_deadband[i][1]);
        free(rig.frontend);
    }
}

/* One of two is lost: the primary changes and nothing else. Both are lost: nobody is primary. */
static void test_loss(void)
{
    const fcsl_frontend_config_t config = config_of(FCSL_INERTIAL, 2);
    rig_t rig = begin(&config);
    CHECK(tick(&rig) == -1 && !rig.output.fresh);
    for (int i = 0; i < 5; i++) {
        give(&rig, 0, 1);
        give(&rig, 1, 2);
        CHECK(tick(&rig) == 0 && rig.output.fresh && rig.output.values[0] == 1);
    }
    CHECK(tick(&rig) == 0 && !rig.output.fresh); /* a tick without a sample is no loss */
    give(&rig, 1, 2);
    CHECK(tick(&rig) == 1 && rig.output.values[0] == 2);
    CHECK(fcsl_frontend_condition(rig.frontend, 0) == FCSL_BACKEND_SILENT);
    /* Back again: it recovers, and is not primary again as long as the other one is healthy. */
    for (int i = 0; i < 20; i++) {
        give(&rig, 0, 1);
        give(&rig, 1, 2);
        CHECK(tick(&rig) == 1);
        const fcsl_backend_condition_t condition = fcsl_frontend_condition(rig.frontend, 0);
        CHECK(condition == (i < 10 ? FCSL_BACKEND_RECOVERING : FCSL_BACKEND_HEALTHY));
    }
    for (int i = 0; i < 3; i++) {
        give(&rig, 0, 1);
        (void)tick(&rig);
    }
    CHECK(rig.output.primary == 0);
    (void)tick(&rig);
    (void)tick(&rig);
    CHECK(tick(&rig) == -1 && !rig.output.fresh);
    /* One that recovers is better than none: the last primary first. */
    give(&rig, 0, 1);
    give(&rig, 1, 2);
    CHECK(tick(&rig) == 0 && rig.output.fresh && rig.output.values[0] == 1);
    CHECK(fcsl_frontend_condition(rig.frontend, 0) == FCSL_BACKEND_RECOVERING);
    free(rig.frontend);
}

static void test_conditions(void)
{
    fcsl_frontend_config_t config = config_of(FCSL_INERTIAL, 1);
    config.low[0] = -10;
    config.high[0] = 10;
    config.stuck_ns = 50 * MS;
    config.recover_ns = 0;
    rig_t rig = begin(&config);
    const double bad[] = {10.5, -10.5, NAN, INFINITY};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        give(&rig, 0, bad[i]);
        CHECK(tick(&rig) == -1 && fcsl_frontend_condition(rig.frontend, 0) == FCSL_BACKEND_RANGE);
        give(&rig, 0, (double)i);
        CHECK(tick(&rig) == 0);
    }
    for (int i = 0; i < 10; i++) {
        give(&rig, 0, 7);
        CHECK(tick(&rig) == (i < 5 ? 0 : -1));
    }
    CHECK(fcsl_frontend_condition(rig.frontend, 0) == FCSL_BACKEND_STUCK);
    give(&rig, 0, 7.001);
    CHECK(tick(&rig) == 0);
    free(rig.frontend);

    const fcsl_frontend_config_t gnss = config_of(FCSL_GNSS, 1);
    rig = begin(&gnss);
    for (double fix = 0; fix <= 3; fix++) {
        give(&rig, 0, fix);
        (void)tick(&rig);
        rig.now_ns += 200 * MS; /* recovered */
        give(&rig, 0, fix);
        CHECK(tick(&rig) == (fix >= 2 ? 0 : -1));
    }
    free(rig.frontend);

    fcsl_frontend_config_t rc = config_of(FCSL_RC, 1);
    rc.needed[0] = 1;
    rig = begin(&rc);
    fcsl_reading_t reading = {.sample_ns = rig.now_ns};
    reading.values[18] = 1;
    fcsl_frontend_take(rig.frontend, &reading);
    CHECK(tick(&rig) == -1 && fcsl_frontend_condition(rig.frontend, 0) == FCSL_BACKEND_INVALID);
    free(rig.frontend);
}

/* One of three disagrees with the median for longer than max_age: it is out. Of two nobody is. */
static void test_disagreement(void)
{
    fcsl_frontend_config_t config = config_of(FCSL_INERTIAL, 3);
    config.tolerance[0] = 0.5;
    rig_t rig = begin(&config);
    for (int i = 0; i < 6; i++) {
        give(&rig, 0, 3);
        give(&rig, 1, 1);
        give(&rig, 2, 1.25);
        CHECK(tick(&rig) == (i < 3 ? 0 : 1));
    }
    CHECK(fcsl_frontend_condition(rig.frontend, 0) == FCSL_BACKEND_DISAGREES);
    CHECK(rig.output.values[0] == 1);
    /* One deviation that does not last changes nothing. */
    for (int i = 0; i < 40; i++) {
        give(&rig, 0, 1);
        give(&rig, 1, i % 3 == 0 ? 9 : 1);
        give(&rig, 2, 1.25);
        CHECK(tick(&rig) == 1);
    }
    free(rig.frontend);
    config.backend_count = 2;
    rig = begin(&config);
    for (int i = 0; i < 20; i++) {
        give(&rig, 0, 3);
        give(&rig, 1, 1);
        CHECK(tick(&rig) == 0);
    }
    free(rig.frontend);
}

/* At the beginning the first of the list is waited for, for max_age. */
static void test_beginning(void)
{
    const fcsl_frontend_config_t config = config_of(FCSL_INERTIAL, 2);
    rig_t rig = begin(&config);
    give(&rig, 1, 2);
    CHECK(tick(&rig) == -1);
    give(&rig, 0, 1);
    give(&rig, 1, 2);
    CHECK(tick(&rig) == 0);
    free(rig.frontend);
    rig = begin(&config);
    for (int i = 0; i < 5; i++) {
        give(&rig, 1, 2);
        CHECK(tick(&rig) == (i < 3 ? -1 : 1));
    }
    free(rig.frontend);
}

/* What comes late, twice or from nowhere changes nothing. */
static void test_times(void)
{
    const fcsl_frontend_config_t config = config_of(FCSL_INERTIAL, 1);
    rig_t rig = begin(&config);
    give(&rig, 0, 1);
    give(&rig, 0, 2);
    give(&rig, 7, 2);
    CHECK(tick(&rig) == 0 && rig.output.values[0] == 1);
    fcsl_reading_t old = {.sample_ns = 5, .values = {9, 9, 9, 9, 9, 9}};
    fcsl_frontend_take(rig.frontend, &old);
    CHECK(tick(&rig) == 0 && rig.output.values[0] == 1 && !rig.output.fresh);
    free(rig.frontend);
}

/* The same readings give the same bytes, whatever else was in the memory. */
static void test_replay(void)
{
    fcsl_frontend_config_t config = config_of(FCSL_INERTIAL, 2);
    config.tolerance[0] = 0.1;
    for (uint32_t b = 0; b < 2; b++) {
        config.backends[b].section_count = 1;
        config.backends[b].sections[0] = (fcsl_section_t){.b = {0.2, 0.4, 0.2}, .a = {-0.36, 0.16}};
    }
    rig_t first = begin(&config);
    rig_t second = begin(&config);
    srand(7);
    for (int i = 0; i < 1000; i++) {
        const double value = (double)rand() / RAND_MAX;
        const uint32_t backend = (uint32_t)rand() % 2u;
        give(&first, backend, value);
        give(&second, backend, value);
        (void)tick(&first);
        (void)tick(&second);
        CHECK(memcmp(&first.output, &second.output, sizeof first.output) == 0);
    }
    free(first.frontend);
    free(second.frontend);
}

/* A low-pass filter begins in its steady state, and does what its coefficients say. */
static void test_section(void)
{
    fcsl_frontend_config_t config = config_of(FCSL_INERTIAL, 1);
    config.backends[0].section_count = 1;
    /* 2nd-order Butterworth, fc = fs / 10: scipy.signal.butter(2, 0.2) */
    config.backends[0].sections[0] =
        (fcsl_section_t){.b = {0.06745527388907190, 0.1349105477781438, 0.06745527388907190},
                         .a = {-1.1429805025399011, 0.4128015980961885}};
    rig_t rig = begin(&config);
    give(&rig, 0, 5);
    CHECK(tick(&rig) == 0 && fabs(rig.output.values[0] - 5) < 1e-12);
    /* scipy.signal.lfilter of a step from 5 to 6, begun in the steady state */
    const double expected[] = {5.06745527388907, 5.279465884515912, 5.561399507821618};
    for (size_t i = 0; i < 3; i++) {
        give(&rig, 0, 6);
        CHECK(tick(&rig) == 0 && fabs(rig.output.values[0] - expected[i]) < 1e-12);
    }
    /* After a gap it begins anew. */
    rig.now_ns += 50 * MS;
    give(&rig, 0, -3);
    (void)tick(&rig);
    rig.now_ns += 200 * MS;
    give(&rig, 0, -4);
    CHECK(tick(&rig) == 0 && fabs(rig.output.values[0] + 4) < 1e-12);
    free(rig.frontend);
}

int main(void)
{
    test_correction();
    test_sticks();
    test_loss();
    test_conditions();
    test_disagreement();
    test_beginning();
    test_times();
    test_replay();
    test_section();
    return 0;
}
