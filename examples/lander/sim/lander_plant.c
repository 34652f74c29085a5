/* SPDX-License-Identifier: Apache-2.0
 *
 * A lander that moves vertically, from the pad and back to the ground:
 *
 *   z' = v,    v' = thrust / m - g,    m' = -thrust / (isp * g0)
 *
 * The engine gives throttle * max_thrust between its limits; below min_thrust it is off, and so it is once the fuel has run
 * out. On the ground the vehicle stands still until its thrust exceeds its weight; the ground stops it at once.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

/* Standard gravity, m/s^2: part of the definition of specific impulse, on any planet. */
#define G0 9.80665

enum { POS_Z, VEL_Z, MASS, CONTINUOUS_STATES };
enum { TOUCHDOWN, LIFT_OFF, BURNOUT, EVENTS };

typedef struct {
    struct {
        double throttle;
    } inputs;
    struct {
        double dry_mass;
        double fuel_mass;
        double min_thrust;
        double max_thrust;
        double isp;
        double gravity;
        double pos_z;
        double vel_z;
    } parameters;
    struct { /* the first three are integrated */
        double pos_z;
        double vel_z;
        double mass;
        double touchdown_speed;
        bool empty;
        bool on_ground;
        bool flown;
    } state;
    struct {
        double pos_z;
        double vel_z;
        double mass;
        double thrust;
        bool landed;
        double touchdown_speed;
    } outputs;
} lander_t;

static double thrust_of(const lander_t *lander)
{
    const double throttle = lander->inputs.throttle;
    if (!(throttle > 0.0) || lander->state.empty) { /* also when the command is not a number */
        return 0.0;
    }
    const double thrust = (throttle < 1.0 ? throttle : 1.0) * lander->parameters.max_thrust;
    return thrust < lander->parameters.min_thrust ? 0.0 : thrust;
}

static double acceleration_of(const lander_t *lander, double mass)
{
    return thrust_of(lander) / mass - lander->parameters.gravity;
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    (void)context;
    lander_t *lander = self;
    if (!(lander->parameters.dry_mass > 0.0)) {
        return "parameters.dry_mass must be positive";
    }
    if (!(lander->parameters.fuel_mass >= 0.0)) {
        return "parameters.fuel_mass must not be negative";
    }
    if (!(lander->parameters.min_thrust >= 0.0) || !(lander->parameters.max_thrust >= lander->parameters.min_thrust)) {
        return "parameters.min_thrust and max_thrust must be 0 <= min_thrust <= max_thrust";
    }
    if (!(lander->parameters.isp > 0.0)) {
        return "parameters.isp must be positive";
    }
    if (!(lander->parameters.gravity >= 0.0)) {
        return "parameters.gravity must not be negative";
    }
    if (!(lander->parameters.pos_z >= 0.0)) {
        return "parameters.pos_z must not be below the ground";
    }
    lander->state.pos_z = lander->parameters.pos_z;
    lander->state.vel_z = lander->parameters.vel_z;
    lander->state.mass = lander->parameters.dry_mass + lander->parameters.fuel_mass;
    lander->state.empty = lander->parameters.fuel_mass == 0.0;
    lander->state.on_ground = lander->state.pos_z == 0.0 && lander->state.vel_z == 0.0;
    lander->state.flown = !lander->state.on_ground;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    (void)t;
    const lander_t *lander = self;
    dx[POS_Z] = lander->state.on_ground ? 0.0 : x[VEL_Z];
    dx[VEL_Z] = lander->state.on_ground ? 0.0 : acceleration_of(lander, x[MASS]);
    dx[MASS] = -thrust_of(lander) / (lander->parameters.isp * G0);
}

static void output(void *self, double t, const double *x)
{
    (void)t;
    lander_t *lander = self;
    lander->outputs.pos_z = x[POS_Z];
    lander->outputs.vel_z = x[VEL_Z];
    lander->outputs.mass = x[MASS];
    lander->outputs.thrust = thrust_of(lander);
    lander->outputs.landed = lander->state.on_ground && lander->state.flown;
    lander->outputs.touchdown_speed = lander->state.touchdown_speed;
}

static void event(const void *self, double t, const double *x, double *value)
{
    (void)t;
    const lander_t *lander = self;
    value[TOUCHDOWN] = lander->state.on_ground ? 1.0 : x[POS_Z];
    value[LIFT_OFF] = lander->state.on_ground ? acceleration_of(lander, x[MASS]) : -1.0;
    value[BURNOUT] = lander->state.empty ? 1.0 : x[MASS] - lander->parameters.dry_mass;
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    (void)context;
    lander_t *lander = self;
    if (number == TOUCHDOWN) {
        const double speed = -lander->state.vel_z;
        if (speed > lander->state.touchdown_speed) {
            lander->state.touchdown_speed = speed;
        }
        lander->state.pos_z = 0.0;
        lander->state.vel_z = 0.0;
        lander->state.on_ground = true;
    } else if (number == LIFT_OFF) {
        lander->state.on_ground = false;
        lander->state.flown = true;
    } else {
        lander->state.mass = lander->parameters.dry_mass;
        lander->state.empty = true;
    }
}

#define IN(path_, unit_, doc_)      FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_INPUT, path_, unit_, doc_)
#define OUT(path_, unit_, doc_)     FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_OUTPUT, path_, unit_, doc_)
#define THROUGH(path_, unit_, doc_) FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_FEEDTHROUGH, path_, unit_, doc_)
#define PARAM(path_, unit_, doc_)   FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_PARAMETER, path_, unit_, doc_)
#define STATE(path_, unit_, doc_)   FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_STATE, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    IN(inputs.throttle, "", "0 to 1"),
    PARAM(parameters.dry_mass, "kg", "without fuel"),
    PARAM(parameters.fuel_mass, "kg", "at the start"),
    PARAM(parameters.min_thrust, "N", "below it the engine is off"),
    PARAM(parameters.max_thrust, "N", "at full throttle"),
    PARAM(parameters.isp, "s", "specific impulse"),
    PARAM(parameters.gravity, "m/s^2", "of the planet, downward"),
    PARAM(parameters.pos_z, "m", "height at the start"),
    PARAM(parameters.vel_z, "m/s", "velocity at the start"),
    STATE(state.pos_z, "m", "integrated"),
    STATE(state.vel_z, "m/s", "integrated"),
    STATE(state.mass, "kg", "integrated"),
    STATE(state.touchdown_speed, "m/s", "of the hardest touchdown so far"),
    STATE(state.empty, "", "the fuel has run out"),
    STATE(state.on_ground, "", "stands on the ground"),
    STATE(state.flown, "", "has been off the ground"),
    OUT(outputs.pos_z, "m", "height above the ground"),
    OUT(outputs.vel_z, "m/s", "positive upward"),
    OUT(outputs.mass, "kg", "fuel included"),
    THROUGH(outputs.thrust, "N", "of the engine now"),
    OUT(outputs.landed, "", "back on the ground after a flight"),
    OUT(outputs.touchdown_speed, "m/s", "of the hardest touchdown so far"),
};

static const fcsl_model_event_t events[EVENTS] = {
    [TOUCHDOWN] = {"touchdown", FCSL_FALLING, "the ground stops it"},
    [LIFT_OFF] = {"lift_off", FCSL_RISING, "the thrust exceeds the weight"},
    [BURNOUT] = {"burnout", FCSL_FALLING, "the fuel has run out"},
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "lander_plant",
    .doc = "vertical flight with mass flow, thrust limits and ground contact",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(lander_t),
    .align = _Alignof(lander_t),
    .continuous_offset = offsetof(lander_t, state.pos_z),
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
