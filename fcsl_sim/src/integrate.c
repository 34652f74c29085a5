/* SPDX-License-Identifier: Apache-2.0
 *
 * Euler and RK4 steps with a fixed order of operations.
 */
#include "integrate.h"

#include <string.h>

/* x <- x + h*f(t, x): first order. */
static void step_euler(fcsl_derivative_t f, const void *self, double t, double h, double *x, uint32_t n,
                       double *scratch)
{
    double *at = scratch;
    double *dx = scratch + n;
    memcpy(at, x, n * sizeof *x);
    f(self, t, at, dx);
    for (uint32_t i = 0; i < n; i++) {
        x[i] = x[i] + h * dx[i];
    }
}

/* The classical Runge-Kutta method: fourth order. x <- x + h/6*(k1 + 2*k2 + 2*k3 + k4), summed from the left. */
static void step_rk4(fcsl_derivative_t f, const void *self, double t, double h, double *x, uint32_t n, double *scratch)
{
    double *at = scratch;
    double *k1 = scratch + n;
    double *k2 = scratch + 2 * (size_t)n;
    double *k3 = scratch + 3 * (size_t)n;
    double *k4 = scratch + 4 * (size_t)n;
    const double half = 0.5 * h;
    memcpy(at, x, n * sizeof *x);
    f(self, t, at, k1);
    for (uint32_t i = 0; i < n; i++) {
        at[i] = x[i] + half * k1[i];
    }
    f(self, t + half, at, k2);
    for (uint32_t i = 0; i < n; i++) {
        at[i] = x[i] + half * k2[i];
    }
    f(self, t + half, at, k3);
    for (uint32_t i = 0; i < n; i++) {
        at[i] = x[i] + h * k3[i];
    }
    f(self, t + h, at, k4);
    const double sixth = h / 6.0;
    for (uint32_t i = 0; i < n; i++) {
        x[i] = x[i] + sixth * (((k1[i] + 2.0 * k2[i]) + 2.0 * k3[i]) + k4[i]);
    }
}

void fcsl_integrate(fcsl_method_t method, fcsl_derivative_t derivative, const void *self, double t, double h, double *x,
                    uint32_t n, double *scratch)
{
    if (method == FCSL_EULER) {
        step_euler(derivative, self, t, h, x, n, scratch);
    } else {
        step_rk4(derivative, self, t, h, x, n, scratch);
    }
}
