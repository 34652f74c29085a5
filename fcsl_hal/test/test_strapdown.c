/* SPDX-License-Identifier: Apache-2.0
 *
 * Delta angle and delta velocity against the true motion, integrated by quaternions in steps a hundred times finer.
 */
#include <math.h>
#include <stdint.h>

#include "fcsl_check.h"
#include "frontends/strapdown.h"

enum { SAMPLES = 20, FINE = 200 }; /* in a tick of 20 ms */
static const double SAMPLE_S = 0.001;

typedef struct {
    double w, x, y, z;
} quaternion_t;

static quaternion_t times(quaternion_t a, quaternion_t b)
{
    return (quaternion_t){a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

static void rotate(quaternion_t q, const double v[3], double out[3])
{
    const quaternion_t conjugate = {q.w, -q.x, -q.y, -q.z};
    const quaternion_t turned = times(times(q, (quaternion_t){0, v[0], v[1], v[2]}), conjugate);
    out[0] = turned.x;
    out[1] = turned.y;
    out[2] = turned.z;
}

/* Coning about z, with an acceleration that swings along (sculling). */
static void motion(double t, double rate[3], double accel[3])
{
    const double amplitude = 3.0;
    const double pace = 2.0 * 3.14159265358979323846 * 20.0;
    rate[0] = amplitude * cos(pace * t);
    rate[1] = amplitude * sin(pace * t);
    rate[2] = 0.2;
    accel[0] = 4.0 * sin(pace * t);
    accel[1] = -4.0 * cos(pace * t);
    accel[2] = 0.5; /* small: the square of the angle, which is neglected, turns it */
}

static void true_motion(double begin_s, double angle[3], double velocity[3])
{
    quaternion_t q = {1, 0, 0, 0};
    const double dt = SAMPLE_S / FINE;
    velocity[0] = velocity[1] = velocity[2] = 0;
    for (int i = 0; i < SAMPLES * FINE; i++) {
        double rate[3];
        double accel[3];
        double turned[3];
        motion(begin_s + (i + 0.5) * dt, rate, accel);
        const quaternion_t half = times(q, (quaternion_t){1, rate[0] * dt / 4, rate[1] * dt / 4, rate[2] * dt / 4});
        rotate(half, accel, turned);
        for (int k = 0; k < 3; k++) {
            velocity[k] += turned[k] * dt;
        }
        const double size = sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]);
        const double s = sin(size * dt / 2) / size;
        q = times(q, (quaternion_t){cos(size * dt / 2), rate[0] * s, rate[1] * s, rate[2] * s});
    }
    const double sine = sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    const double scale = 2 * atan2(sine, q.w) / sine;
    angle[0] = q.x * scale;
    angle[1] = q.y * scale;
    angle[2] = q.z * scale;
}

/* About z the motion has a drift, which sums alone do not see. In x and y nothing drifts: there the trapezoids have their errors. */
static void test_coning_and_sculling(void)
{
    strapdown_t strapdown = {0};
    double plain_error[2] = {0};
    double error[2] = {0};
    double rate[3];
    double accel[3];
    motion(0, rate, accel);
    strapdown_add(&strapdown, rate, accel, 0);
    for (int tick = 0; tick < 50; tick++) {
        double angle[3];
        double velocity[3];
        double time_s = 0;
        double expected[2][3];
        for (int i = 1; i <= SAMPLES; i++) {
            motion((tick * SAMPLES + i) * SAMPLE_S, rate, accel);
            strapdown_add(&strapdown, rate, accel, SAMPLE_S);
        }
        true_motion(tick * SAMPLES * SAMPLE_S, expected[0], expected[1]);
        plain_error[0] += expected[0][2] - strapdown.angle[2];
        plain_error[1] += expected[1][2] - strapdown.velocity[2];
        strapdown_take(&strapdown, angle, velocity, &time_s);
        CHECK(fabs(time_s - SAMPLES * SAMPLE_S) < 1e-12);
        error[0] += expected[0][2] - angle[2];
        error[1] += expected[1][2] - velocity[2];
    }
    CHECK(fabs(plain_error[0]) > 0.01 && fabs(error[0]) < 0.01 * fabs(plain_error[0]));
    CHECK(fabs(plain_error[1]) > 0.01 && fabs(error[1]) < 0.01 * fabs(plain_error[1]));
}

/* A constant rotation about one axis has no coning, and the sums are exact. */
static void test_constant(void)
{
    strapdown_t strapdown = {0};
    const double rate[3] = {0, 0, 2};
    const double accel[3] = {0, 0, 9.5};
    double angle[3];
    double velocity[3];
    double time_s = 0;
    for (int i = 0; i <= 16; i++) {
        strapdown_add(&strapdown, rate, accel, i == 0 ? 0 : 0.125);
    }
    strapdown_take(&strapdown, angle, velocity, &time_s);
    CHECK(time_s == 2 && angle[0] == 0 && angle[1] == 0 && angle[2] == 4);
    CHECK(velocity[0] == 0 && velocity[1] == 0 && velocity[2] == 19);
    /* Nothing came: nothing goes on. */
    strapdown_take(&strapdown, angle, velocity, &time_s);
    CHECK(time_s == 0 && angle[2] == 0 && velocity[2] == 0);
    /* A gap is not integrated over. */
    strapdown.primed = 0;
    strapdown_add(&strapdown, rate, accel, 100);
    strapdown_take(&strapdown, angle, velocity, &time_s);
    CHECK(time_s == 0 && angle[2] == 0);
}

int main(void)
{
    test_coning_and_sculling();
    test_constant();
    return 0;
}
