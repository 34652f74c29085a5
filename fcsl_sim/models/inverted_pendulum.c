/* SPDX-License-Identifier: Apache-2.0
 *
 * A pole on a cart that a force pushes along a level rail: the inverted pendulum.
 *
 * s is the position of the cart, a the angle of the pole from upright, positive towards +s; pi is hanging. With the
 * masses M and m, the distance l from the pivot to the centre of mass of the pole, its inertia I about that, and
 * viscous friction b, c
 *
 *   (M + m) s'' + m l (a'' cos a - a'^2 sin a) = F - b s'
 *   (I + m l^2) a'' + m l s'' cos a            = m g l sin a - c a'
 *
 * Source: K. J. Astrom, R. M. Murray, Feedback Systems, 2nd ed. (2021), chapter 3, balance systems; their angle is
 * positive to the other side.
 *
 * Limits: the rail has no end, the cart no dry friction; the angle is not wrapped.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double force;
    } inputs;
    struct {
        double cart_mass, pole_mass, pole_length, pole_inertia;
        double cart_friction, pivot_friction;
        double gravity;
        double position, angle;
    } parameters;
    struct {
        double position, angle, speed, angle_rate;
    } state;
    struct {
        double position, angle, speed, angle_rate;
    } outputs;
} inverted_pendulum_t;

enum { STATES = 4, POSITION = 0, ANGLE, SPEED, ANGLE_RATE };

static const char *init(void *self, const fcsl_model_context_t *context)
{
    inverted_pendulum_t *pendulum = self;
    (void)context;
    if (!(pendulum->parameters.cart_mass > 0.0)) {
        return "parameters.cart_mass must be positive";
    }
    if (!(pendulum->parameters.pole_mass > 0.0)) {
        return "parameters.pole_mass must be positive";
    }
    if (!(pendulum->parameters.pole_length > 0.0)) {
        return "parameters.pole_length must be positive";
    }
    if (!(pendulum->parameters.pole_inertia >= 0.0)) {
        return "parameters.pole_inertia must not be negative";
    }
    if (!(pendulum->parameters.cart_friction >= 0.0)) {
        return "parameters.cart_friction must not be negative";
    }
    if (!(pendulum->parameters.pivot_friction >= 0.0)) {
        return "parameters.pivot_friction must not be negative";
    }
    pendulum->state.position = pendulum->parameters.position;
    pendulum->state.angle = pendulum->parameters.angle;
    pendulum->state.speed = 0.0;
    pendulum->state.angle_rate = 0.0;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const inverted_pendulum_t *pendulum = self;
    (void)t;
    const double sine = cr_sin(x[ANGLE]), cosine = cr_cos(x[ANGLE]);
    const double moment = pendulum->parameters.pole_mass * pendulum->parameters.pole_length;
    const double mass = pendulum->parameters.cart_mass + pendulum->parameters.pole_mass;
    const double inertia = pendulum->parameters.pole_inertia + moment * pendulum->parameters.pole_length;
    const double coupling = moment * cosine;
    const double force = pendulum->inputs.force - pendulum->parameters.cart_friction * x[SPEED] +
                         moment * x[ANGLE_RATE] * x[ANGLE_RATE] * sine;
    const double torque =
        moment * pendulum->parameters.gravity * sine - pendulum->parameters.pivot_friction * x[ANGLE_RATE];
    const double determinant = mass * inertia - coupling * coupling; /* positive, since mass > pole_mass */
    dx[POSITION] = x[SPEED];
    dx[ANGLE] = x[ANGLE_RATE];
    dx[SPEED] = (inertia * force - coupling * torque) / determinant;
    dx[ANGLE_RATE] = (mass * torque - coupling * force) / determinant;
}

static void output(void *self, double t, const double *x)
{
    inverted_pendulum_t *pendulum = self;
    (void)t;
    pendulum->outputs.position = x[POSITION];
    pendulum->outputs.angle = x[ANGLE];
    pendulum->outputs.speed = x[SPEED];
    pendulum->outputs.angle_rate = x[ANGLE_RATE];
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(inverted_pendulum_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.force, "N", "on the cart"),
    FIELD(PARAMETER, parameters.cart_mass, "kg", ""),
    FIELD(PARAMETER, parameters.pole_mass, "kg", ""),
    FIELD(PARAMETER, parameters.pole_length, "m", "from the pivot to the centre of mass"),
    FIELD(PARAMETER, parameters.pole_inertia, "kg*m^2", "about the centre of mass of the pole"),
    FIELD(PARAMETER, parameters.cart_friction, "N*s/m", "viscous"),
    FIELD(PARAMETER, parameters.pivot_friction, "N*m*s/rad", "viscous"),
    FIELD(PARAMETER, parameters.gravity, "m/s^2", ""),
    FIELD(PARAMETER, parameters.position, "m", "where it begins, at rest"),
    FIELD(PARAMETER, parameters.angle, "rad", "where it begins, at rest"),
    FIELD(STATE, state.position, "m", ""),
    FIELD(STATE, state.angle, "rad", ""),
    FIELD(STATE, state.speed, "m/s", ""),
    FIELD(STATE, state.angle_rate, "rad/s", ""),
    FIELD(OUTPUT, outputs.position, "m", "of the cart"),
    FIELD(OUTPUT, outputs.angle, "rad", "from upright, positive towards + position"),
    FIELD(OUTPUT, outputs.speed, "m/s", "of the cart"),
    FIELD(OUTPUT, outputs.angle_rate, "rad/s", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "inverted_pendulum",
    .doc = "a pole on a cart that a force pushes",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(inverted_pendulum_t),
    .align = _Alignof(inverted_pendulum_t),
    .continuous_offset = offsetof(inverted_pendulum_t, state),
    .continuous_count = STATES,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
