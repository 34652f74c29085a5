/* SPDX-License-Identifier: Apache-2.0
 *
 * Three bodies that attract each other: 18 states, the positions and then the velocities.
 */
#ifndef BENCH_BODIES_H
#define BENCH_BODIES_H

#include <math.h>

enum { BODIES = 3, BODIES_STATES = 18 };

typedef struct {
    struct {
        double mu[BODIES]; /* gravitational constant times mass */
        double x[BODIES_STATES]; /* at the start */
    } parameters;
    struct {
        double x[BODIES_STATES];
    } state;
    struct {
        double x[BODIES_STATES];
    } outputs;
} bodies_t;

static inline void bodies_derivative(const bodies_t *bodies, const double *x, double *dx)
{
    const double *mu = bodies->parameters.mu;
    double a[BODIES][3] = {{0.0}};
    for (int i = 0; i < BODIES; i++) {
        for (int j = i + 1; j < BODIES; j++) {
            const double rx = x[3 * j] - x[3 * i];
            const double ry = x[3 * j + 1] - x[3 * i + 1];
            const double rz = x[3 * j + 2] - x[3 * i + 2];
            const double square = rx * rx + ry * ry + rz * rz;
            const double inverse_cube = 1.0 / (square * sqrt(square));
            const double to_i = mu[j] * inverse_cube;
            const double to_j = mu[i] * inverse_cube;
            a[i][0] += to_i * rx;
            a[i][1] += to_i * ry;
            a[i][2] += to_i * rz;
            a[j][0] -= to_j * rx;
            a[j][1] -= to_j * ry;
            a[j][2] -= to_j * rz;
        }
    }
    for (int i = 0; i < 3 * BODIES; i++) {
        dx[i] = x[3 * BODIES + i];
        dx[3 * BODIES + i] = a[i / 3][i % 3];
    }
}

#endif /* BENCH_BODIES_H */
