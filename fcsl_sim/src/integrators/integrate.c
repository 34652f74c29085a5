/* SPDX-License-Identifier: Apache-2.0
 *
 * Methods of fixed steps: Euler, midpoint, Runge-Kutta, Adams-Bashforth, velocity Verlet.
 */
#include "integrate.h"

#include <string.h>

enum { AB4_KEPT = 3 };

size_t fcsl_integrator_memory(uint32_t n)
{
    return (FCSL_SLOPES + 1u) * fcsl_vector_room(n);
}

void fcsl_integrator_init(fcsl_integrator_t *integrator, fcsl_method_t method, uint32_t n, fcsl_slope_t slope,
                          void *context, double *memory)
{
    *integrator = (fcsl_integrator_t){.slope = slope, .context = context, .method = method, .n = n, .stage = memory};
    for (uint32_t i = 0; i < FCSL_SLOPES; i++) {
        integrator->k[i] = memory + (i + 1u) * fcsl_vector_room(n);
    }
}

void fcsl_integrator_restart(fcsl_integrator_t *integrator)
{
    integrator->has_slope = 0;
    integrator->kept = 0;
}

/* x1 = x0 + h*k1: first order. */
static void step_euler(const fcsl_integrator_t *at, double h, const double *x0, double *x1)
{
    const double *k1 = at->k[0];
    for (uint32_t i = 0; i < at->n; i++) {
        x1[i] = x0[i] + h * k1[i];
    }
}

/* The midpoint method, second order: x1 = x0 + h*f(t + h/2, x0 + h/2*k1). */
static void step_rk2(const fcsl_integrator_t *at, double t, double h, const double *x0, double *x1)
{
    const double *k1 = at->k[0];
    double *k2 = at->k[1];
    const double half = 0.5 * h;
    for (uint32_t i = 0; i < at->n; i++) {
        at->stage[i] = x0[i] + half * k1[i];
    }
    at->slope(at->context, t + half, at->stage, k2);
    for (uint32_t i = 0; i < at->n; i++) {
        x1[i] = x0[i] + h * k2[i];
    }
}

/* Models write their derivatives one by one. A processor that loads two of them at once right after that waits until the writes
 * have left its store buffer, several times as long as the addition takes. So new ones are loaded one by one, too; what is made of
 * them is computed and stored in pairs. */
typedef double pair_t __attribute__((vector_size(16), aligned(8), may_alias));

static inline pair_t derivatives(const double *k)
{
    const volatile double *each = k;
    return (pair_t){each[0], each[1]};
}

static inline pair_t pair(const double *x)
{
    return *(const pair_t *)(const void *)x;
}

/* x = x0 + h*k, with new derivatives. */
static inline void go(uint32_t n, double h, const double *restrict x0, const double *restrict k, double *restrict x)
{
    for (uint32_t i = 0; i < n; i += 2u) {
        *(pair_t *)(void *)(x + i) = pair(x0 + i) + h * derivatives(k + i);
    }
}

/* The classical Runge-Kutta method, fourth order: x1 = x0 + h/6*(k1 + 2*k2 + 2*k3 + k4), summed from the left. Its stages are the
 * last three derivatives, so that AB4 keeps its own. */
static void step_rk4(const fcsl_integrator_t *at, double t, double h, const double *restrict x0, double *restrict x1)
{
    const uint32_t n = at->n;
    const double *restrict k1 = at->k[0];
    double *restrict k2 = at->k[4];
    double *restrict k3 = at->k[5];
    double *restrict k4 = at->k[6];
    double *restrict x = at->stage;
    const double half = 0.5 * h;
    go(n, half, x0, k1, x);
    at->slope(at->context, t + half, x, k2);
    go(n, half, x0, k2, x);
    at->slope(at->context, t + half, x, k3);
    go(n, h, x0, k3, x);
    at->slope(at->context, t + h, x, k4);
    const double sixth = h / 6.0;
    for (uint32_t i = 0; i < n; i += 2u) {
        const pair_t sum = ((pair(k1 + i) + 2.0 * pair(k2 + i)) + 2.0 * pair(k3 + i)) + derivatives(k4 + i);
        *(pair_t *)(void *)(x1 + i) = pair(x0 + i) + sixth * sum;
    }
}

