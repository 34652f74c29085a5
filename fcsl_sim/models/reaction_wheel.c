/* SPDX-License-Identifier: Apache-2.0
 *
 * A reaction wheel with friction and limits of torque and speed. With the unit vector a of its axis:
 *
 *   motor = torque_command within [-max_torque, max_torque]
 *   torque = motor - viscous_friction speed - coulomb_friction sign(speed)
 *   inertia speed' = torque,  h = inertia speed a
 *   torque_body = -torque a - rate x h
 *
 * So the angular momentum of body and wheel together, I w + h, is conserved. At rest the wheel sticks: torque is 0
 * while |motor| <= coulomb_friction. At max_speed its drive gives no more than friction takes: torque is 0 until the
 * command slows the wheel down. Events find the instants at which it stops, breaks away, reaches the limit, leaves it.
 *
 * Source: F. L. Markley, J. L. Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014),
 * chapters 3 and 4.
 *
 * Limits: the speed is that in the inertial frame along the axis; it differs from that in the body by rate . a. No
 * imbalance, no ripple, no electrical limits, no lag behind the command.
 */
#include <stdbool.h>

#include "clamp.h"
#include "fcsl/fcsl_model.h"
#include "vectors.h"

enum { STOPS, BREAKS_AWAY, REACHES_LIMIT, LEAVES_LIMIT, EVENTS };

typedef struct {
    struct {
        double torque_command;
        double rate_body[3];
    } inputs;
    struct {
        double axis_body[3];
        double inertia;
        double max_torque;
        double max_speed;
        double viscous_friction;
        double coulomb_friction;
        double speed;
    } parameters;
    struct {
        double speed; /* integrated */
        int32_t direction;
        bool saturated;
    } state;
    struct {
        double torque_body[3];
        double speed;
        double momentum;
        bool saturated;
    } outputs;
} reaction_wheel_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    reaction_wheel_t *wheel = self;
    (void)context;
    if (!(vector_norm(wheel->parameters.axis_body) > 0.0)) {
        return "parameters.axis_body must not be zero";
    }
    if (!(wheel->parameters.inertia > 0.0)) {
        return "parameters.inertia must be positive";
    }
    if (!(wheel->parameters.max_torque >= 0.0)) {
        return "parameters.max_torque must not be negative";
    }
    if (!(wheel->parameters.max_speed > 0.0)) {
        return "parameters.max_speed must be positive";
    }
    if (!(wheel->parameters.viscous_friction >= 0.0)) {
        return "parameters.viscous_friction must not be negative";
    }
    if (!(wheel->parameters.coulomb_friction >= 0.0)) {
        return "parameters.coulomb_friction must not be negative";
    }
    if (!(fabs(wheel->parameters.speed) <= wheel->parameters.max_speed)) {
        return "parameters.speed must be within max_speed";
    }
    wheel->state.speed = wheel->parameters.speed;
    wheel->state.direction = (wheel->parameters.speed > 0.0) - (wheel->parameters.speed < 0.0);
    return NULL;
}

static double motor_of(const reaction_wheel_t *wheel)
{
    return clamp(wheel->inputs.torque_command, -wheel->parameters.max_torque, wheel->parameters.max_torque);
}

/* In which the wheel slides, or begins to; 0: it sticks. */
static double direction_of(const reaction_wheel_t *wheel)
{
    const double motor = motor_of(wheel);
    if (wheel->state.direction != 0) {
        return (double)wheel->state.direction;
    }
    return fabs(motor) <= wheel->parameters.coulomb_friction ? 0.0 : motor < 0.0 ? -1.0 : 1.0;
}

/* Without the limit of speed. */
static double sliding_torque(const reaction_wheel_t *wheel, double speed)
{
    return motor_of(wheel) - wheel->parameters.viscous_friction * speed -
           wheel->parameters.coulomb_friction * direction_of(wheel);
}

static double torque_of(const reaction_wheel_t *wheel, double speed)
{
    return wheel->state.saturated || direction_of(wheel) == 0.0 ? 0.0 : sliding_torque(wheel, speed);
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const reaction_wheel_t *wheel = self;
    (void)t;
    dx[0] = torque_of(wheel, x[0]) / wheel->parameters.inertia;
}

