/* SPDX-License-Identifier: Apache-2.0
 *
 * What acts on the cart of an inverted pendulum: its motor, a push, and the buffers at the ends of its rail.
 *
 *   motor' = (sat(command) - motor) / time_constant                 sat: within +- force_limit
 *   d      = |s| - rail_half_length, outwards
 *   buffer = -sign(s) max(0, stiffness d + damping d')  where d > 0, else 0
 *   force  = motor + push + buffer
 *
 * Source: the buffer is the contact of K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping
 * in vibroimpact (1975), in its linear (Kelvin-Voigt) form, which only pushes.
 *
 * Limits: no dry friction; the motor's force does not depend on its speed.
 */
#include <math.h>

#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double command;
        double push;
        double position;
        double speed;
    } inputs;
    struct {
        double force_limit;
        double time_constant;
        double rail_half_length;
        double buffer_stiffness;
        double buffer_damping;
    } parameters;
    struct {
        double motor_force; /* integrated */
    } state;
    struct {
        double force;
        double motor_force;
        double buffer_force;
    } outputs;
} cart_drive_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const cart_drive_t *drive = self;
    (void)context;
    if (!(drive->parameters.force_limit >= 0.0)) {
        return "parameters.force_limit must not be negative";
    }
    if (!(drive->parameters.time_constant > 0.0)) {
        return "parameters.time_constant must be positive";
    }
    if (!(drive->parameters.rail_half_length > 0.0)) {
        return "parameters.rail_half_length must be positive";
    }
    if (!(drive->parameters.buffer_stiffness >= 0.0)) {
        return "parameters.buffer_stiffness must not be negative";
    }
    if (!(drive->parameters.buffer_damping >= 0.0)) {
        return "parameters.buffer_damping must not be negative";
    }
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const cart_drive_t *drive = self;
    (void)t;
    const double limit = drive->parameters.force_limit;
    const double command = fmax(-limit, fmin(limit, drive->inputs.command));
    dx[0] = (command - x[0]) / drive->parameters.time_constant;
}

static double buffer_force(const cart_drive_t *drive)
{
    const double side = drive->inputs.position < 0.0 ? -1.0 : 1.0;
    const double depth = side * drive->inputs.position - drive->parameters.rail_half_length;
    const double push =
        drive->parameters.buffer_stiffness * depth + drive->parameters.buffer_damping * side * drive->inputs.speed;
    return depth > 0.0 ? -side * fmax(push, 0.0) : 0.0;
}

static void output(void *self, double t, const double *x)
{
    cart_drive_t *drive = self;
    (void)t;
    drive->outputs.motor_force = x[0];
    drive->outputs.buffer_force = buffer_force(drive);
    drive->outputs.force = x[0] + drive->inputs.push + drive->outputs.buffer_force;
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(cart_drive_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.command, "N", "force that is asked of the motor"),
    FIELD(OPTIONAL_INPUT, inputs.push, "N", "of anything else on the cart"),
    FIELD(INPUT, inputs.position, "m", "of the cart, from the middle of the rail"),
    FIELD(INPUT, inputs.speed, "m/s", "of the cart"),
    FIELD(PARAMETER, parameters.force_limit, "N", "of the motor"),
    FIELD(PARAMETER, parameters.time_constant, "s", "of the motor's current"),
    FIELD(PARAMETER, parameters.rail_half_length, "m", "from the middle to a buffer"),
    FIELD(PARAMETER, parameters.buffer_stiffness, "N/m", ""),
    FIELD(PARAMETER, parameters.buffer_damping, "N*s/m", ""),
    FIELD(STATE, state.motor_force, "N", ""),
    FIELD(FEEDTHROUGH, outputs.force, "N", "on the cart: motor, push and buffer"),
    FIELD(OUTPUT, outputs.motor_force, "N", ""),
    FIELD(FEEDTHROUGH, outputs.buffer_force, "N", "zero unless the cart has hit one"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "cart_drive",
    .doc = "the motor of a cart, a push on it, and the buffers at the ends of its rail",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(cart_drive_t),
    .align = _Alignof(cart_drive_t),
    .continuous_offset = offsetof(cart_drive_t, state),
    .continuous_count = 1,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
