/* SPDX-License-Identifier: Apache-2.0
 *
 * The integrators against analytic solutions: the error at a fixed time falls with the order of the method.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "check.h"
#include "clock.h"
#include "integrate.h"

/* x' = -x, and the oscillator y'' = -y, side by side: x = e^-t, y = cos t, y' = -sin t. */
static void linear(const void *self, double t, const double *x, double *dx)
{
    (void)self;
    (void)t;
    dx[0] = -x[0];
    dx[1] = x[2];
    dx[2] = -x[1];
}

/* x' = 4 t^3, x = t^4: needs the correct times of the stages. */
static void power(const void *self, double t, const double *x, double *dx)
{
    (void)self;
    (void)x;
    dx[0] = 4.0 * t * t * t;
}

static double error_at_one(fcsl_method_t method, int steps)
{
    double scratch[3 * FCSL_INTEGRATE_SCRATCH];
    double x[3] = {1.0, 1.0, 0.0};
    const double h = 1.0 / steps;
    for (int i = 0; i < steps; i++) {
        fcsl_integrate(method, linear, NULL, i * h, h, x, 3, scratch);
    }
    return fmax(fabs(x[0] - exp(-1.0)), fmax(fabs(x[1] - cos(1.0)), fabs(x[2] + sin(1.0))));
}

static void converges(fcsl_method_t method, double order, int first_steps)
{
    for (int steps = first_steps; steps <= 8 * first_steps; steps *= 2) {
        const double measured = log2(error_at_one(method, steps) / error_at_one(method, 2 * steps));
        CHECK(fabs(measured - order) < 0.1);
    }
}

/* Runge-Kutta integrates polynomials of third degree exactly, up to rounding. */
static void is_exact_for_cubics(void)
{
    double scratch[FCSL_INTEGRATE_SCRATCH];
    double x = 0.0;
    for (int i = 0; i < 8; i++) {
        fcsl_integrate(FCSL_RK4, power, NULL, i * 0.125, 0.125, &x, 1, scratch);
    }
    CHECK(fabs(x - 1.0) < 1e-15);
}

/* The bits of one step, as CPython computes the same formula: any change of the order of operations, and any contraction, shows here. */
static void keeps_its_bits(void)
{
    double scratch[3 * FCSL_INTEGRATE_SCRATCH];
    double x[3] = {1.0, 0.3, -0.7};
    static const double golden[3] = {0x1.cf46dc5d63886p-1, 0x1.d435a15ae7658p-3, -0x1.73f1a2fe55944p-1};
    fcsl_integrate(FCSL_RK4, linear, NULL, 0.0, 0.1, x, 3, scratch);
    CHECK(memcmp(x, golden, sizeof x) == 0);
}

static void grid_is_exact(void)
{
    CHECK(fcsl_grid_time_ns(0, 3) == 0);
    CHECK(fcsl_grid_time_ns(1, 3) == 333333333);
    CHECK(fcsl_grid_time_ns(2, 3) == 666666666);
    CHECK(fcsl_grid_time_ns(3, 3) == 1000000000);
    CHECK(fcsl_grid_time_ns(UINT64_C(1000000000001), 1000000) == INT64_C(1000000000001000));
    /* the coarse grid lies on the fine one */
    for (uint64_t i = 0; i < 10000; i++) {
        CHECK(fcsl_grid_time_ns(i, 7) == fcsl_grid_time_ns(11 * i, 77));
    }
}

int main(void)
{
    converges(FCSL_EULER, 1.0, 100);
    converges(FCSL_RK4, 4.0, 8);
    is_exact_for_cubics();
    keeps_its_bits();
    grid_is_exact();
    return 0;
}
