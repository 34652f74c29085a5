/* SPDX-License-Identifier: Apache-2.0
 *
 * Delta angle and delta velocity.
 */
#include "frontends/strapdown.h"

#include <stdint.h>
#include <string.h>

/* sum += ½ (a + ⅙ d) × b */
static void add_half_cross(double sum[3], const double a[3], const double d[3], const double b[3])
{
    double c[3];
    for (uint32_t i = 0; i < 3u; i++) {
        c[i] = a[i] + d[i] / 6.0;
    }
    sum[0] += 0.5 * (c[1] * b[2] - c[2] * b[1]);
    sum[1] += 0.5 * (c[2] * b[0] - c[0] * b[2]);
    sum[2] += 0.5 * (c[0] * b[1] - c[1] * b[0]);
}

static void integrate(strapdown_t *strapdown, const double rate[3], const double accel[3], double dt_s)
{
    double d_angle[3];
    double d_velocity[3];
    for (uint32_t i = 0; i < 3u; i++) {
        d_angle[i] = 0.5 * (strapdown->rate[i] + rate[i]) * dt_s;
        d_velocity[i] = 0.5 * (strapdown->accel[i] + accel[i]) * dt_s;
    }
    add_half_cross(strapdown->coning, strapdown->angle, strapdown->d_angle, d_angle);
    add_half_cross(strapdown->sculling, strapdown->angle, strapdown->d_angle, d_velocity);
    add_half_cross(strapdown->sculling, strapdown->velocity, strapdown->d_velocity, d_angle);
    for (uint32_t i = 0; i < 3u; i++) {
        strapdown->angle[i] += d_angle[i];
        strapdown->velocity[i] += d_velocity[i];
    }
    memcpy(strapdown->d_angle, d_angle, sizeof d_angle);
    memcpy(strapdown->d_velocity, d_velocity, sizeof d_velocity);
    strapdown->time_s += dt_s;
}

void strapdown_add(strapdown_t *strapdown, const double rate[3], const double accel[3], double dt_s)
{
    if (strapdown->primed && dt_s > 0.0) {
        integrate(strapdown, rate, accel, dt_s);
    } else {
        memset(strapdown->d_angle, 0, sizeof strapdown->d_angle);
        memset(strapdown->d_velocity, 0, sizeof strapdown->d_velocity);
    }
    memcpy(strapdown->rate, rate, sizeof strapdown->rate);
    memcpy(strapdown->accel, accel, sizeof strapdown->accel);
    strapdown->primed = 1;
}

void strapdown_take(strapdown_t *strapdown, double delta_angle[3], double delta_velocity[3], double *delta_time_s)
{
    const double none[3] = {0.0};
    double rotation[3] = {0.0}; /* ½ angle × velocity */
    add_half_cross(rotation, strapdown->angle, none, strapdown->velocity);
    for (uint32_t i = 0; i < 3u; i++) {
        delta_angle[i] = strapdown->angle[i] + strapdown->coning[i];
        delta_velocity[i] = strapdown->velocity[i] + rotation[i] + strapdown->sculling[i];
        strapdown->angle[i] = 0.0;
        strapdown->velocity[i] = 0.0;
        strapdown->coning[i] = 0.0;
        strapdown->sculling[i] = 0.0;
    }
    *delta_time_s = strapdown->time_s;
    strapdown->time_s = 0.0;
}
