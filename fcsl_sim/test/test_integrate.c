/* SPDX-License-Identifier: Apache-2.0
 *
 * The integrators against analytic solutions: the error at a fixed time falls with the order of the method.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "check.h"
#include "base/clock.h"
#include "integrators/integrate.h"

enum { STATES_MAX = 4 };

typedef struct {
    fcsl_integrator_t integrator;
    double memory[(FCSL_SLOPES + 1) * STATES_MAX];
    uint32_t blocks[1];
} solver_t;

static void open(solver_t *solver, fcsl_method_t method, uint32_t n, fcsl_slope_t slope)
{
    CHECK(fcsl_integrator_memory(n) <= sizeof solver->memory / sizeof *solver->memory);
    fcsl_integrator_init(&solver->integrator, method, n, slope, solver, solver->memory);
    solver->blocks[0] = n;
    solver->integrator.blocks = solver->blocks;
    solver->integrator.block_count = 1;
}

/* Two oscillators y'' = -y and y'' = -4 y: positions, then velocities. */
static void oscillators(void *context, double t, const double *x, double *dx)
{
    (void)context;
    (void)t;
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = -x[0];
    dx[3] = -4.0 * x[1];
}

static const double begin[4] = {1.0, 0.5, 0.0, 0.0};

static double error_of(const double *x, double t)
{
    const double exact[4] = {cos(t), 0.5 * cos(2.0 * t), -sin(t), -sin(2.0 * t)};
    double largest = 0.0;
    for (int i = 0; i < 4; i++) {
        largest = fmax(largest, fabs(x[i] - exact[i]));
    }
    return largest;
}

static double error_at_two(fcsl_method_t method, int steps)
{
    solver_t solver;
    double x[4];
    double x1[4];
    const double h = 2.0 / steps;
    memcpy(x, begin, sizeof x);
    open(&solver, method, 4, oscillators);
    for (int i = 0; i < steps; i++) {
        fcsl_integrator_step(&solver.integrator, i * h, h, 1, x, x1);
        fcsl_integrator_accept(&solver.integrator, 1);
        memcpy(x, x1, sizeof x);
    }
    return error_of(x, 2.0);
}

/* The order within 5 %. */
static void converges(fcsl_method_t method, double order, int first_steps)
{
    for (int steps = first_steps; steps <= 4 * first_steps; steps *= 2) {
        const double measured = log2(error_at_two(method, steps) / error_at_two(method, 2 * steps));
        CHECK(fabs(measured - order) < 0.05 * order);
    }
}

/* x' = 4 t^3, x = t^4: needs the correct times of the stages. */
static void power(void *context, double t, const double *x, double *dx)
{
    (void)context;
    (void)x;
    dx[0] = 4.0 * t * t * t;
}

/* Runge-Kutta integrates polynomials of third degree exactly, up to rounding. */
static void is_exact_for_cubics(void)
{
    solver_t solver;
    double x[2] = {0.0};
    double x1[2];
    open(&solver, FCSL_RK4, 1, power);
    for (int i = 0; i < 8; i++) {
        fcsl_integrator_step(&solver.integrator, i * 0.125, 0.125, 1, x, x1);
        fcsl_integrator_accept(&solver.integrator, 1);
        x[0] = x1[0];
    }
    CHECK(fabs(x[0] - 1.0) < 1e-15);
}

/* x' = -x, and an oscillator. */
static void linear(void *context, double t, const double *x, double *dx)
{
    (void)context;
    (void)t;
    dx[0] = -x[0];
    dx[1] = x[2];
    dx[2] = -x[1];
}

/* The bits of one step, as CPython computes the same formula: any change of the order of operations, and any contraction, shows here. */
static void keeps_its_bits(void)
{
    solver_t solver;
    const double x[4] = {1.0, 0.3, -0.7};
    double x1[4];
    static const double golden[3] = {0x1.cf46dc5d63886p-1, 0x1.d435a15ae7658p-3, -0x1.73f1a2fe55944p-1};
    open(&solver, FCSL_RK4, 3, linear);
    fcsl_integrator_step(&solver.integrator, 0.0, 0.1, 1, x, x1);
    CHECK(memcmp(x1, golden, sizeof golden) == 0);
}