/* Adams-Bashforth, fourth order: x1 = x0 + h/24*(55*k1 - 59*k2 + 37*k3 - 9*k4), with k2..k4 of the three steps before. */
static void step_ab4(const fcsl_integrator_t *at, double h, const double *x0, double *x1)
{
    const double *k1 = at->k[0];
    const double *k2 = at->k[1];
    const double *k3 = at->k[2];
    const double *k4 = at->k[3];
    const double part = h / 24.0;
    for (uint32_t i = 0; i < at->n; i++) {
        x1[i] = x0[i] + part * (((55.0 * k1[i] - 59.0 * k2[i]) + 37.0 * k3[i]) - 9.0 * k4[i]);
    }
}

/* Velocity Verlet, second order, symplectic: q1 = q + h*(v + h/2*a), v1 = v + h/2*(a + a1). The new accelerations are those of
 * the next step. */
static void step_verlet(const fcsl_integrator_t *at, double t, double h, const double *x0, double *x1)
{
    const double *k = at->k[0];
    double *next = at->k[1];
    const double half_h = 0.5 * h;
    for (uint32_t b = 0, q = 0; b < at->block_count; q += at->blocks[b++]) {
        const uint32_t half = at->blocks[b] / 2u;
        for (uint32_t i = q; i < q + half; i++) {
            x1[i] = x0[i] + h * (x0[half + i] + half_h * k[half + i]);
            x1[half + i] = x0[half + i];
        }
    }
    at->slope(at->context, t + h, x1, next);
    for (uint32_t b = 0, q = 0; b < at->block_count; q += at->blocks[b++]) {
        const uint32_t half = at->blocks[b] / 2u;
        for (uint32_t i = q + half; i < q + 2u * half; i++) {
            x1[i] = x0[i] + half_h * (k[i] + next[i]);
        }
    }
}

void fcsl_integrator_step(fcsl_integrator_t *integrator, double t, double h, int regular, const double *x0, double *x1)
{
    fcsl_integrator_find_slope(integrator, t, x0);
    switch (integrator->method) {
    case FCSL_EULER:
        step_euler(integrator, h, x0, x1);
        break;
    case FCSL_RK2:
        step_rk2(integrator, t, h, x0, x1);
        break;
    case FCSL_VERLET:
        step_verlet(integrator, t, h, x0, x1);
        break;
    case FCSL_AB4:
        if (regular && integrator->kept == AB4_KEPT) {
            step_ab4(integrator, h, x0, x1);
            break;
        }
        step_rk4(integrator, t, h, x0, x1);
        break;
    default:
        step_rk4(integrator, t, h, x0, x1);
        break;
    }
}

static void keep_slope(fcsl_integrator_t *integrator)
{
    double *oldest = integrator->k[AB4_KEPT];
    for (uint32_t i = AB4_KEPT; i > 0; i--) {
        integrator->k[i] = integrator->k[i - 1u];
    }
    integrator->k[0] = oldest;
    integrator->kept = integrator->kept < AB4_KEPT ? integrator->kept + 1u : AB4_KEPT;
}

void fcsl_integrator_accept(fcsl_integrator_t *integrator, int regular)
{
    double *first = integrator->k[0];
    if (integrator->method == FCSL_VERLET) {
        integrator->k[0] = integrator->k[1];
        integrator->k[1] = first;
        return;
    }
    if (integrator->method == FCSL_RK45) { /* the last stage is the first one of the next step */
        integrator->k[0] = integrator->k[FCSL_SLOPES - 1u];
        integrator->k[FCSL_SLOPES - 1u] = first;
        return;
    }
    integrator->has_slope = 0;
    if (integrator->method == FCSL_AB4) {
        if (regular) {
            keep_slope(integrator);
        } else {
            integrator->kept = 0;
        }
    }
}
