/* SPDX-License-Identifier: Apache-2.0
 *
 * The lander of examples/lander with a constant throttle: 3 states, 3 events.
 */
#ifndef BENCH_LANDER_H
#define BENCH_LANDER_H

#include <stdbool.h>

enum { LANDER_STATES = 3, LANDER_TOUCHDOWN = 0, LANDER_LIFT_OFF, LANDER_BURNOUT, LANDER_EVENTS };

typedef struct {
    struct {
        double dry_mass, fuel_mass, max_thrust, isp, gravity, height, throttle;
    } parameters;
    struct {
        double x[LANDER_STATES]; /* height, speed, mass */
        double touchdown_speed;
        bool empty, on_ground;
    } state;
    struct {
        double x[LANDER_STATES];
    } outputs;
} lander_t;

static inline double lander_thrust(const lander_t *lander)
{
    return lander->state.empty ? 0.0 : lander->parameters.throttle * lander->parameters.max_thrust;
}

static inline void lander_derivative(const lander_t *lander, const double *x, double *dx)
{
    const double acceleration = lander_thrust(lander) / x[2] - lander->parameters.gravity;
    dx[0] = lander->state.on_ground ? 0.0 : x[1];
    dx[1] = lander->state.on_ground ? 0.0 : acceleration;
    dx[2] = -lander_thrust(lander) / (lander->parameters.isp * 9.80665);
}

static inline void lander_event(const lander_t *lander, const double *x, double *value)
{
    const double acceleration = lander_thrust(lander) / x[2] - lander->parameters.gravity;
    value[LANDER_TOUCHDOWN] = lander->state.on_ground ? 1.0 : x[0];
    value[LANDER_LIFT_OFF] = lander->state.on_ground ? acceleration : -1.0;
    value[LANDER_BURNOUT] = lander->state.empty ? 1.0 : x[2] - lander->parameters.dry_mass;
}

static inline void lander_reset(lander_t *lander, unsigned number)
{
    if (number == LANDER_TOUCHDOWN) {
        lander->state.touchdown_speed = -lander->state.x[1];
        lander->state.x[0] = 0.0;
        lander->state.x[1] = 0.0;
        lander->state.on_ground = true;
    } else if (number == LANDER_LIFT_OFF) {
        lander->state.on_ground = false;
    } else {
        lander->state.x[2] = lander->parameters.dry_mass;
        lander->state.empty = true;
    }
}

#endif /* BENCH_LANDER_H */
