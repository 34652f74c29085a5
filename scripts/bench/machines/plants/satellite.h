/* SPDX-License-Identifier: Apache-2.0
 *
 * A rigid body in orbit, free of torques: 13 states, which are position, velocity, quaternion, rates. The same case as that of
 * peers/satellite.
 */
#ifndef BENCH_SATELLITE_H
#define BENCH_SATELLITE_H

#include <math.h>

#include "rigid.h"

enum { SATELLITE_STATES = 13 };

typedef struct {
    struct {
        double mu; /* of the planet */
        double inertia[3];
        double x[SATELLITE_STATES]; /* at the start */
    } parameters;
    struct {
        double x[SATELLITE_STATES];
    } state;
    struct {
        double x[SATELLITE_STATES];
    } outputs;
} satellite_t;

static inline void satellite_derivative(const satellite_t *satellite, const double *x, double *dx)
{
    static const double torque[3] = {0.0, 0.0, 0.0};
    const double square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
    const double pull = -satellite->parameters.mu / (square * sqrt(square));
    for (int i = 0; i < 3; i++) {
        dx[i] = x[3 + i];
        dx[3 + i] = pull * x[i];
    }
    rigid_turn(x + 6, x + 10, dx + 6);
    rigid_spin(satellite->parameters.inertia, x + 10, torque, dx + 10);
}

#endif /* BENCH_SATELLITE_H */
