/* SPDX-License-Identifier: Apache-2.0
 *
 * One step of an ordinary differential equation dx/dt = f(t, x). The order of operations is fixed and compiled without
 * contraction, so that a step has the same bits on every target.
 */
#ifndef FCSL_SIM_INTEGRATE_H
#define FCSL_SIM_INTEGRATE_H

#include <stdint.h>

typedef enum { FCSL_EULER = 0, FCSL_RK4 = 1 } fcsl_method_t;

/* dx/dt of `self` at t (s); x and dx hold n doubles and do not overlap. */
typedef void (*fcsl_derivative_t)(const void *self, double t, const double *x, double *dx);

/* Scratch that one step needs, in doubles per state. */
#define FCSL_INTEGRATE_SCRATCH 5

/* Advances x (n doubles) from t by h seconds. `scratch` holds FCSL_INTEGRATE_SCRATCH * n doubles.
 * The derivative gets copies of x only, so states inside `self` can be integrated in place. */
void fcsl_integrate(fcsl_method_t method, fcsl_derivative_t derivative, const void *self, double t, double h, double *x,
                    uint32_t n, double *scratch);

#endif /* FCSL_SIM_INTEGRATE_H */
