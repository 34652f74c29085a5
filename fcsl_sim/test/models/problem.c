/* SPDX-License-Identifier: Apache-2.0
 *
 * Problems with known solutions, to measure integrators; PROBLEM selects one. The state is x[0..N).
 */
#include "fcsl/fcsl_math.h"
#include "fcsl/fcsl_model.h"

#if PROBLEM == 0 /* harmonic oscillator: positions, velocities */
enum { N = 2, SECOND_ORDER = 1 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    (void)t;
    dx[0] = x[1];
    dx[1] = -p[0] * x[0];
}
#elif PROBLEM == 1 /* Kepler, mu = 1 */
enum { N = 4, SECOND_ORDER = 1 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    const double r2 = x[0] * x[0] + x[1] * x[1];
    const double r3 = r2 * sqrt(r2);
    (void)t, (void)p;
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = -x[0] / r3;
    dx[3] = -x[1] / r3;
}
#elif PROBLEM == 2 /* Arenstorf: restricted three-body problem, Hairer, Norsett, Wanner I, (II.0.1) */
enum { N = 4, SECOND_ORDER = 0 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    const double mu = 0.012277471;
    const double nu = 1.0 - mu;
    const double a = (x[0] + mu) * (x[0] + mu) + x[1] * x[1];
    const double b = (x[0] - nu) * (x[0] - nu) + x[1] * x[1];
    const double d1 = a * sqrt(a);
    const double d2 = b * sqrt(b);
    (void)t, (void)p;
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = x[0] + 2.0 * x[3] - nu * (x[0] + mu) / d1 - mu * (x[0] - nu) / d2;
    dx[3] = x[1] - 2.0 * x[2] - nu * x[1] / d1 - mu * x[1] / d2;
}
#elif PROBLEM == 3 /* Pleiades: seven stars in a plane, masses 1..7, Hairer, Norsett, Wanner I, (II.10) */
enum { N = 28, SECOND_ORDER = 1 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    (void)t, (void)p;
    for (int i = 0; i < 7; i++) {
        double ax = 0.0;
        double ay = 0.0;
        for (int j = 0; j < 7; j++) {
            const double rx = x[j] - x[i];
            const double ry = x[7 + j] - x[7 + i];
            const double r2 = rx * rx + ry * ry;
            if (i != j) {
                ax += (j + 1.0) * rx / (r2 * sqrt(r2));
                ay += (j + 1.0) * ry / (r2 * sqrt(r2));
            }
        }
        dx[i] = x[14 + i];
        dx[7 + i] = x[21 + i];
        dx[14 + i] = ax;
        dx[21 + i] = ay;
    }
}
#elif PROBLEM == 4 /* van der Pol, mu = p[0] */
enum { N = 2, SECOND_ORDER = 0 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    (void)t;
    dx[0] = x[1];
    dx[1] = p[0] * (1.0 - x[0] * x[0]) * x[1] - x[0];
}
#elif PROBLEM == 5 /* DETEST A: the five scalar problems A1..A5, Hull et al., SIAM J. Numer. Anal. 9 (1972) */
enum { N = 5, SECOND_ORDER = 0 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    (void)p;
    dx[0] = -x[0];
    dx[1] = -x[1] * x[1] * x[1] / 2.0;
    dx[2] = x[2] * cr_cos(t);
    dx[3] = x[3] / 4.0 * (1.0 - x[3] / 20.0);
    dx[4] = (x[4] - t) / (x[4] + t);
}
#elif PROBLEM == 6 /* DETEST B2 and B5: a linear chemical reaction, Euler's equations of a rigid body */
enum { N = 6, SECOND_ORDER = 0 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    (void)t, (void)p;
    dx[0] = -x[0] + x[1];
    dx[1] = x[0] - 2.0 * x[1] + x[2];
    dx[2] = x[1] - x[2];
    dx[3] = x[4] * x[5];
    dx[4] = -x[3] * x[5];
    dx[5] = -0.51 * x[3] * x[4];
}
#elif PROBLEM == 7 /* DETEST B1, B3, B4: two populations, a nonlinear reaction, a line around a torus */
enum { N = 8, SECOND_ORDER = 0 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    const double r = sqrt(x[5] * x[5] + x[6] * x[6]);
    (void)t, (void)p;
    dx[0] = 2.0 * (x[0] - x[0] * x[1]);
    dx[1] = -(x[1] - x[0] * x[1]);
    dx[2] = -x[2];
    dx[3] = x[2] - x[3] * x[3];
    dx[4] = x[3] * x[3];
    dx[5] = -x[6] - x[5] * x[7] / r;
    dx[6] = x[5] - x[6] * x[7] / r;
    dx[7] = x[5] / r;
}
#elif PROBLEM == 8 /* a damped oscillator, which is not what `second_order` promises */
enum { N = 2, SECOND_ORDER = 1 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    (void)t;
    dx[0] = x[1];
    dx[1] = -x[0] - p[0] * x[1];
}
#elif PROBLEM == 9 /* a velocity that is half the derivative of its position */
enum { N = 2, SECOND_ORDER = 1 };
static void slope(double t, const double *x, const double *p, double *dx)
{
    (void)t, (void)p;
    dx[0] = 2.0 * x[1];
    dx[1] = -x[0];
}
#endif

typedef struct {
    struct {
        double p[1], x[N];
    } parameters;
    struct {
        double x[N];
    } state;
    struct {
        double x[N];
    } outputs;
} problem_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    problem_t *problem = self;
    (void)context;
    for (int i = 0; i < N; i++) {
        problem->state.x[i] = problem->parameters.x[i];
    }
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    slope(t, x, ((const problem_t *)self)->parameters.p, dx);
}

static void output(void *self, double t, const double *x)
{
    problem_t *problem = self;
    (void)t;
    for (int i = 0; i < N; i++) {
        problem->outputs.x[i] = x[i];
    }
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(problem_t, FCSL_ROLE_PARAMETER, parameters.p, "", ""),
    FCSL_MODEL_VECTOR(problem_t, FCSL_ROLE_PARAMETER, parameters.x, "", "at the start"),
    FCSL_MODEL_VECTOR(problem_t, FCSL_ROLE_STATE, state.x, "", ""),
    FCSL_MODEL_VECTOR(problem_t, FCSL_ROLE_OUTPUT, outputs.x, "", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "problem",
    .doc = "a problem with a known solution",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(problem_t),
    .align = _Alignof(problem_t),
    .continuous_offset = offsetof(problem_t, state.x),
    .continuous_count = N,
    .is_second_order = SECOND_ORDER,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
