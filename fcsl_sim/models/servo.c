/* SPDX-License-Identifier: Apache-2.0
 *
 * A position servo: a second-order lag with limits of rate and position, and backlash between its motor and its output.
 * The motor's side has the angle a and the rate v:
 *
 *   c = command within [min_angle, max_angle]
 *   a' = v,  v' = w^2 (c - a) - 2 damping w v,  w = natural_frequency
 *   |v| <= max_rate: v' = 0 while it would exceed it
 *   a within [min_angle, max_angle]: v = 0 when it reaches an end, a stop without rebound
 *
 * The output is the play operator of width b = backlash: it follows a - b/2 while the motor pushes it up, a + b/2 while
 * it pushes it down, and rests in between. Events find the instants at which this changes.
 *
 * Source: the lag: any text on control; the play: M. Brokate, J. Sprekels, Hysteresis and Phase Transitions (1996),
 * section 2.1.
 *
 * Limits: no load acts on the servo; what it moves has no inertia, so it rests in the backlash. No dead band, no
 * quantization, no delay.
 */
#include <stdbool.h>

#include "clamp.h"
#include "fcsl/fcsl_model.h"

enum { ANGLE, RATE, CONTINUOUS_STATES };
enum { STOP, RATE_LIMIT, RATE_RELEASE, ENGAGE, REVERSE, EVENTS };

typedef struct {
    struct {
        double command;
    } inputs;
    struct {
        double natural_frequency;
        double damping;
        double max_rate;
        double min_angle;
        double max_angle;
        double backlash;
        double angle;
    } parameters;
    struct {
        double angle; /* this and the next one are integrated */
        double rate;
        double resting_angle;
        int32_t limited; /* 1, -1: the rate is at its upper, lower limit */
        int32_t engaged; /* 1, -1: the motor pushes the output up, down */
    } state;
    struct {
        double angle;
        double rate;
    } outputs;
} servo_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    servo_t *servo = self;
    (void)context;
    if (!(servo->parameters.natural_frequency > 0.0)) {
        return "parameters.natural_frequency must be positive";
    }
    if (!(servo->parameters.damping >= 0.0)) {
        return "parameters.damping must not be negative";
    }
    if (!(servo->parameters.max_rate > 0.0)) {
        return "parameters.max_rate must be positive";
    }
    if (!(servo->parameters.min_angle < servo->parameters.max_angle)) {
        return "parameters.min_angle must be below max_angle";
    }
    if (!(servo->parameters.backlash >= 0.0)) {
        return "parameters.backlash must not be negative";
    }
    if (!(servo->parameters.angle >= servo->parameters.min_angle) ||
        !(servo->parameters.angle <= servo->parameters.max_angle)) {
        return "parameters.angle must be from min_angle to max_angle";
    }
    servo->state.angle = servo->parameters.angle;
    servo->state.resting_angle = servo->parameters.angle;
    return NULL;
}

/* Without the limit of rate. */
static double acceleration_of(const servo_t *servo, const double *x)
{
    const double w = servo->parameters.natural_frequency;
    const double command = clamp(servo->inputs.command, servo->parameters.min_angle, servo->parameters.max_angle);
    return w * (w * (command - x[ANGLE]) - 2.0 * servo->parameters.damping * x[RATE]);
}

static bool is_resting(const servo_t *servo)
{
    return servo->parameters.backlash > 0.0 && servo->state.engaged == 0;
}

static double pushed_angle(const servo_t *servo, double angle, double engaged)
{
    return angle - engaged * (0.5 * servo->parameters.backlash);
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const servo_t *servo = self;
    (void)t;
    dx[ANGLE] = x[RATE];
    dx[RATE] = servo->state.limited != 0 ? 0.0 : acceleration_of(servo, x);
}

static void output(void *self, double t, const double *x)
{
    servo_t *servo = self;
    (void)t;
    const bool rests = is_resting(servo);
    servo->outputs.angle =
        rests ? servo->state.resting_angle : pushed_angle(servo, x[ANGLE], (double)servo->state.engaged);
    servo->outputs.rate = rests ? 0.0 : x[RATE];
}