/* A step may be tried with several sizes: the last one counts, and it is the same as if it were the only one. */
static void tries_leave_nothing_behind(fcsl_method_t method)
{
    solver_t once;
    solver_t twice;
    double x[2][4];
    double x1[4];
    memcpy(x[0], begin, sizeof begin);
    memcpy(x[1], begin, sizeof begin);
    open(&once, method, 4, oscillators);
    open(&twice, method, 4, oscillators);
    for (int i = 0; i < 8; i++) {
        fcsl_integrator_step(&once.integrator, i * 0.1, 0.1, 1, x[0], x1);
        fcsl_integrator_accept(&once.integrator, 1);
        memcpy(x[0], x1, sizeof x1);
        fcsl_integrator_step(&twice.integrator, i * 0.1, 0.03, 0, x[1], x1);
        fcsl_integrator_step(&twice.integrator, i * 0.1, 0.1, 1, x[1], x1);
        fcsl_integrator_accept(&twice.integrator, 1);
        memcpy(x[1], x1, sizeof x1);
        CHECK(memcmp(x[0], x[1], sizeof x1) == 0);
    }
}

/* After a restart AB4 is RK4 for three steps. */
static void ab4_starts_with_rk4(void)
{
    solver_t ab4;
    solver_t rk4;
    double x[4];
    double by_ab4[4];
    double by_rk4[4];
    memcpy(x, begin, sizeof x);
    open(&ab4, FCSL_AB4, 4, oscillators);
    open(&rk4, FCSL_RK4, 4, oscillators);
    for (int i = 0; i < 10; i++) {
        if (i == 5) {
            fcsl_integrator_restart(&ab4.integrator);
        }
        fcsl_integrator_step(&rk4.integrator, i * 0.1, 0.1, 1, x, by_rk4);
        fcsl_integrator_accept(&rk4.integrator, 1);
        fcsl_integrator_step(&ab4.integrator, i * 0.1, 0.1, 1, x, by_ab4);
        fcsl_integrator_accept(&ab4.integrator, 1);
        CHECK((memcmp(by_ab4, by_rk4, sizeof x) == 0) == (i < 3 || (i >= 5 && i < 8)));
        memcpy(x, by_ab4, sizeof x);
    }
}

/* The estimate of RK45 is that of the error of fourth order; the interpolant passes through both ends, and between them is as good. */
static void rk45_knows_its_error(void)
{
    static const double atol[4] = {1.0, 1.0, 1.0, 1.0};
    solver_t solver;
    double x1[4];
    double x[4];
    uint32_t worst = 9;
    open(&solver, FCSL_RK45, 4, oscillators);
    const double large = fcsl_rk45_step(&solver.integrator, 0.0, 0.4, begin, x1, atol, 0.0, &worst);
    CHECK(worst == 1 || worst == 3); /* the faster one */
    CHECK(error_of(x1, 0.4) < large);
    for (int i = 0; i <= 10; i++) {
        fcsl_rk45_interpolate(&solver.integrator, 0.4, 0.1 * i, begin, x);
        CHECK(error_of(x, 0.04 * i) < 2e-4);
    }
    fcsl_rk45_interpolate(&solver.integrator, 0.4, 1.0, begin, x);
    for (int i = 0; i < 4; i++) {
        CHECK(fabs(x[i] - x1[i]) < 1e-15);
    }
    const double small = fcsl_rk45_step(&solver.integrator, 0.0, 0.2, begin, x1, atol, 0.0, &worst);
    CHECK(fabs(log2(large / small) - 5.0) < 0.5);
}

static void steps_follow_the_error(void)
{
    CHECK(fcsl_rk45_factor(0.0) == 5.0 && fcsl_rk45_factor(1e-12) == 5.0);
    CHECK(fcsl_rk45_factor(1e12) == 0.2 && fcsl_rk45_factor(NAN) == 0.2);
    CHECK(fabs(fcsl_rk45_factor(1.0) - 0.9) < 1e-15);
    CHECK(fabs(fcsl_rk45_factor(32.0) - 0.45) < 1e-15);
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
    converges(FCSL_EULER, 1.0, 400);
    converges(FCSL_RK2, 2.0, 40);
    converges(FCSL_RK4, 4.0, 20);
    converges(FCSL_AB4, 4.0, 160);
    converges(FCSL_VERLET, 2.0, 40);
    is_exact_for_cubics();
    keeps_its_bits();
    for (int method = FCSL_EULER; method <= FCSL_VERLET; method++) {
        tries_leave_nothing_behind((fcsl_method_t)method);
    }
    ab4_starts_with_rk4();
    rk45_knows_its_error();
    steps_follow_the_error();
    grid_is_exact();
    return 0;
}