static void output(void *self, double t, const double *x)
{
    reaction_wheel_t *wheel = self;
    (void)t;
    const double torque = torque_of(wheel, x[0]);
    const double momentum = wheel->parameters.inertia * x[0];
    const double length = vector_norm(wheel->parameters.axis_body);
    double axis[3], turned[3];
    for (int i = 0; i < 3; i++) {
        axis[i] = wheel->parameters.axis_body[i] / length;
    }
    vector_cross(wheel->inputs.rate_body, axis, turned);
    for (int i = 0; i < 3; i++) {
        wheel->outputs.torque_body[i] = -torque * axis[i] - momentum * turned[i];
    }
    wheel->outputs.speed = x[0];
    wheel->outputs.momentum = momentum;
    wheel->outputs.saturated = wheel->state.saturated;
}

static void event(const void *self, double t, const double *x, double *value)
{
    const reaction_wheel_t *wheel = self;
    const double forward = (double)wheel->state.direction;
    const bool is_free = wheel->state.direction != 0 && !wheel->state.saturated;
    const double excess = fabs(motor_of(wheel)) - wheel->parameters.coulomb_friction;
    (void)t;
    value[STOPS] = is_free ? forward * x[0] : 1.0;
    /* Above zero when it has moved, so that a command that is there from the beginning counts. */
    value[BREAKS_AWAY] = wheel->state.direction == 0 ? fmin(excess, fabs(x[0])) : -1.0;
    value[REACHES_LIMIT] = is_free ? wheel->parameters.max_speed - forward * x[0] : 1.0;
    value[LEAVES_LIMIT] = wheel->state.saturated ? forward * sliding_torque(wheel, x[0]) : 1.0;
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    reaction_wheel_t *wheel = self;
    (void)context;
    if (number == STOPS) { /* it breaks away at once, if the drive exceeds the friction */
        wheel->state.direction = 0;
        wheel->state.speed = 0.0;
    } else if (number == BREAKS_AWAY) {
        wheel->state.direction = wheel->state.speed < 0.0 ? -1 : 1;
    } else if (number == REACHES_LIMIT) {
        wheel->state.saturated = true;
        wheel->state.speed = (double)wheel->state.direction * wheel->parameters.max_speed;
    } else {
        wheel->state.saturated = false;
    }
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(reaction_wheel_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(reaction_wheel_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.torque_command, "N*m", "of the drive on the wheel"),
    VECTOR(OPTIONAL_INPUT, inputs.rate_body, "rad/s", ""),
    VECTOR(PARAMETER, parameters.axis_body, "", "of any length"),
    SCALAR(PARAMETER, parameters.inertia, "kg*m^2", "about the axis"),
    SCALAR(PARAMETER, parameters.max_torque, "N*m", "of the drive"),
    SCALAR(PARAMETER, parameters.max_speed, "rad/s", ""),
    SCALAR(PARAMETER, parameters.viscous_friction, "N*m*s/rad", ""),
    SCALAR(PARAMETER, parameters.coulomb_friction, "N*m", "also what it takes to break away"),
    SCALAR(PARAMETER, parameters.speed, "rad/s", "at the start"),
    SCALAR(STATE, state.speed, "rad/s", ""),
    SCALAR(STATE, state.direction, "", "in which it slides; 0: it sticks"),
    SCALAR(STATE, state.saturated, "", ""),
    VECTOR(FEEDTHROUGH, outputs.torque_body, "N*m", "on the body"),
    SCALAR(OUTPUT, outputs.speed, "rad/s", ""),
    SCALAR(OUTPUT, outputs.momentum, "N*m*s", "along the axis"),
    SCALAR(OUTPUT, outputs.saturated, "", "it is held at its maximum speed"),
};

static const fcsl_model_event_t events[EVENTS] = {
    [STOPS] = {"stops", FCSL_FALLING, "the speed reaches zero"},
    [BREAKS_AWAY] = {"breaks_away", FCSL_RISING, "the drive exceeds the friction at rest"},
    [REACHES_LIMIT] = {"reaches_limit", FCSL_FALLING, "the speed reaches its maximum"},
    [LEAVES_LIMIT] = {"leaves_limit", FCSL_FALLING, "the command slows it down"},
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "reaction_wheel",
    .doc = "a reaction wheel with friction and limits",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(reaction_wheel_t),
    .align = _Alignof(reaction_wheel_t),
    .continuous_offset = offsetof(reaction_wheel_t, state),
    .continuous_count = 1,
    .sampled_offset = FCSL_NO_OFFSET,
    .events = events,
    .event_count = EVENTS,
    .init = init,
    .derivative = derivative,
    .output = output,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
