/* SPDX-License-Identifier: Apache-2.0
 *
 * Dormand-Prince 5(4): J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6 (1980).
 * Steps go on with the solution of fifth order; the dense output is that of L. F. Shampine, Some practical Runge-Kutta formulas,
 * Math. Comp. 46 (1986).
 */
#include <math.h>

#include "fcsl/fcsl_math.h"
#include "integrate.h"

enum { STAGES = 6 };

static const double C[STAGES] = {0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0};
static const double A[STAGES][STAGES - 1] = {
    {0.0},
    {1.0 / 5.0},
    {3.0 / 40.0, 9.0 / 40.0},
    {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0},
    {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0},
    {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0},
};
static const double B[STAGES] = {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0};
/* Fifth order less fourth. */
static const double E[FCSL_SLOPES] = {71.0 / 57600.0,      0.0,          -71.0 / 16695.0, 71.0 / 1920.0,
                                      -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};
/* By stage, and by power of the part of the step, from the first one on. */
static const double P[FCSL_SLOPES][4] = {
    {1.0, -8048581381.0 / 2820520608.0, 8663915743.0 / 2820520608.0, -12715105075.0 / 11282082432.0},
    {0.0, 0.0, 0.0, 0.0},
    {0.0, 131558114200.0 / 32700410799.0, -68118460800.0 / 10900136933.0, 87487479700.0 / 32700410799.0},
    {0.0, -1754552775.0 / 470086768.0, 14199869525.0 / 1410260304.0, -10690763975.0 / 1880347072.0},
    {0.0, 127303824393.0 / 49829197408.0, -318862633887.0 / 49829197408.0, 701980252875.0 / 199316789632.0},
    {0.0, -282668133.0 / 205662961.0, 2019193451.0 / 616988883.0, -1453857185.0 / 822651844.0},
    {0.0, 40617522.0 / 29380423.0, -110615467.0 / 29380423.0, 69997945.0 / 29380423.0},
};

static const double SAFETY = 0.9;
static const double FACTOR_MIN = 0.2;
static const double FACTOR_MAX = 5.0;
static const double ORDER = 5.0;

/* x0 + h * (c[0]*k[0] + c[1]*k[1] + ...), summed from the left. */
static void combine(const fcsl_integrator_t *at, double h, const double *coefficients, uint32_t count, const double *x0,
                    double *x)
{
    for (uint32_t i = 0; i < at->n; i++) {
        double sum = coefficients[0] * at->k[0][i];
        for (uint32_t s = 1; s < count; s++) {
            sum = sum + coefficients[s] * at->k[s][i];
        }
        x[i] = x0[i] + h * sum;
    }
}

static double tolerance(double atol, double rtol, double x0, double x1)
{
    const double a = fabs(x0);
    const double b = fabs(x1);
    return atol + rtol * (a > b ? a : b);
}

double fcsl_rk45_step(fcsl_integrator_t *integrator, double t, double h, const double *x0, double *x1,
                      const double *atol, double rtol, uint32_t *worst)
{
    fcsl_integrator_find_slope(integrator, t, x0);
    for (uint32_t s = 1; s < STAGES; s++) {
        combine(integrator, h, A[s], s, x0, integrator->stage);
        integrator->slope(integrator->context, t + C[s] * h, integrator->stage, integrator->k[s]);
    }
    combine(integrator, h, B, STAGES, x0, x1);
    integrator->slope(integrator->context, t + h, x1, integrator->k[STAGES]);
    double largest = 0.0;
    *worst = 0;
    for (uint32_t i = 0; i < integrator->n; i++) {
        double sum = E[0] * integrator->k[0][i];
        for (uint32_t s = 1; s < FCSL_SLOPES; s++) {
            sum = sum + E[s] * integrator->k[s][i];
        }
        const double error = fabs(h * sum) / tolerance(atol[i], rtol, x0[i], x1[i]);
        if (!(error <= largest)) { /* also when it is not a number */
            largest = error;
            *worst = i;
        }
        if (isnan(error)) {
            return error;
        }
    }
    return largest;
}

void fcsl_rk45_interpolate(const fcsl_integrator_t *integrator, double h, double part, const double *x0, double *x)
{
    double weight[FCSL_SLOPES];
    for (uint32_t s = 0; s < FCSL_SLOPES; s++) {
        weight[s] = part * (P[s][0] + part * (P[s][1] + part * (P[s][2] + part * P[s][3])));
    }
    combine(integrator, h, weight, FCSL_SLOPES, x0, x);
}

double fcsl_rk45_factor(double error)
{
    if (error == 0.0) {
        return FACTOR_MAX;
    }
    const double factor = SAFETY * cr_pow(error, -1.0 / ORDER);
    return factor < FACTOR_MIN || isnan(factor) ? FACTOR_MIN : factor > FACTOR_MAX ? FACTOR_MAX : factor;
}

/* The largest value in units of tolerance at x0. */
static double norm(const double *x0, const double *values, uint32_t n, const double *atol, double rtol)
{
    double largest = 0.0;
    for (uint32_t i = 0; i < n; i++) {
        const double value = fabs(values[i]) / tolerance(atol[i], rtol, x0[i], x0[i]);
        largest = value > largest ? value : largest;
    }
    return largest;
}

double fcsl_rk45_first_step(fcsl_integrator_t *integrator, double t, const double *x0, const double *atol, double rtol,
                            double limit)
{
    const uint32_t n = integrator->n;
    double *k = integrator->k[1];
    fcsl_integrator_find_slope(integrator, t, x0);
    const double d0 = norm(x0, x0, n, atol, rtol);
    const double d1 = norm(x0, integrator->k[0], n, atol, rtol);
    double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h0 = h0 < limit ? h0 : limit;
    combine(integrator, h0, &(const double){1.0}, 1, x0, integrator->stage);
    integrator->slope(integrator->context, t + h0, integrator->stage, k);
    for (uint32_t i = 0; i < n; i++) {
        k[i] = k[i] - integrator->k[0][i];
    }
    const double d2 = norm(x0, k, n, atol, rtol) / h0;
    const double largest = d1 > d2 ? d1 : d2;
    const double slow = 1e-3 * h0 > 1e-6 ? 1e-3 * h0 : 1e-6;
    const double h1 = largest <= 1e-15 ? slow : cr_pow(0.01 / largest, 1.0 / ORDER);
    const double h = 100.0 * h0 < h1 ? 100.0 * h0 : h1;
    return h < limit ? h : limit;
}
