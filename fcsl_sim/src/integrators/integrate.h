/* SPDX-License-Identifier: Apache-2.0
 *
 * Integrators of an ordinary differential equation dx/dt = f(t, x). The order of operations is fixed and compiled without
 * contraction, so that a step has the same bits on every target.
 */
#ifndef FCSL_SIM_INTEGRATE_H
#define FCSL_SIM_INTEGRATE_H

#include <stddef.h>
#include <stdint.h>

typedef enum {
    FCSL_EULER = 0,
    FCSL_RK2 = 1, /* midpoint */
    FCSL_RK4 = 2, /* classical */
    FCSL_AB4 = 3, /* Adams-Bashforth, started with RK4 */
    FCSL_VERLET = 4, /* velocity Verlet */
    FCSL_RK45 = 5, /* Dormand-Prince, adaptive */
    FCSL_METHODS = 6
} fcsl_method_t;

/* Derivatives of an integrator: stages of the present step, or those that AB4 keeps. */
#define FCSL_SLOPES 7u

/* f(t, x) of `context`; x and dx hold n doubles and do not overlap. */
typedef void (*fcsl_slope_t)(void *context, double t, const double *x, double *dx);

typedef struct {
    fcsl_slope_t slope;
    void *context;
    fcsl_method_t method;
    uint32_t n;
    double *stage; /* a vector */
    const uint32_t *blocks; /* Verlet: the states come in blocks, of as many positions and then their velocities */
    uint32_t block_count;
    double *k[FCSL_SLOPES]; /* vectors; k[0] is f at the beginning of the step */
    /* Carried from step to step, until fcsl_integrator_restart. */
    uint8_t has_slope; /* k[0] is known */
    uint8_t kept; /* AB4: k[1..kept] are those of the last steps, newest first */
} fcsl_integrator_t;

/* Vectors are computed in pairs: they have room for an even number of doubles, with a zero behind an odd n. */
static inline size_t fcsl_vector_room(uint32_t n)
{
    return (size_t)n + n % 2u;
}

/* Doubles that fcsl_integrator_init takes from `memory`. */
size_t fcsl_integrator_memory(uint32_t n);
void fcsl_integrator_init(fcsl_integrator_t *integrator, fcsl_method_t method, uint32_t n, fcsl_slope_t slope,
                          void *context, double *memory);

/* Forgets what was carried over: after a jump of a state or an input. */
void fcsl_integrator_restart(fcsl_integrator_t *integrator);
/* The derivative at the present, where the step before has not left it. */
static inline void fcsl_integrator_find_slope(fcsl_integrator_t *integrator, double t, const double *x0)
{
    if (!integrator->has_slope) {
        integrator->slope(integrator->context, t, x0, integrator->k[0]);
        integrator->has_slope = 1;
    }
}

/* x1 from x0 at t, h seconds later, by a method of fixed steps; two vectors. Any number of steps may be tried from one x0, with
 * other h; AB4 uses its history for a `regular` one only, whose size is that of the steps before, and RK4 else. */
void fcsl_integrator_step(fcsl_integrator_t *integrator, double t, double h, int regular, const double *x0, double *x1);
/* The last step tried counts: x1 is the x0 of the next one. */
void fcsl_integrator_accept(fcsl_integrator_t *integrator, int regular);

/* RK45: x1 and, as the result, the largest error of a state in units of its tolerance
 * atol[i] + rtol * max(|x0[i]|, |x1[i]|); NaN if a state is. *worst is the number of that state. */
double fcsl_rk45_step(fcsl_integrator_t *integrator, double t, double h, const double *x0, double *x1,
                      const double *atol, double rtol, uint32_t *worst);
/* Within the last step tried: the states at `part` of it, 0 to 1; a polynomial of fourth degree. */
void fcsl_rk45_interpolate(const fcsl_integrator_t *integrator, double h, double part, const double *x0, double *x);
/* The step to try first (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, II.4), at most `limit`. */
double fcsl_rk45_first_step(fcsl_integrator_t *integrator, double t, const double *x0, const double *atol, double rtol,
                            double limit);
/* The factor by which the step changes after an error in units of the tolerance. */
double fcsl_rk45_factor(double error);

#endif /* FCSL_SIM_INTEGRATE_H */