static void event(const void *self, double t, const double *x, double *value)
{
    const servo_t *servo = self;
    (void)t;
    value[STOP] = fmin(servo->parameters.max_angle - x[ANGLE], x[ANGLE] - servo->parameters.min_angle);
    value[RATE_LIMIT] = servo->state.limited == 0 ? servo->parameters.max_rate - fabs(x[RATE]) : 1.0;
    value[RATE_RELEASE] = servo->state.limited != 0 ? (double)servo->state.limited * acceleration_of(servo, x) : 1.0;
    /* At a reversal the gap is exactly 0: `resting_angle` is the same expression of the same angle. */
    const double above = servo->state.resting_angle - pushed_angle(servo, x[ANGLE], 1.0);
    const double below = pushed_angle(servo, x[ANGLE], -1.0) - servo->state.resting_angle;
    value[ENGAGE] = is_resting(servo) ? fmin(above, below) : 1.0;
    value[REVERSE] = servo->state.engaged != 0 ? (double)servo->state.engaged * x[RATE] : 1.0;
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    servo_t *servo = self;
    (void)context;
    if (number == STOP) {
        servo->state.angle = clamp(servo->state.angle, servo->parameters.min_angle, servo->parameters.max_angle);
        servo->state.rate = 0.0;
        servo->state.limited = 0;
    } else if (number == RATE_LIMIT) {
        const bool exceeds = fabs(servo->state.rate) >= servo->parameters.max_rate; /* no stop at the same instant */
        servo->state.limited = !exceeds ? 0 : servo->state.rate < 0.0 ? -1 : 1;
        servo->state.rate = clamp(servo->state.rate, -servo->parameters.max_rate, servo->parameters.max_rate);
    } else if (number == RATE_RELEASE) {
        servo->state.limited = 0;
    } else if (number == ENGAGE) {
        servo->state.engaged = servo->state.angle > servo->state.resting_angle ? 1 : -1;
    } else {
        servo->state.resting_angle = pushed_angle(servo, servo->state.angle, (double)servo->state.engaged);
        servo->state.engaged = 0;
    }
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(servo_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.command, "rad", ""),
    SCALAR(PARAMETER, parameters.natural_frequency, "rad/s", ""),
    SCALAR(PARAMETER, parameters.damping, "", "damping ratio"),
    SCALAR(PARAMETER, parameters.max_rate, "rad/s", ""),
    SCALAR(PARAMETER, parameters.min_angle, "rad", ""),
    SCALAR(PARAMETER, parameters.max_angle, "rad", ""),
    SCALAR(OPTIONAL_PARAMETER, parameters.backlash, "rad", "the whole width; 0: none"),
    SCALAR(OPTIONAL_PARAMETER, parameters.angle, "rad", "at the start, in the middle of the backlash"),
    SCALAR(STATE, state.angle, "rad", "of the motor"),
    SCALAR(STATE, state.rate, "rad/s", "of the motor"),
    SCALAR(STATE, state.resting_angle, "rad", "of the output, while the motor is in the backlash"),
    SCALAR(STATE, state.limited, "", "1, -1: the rate is at its upper, lower limit"),
    SCALAR(STATE, state.engaged, "", "1, -1: the motor pushes the output up, down"),
    SCALAR(OUTPUT, outputs.angle, "rad", "behind the backlash"),
    SCALAR(OUTPUT, outputs.rate, "rad/s", "behind the backlash"),
};

static const fcsl_model_event_t events[EVENTS] = {
    [STOP] = {"stop", FCSL_FALLING, "the motor reaches the end of its travel"},
    [RATE_LIMIT] = {"rate_limit", FCSL_FALLING, "the rate reaches its limit"},
    [RATE_RELEASE] = {"rate_release", FCSL_FALLING, "the motor slows down from its limit"},
    [ENGAGE] = {"engage", FCSL_FALLING, "the motor begins to push the output"},
    [REVERSE] = {"reverse", FCSL_FALLING, "the motor turns back into the backlash"},
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "servo",
    .doc = "a position servo with limits of rate and position, and backlash",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(servo_t),
    .align = _Alignof(servo_t),
    .continuous_offset = offsetof(servo_t, state.angle),
    .continuous_count = CONTINUOUS_STATES,
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
