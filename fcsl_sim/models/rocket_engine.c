/* SPDX-License-Identifier: Apache-2.0
 *
 * A rocket engine with its propellant: it follows its throttle with a lag, until the propellant is used up.
 *
 *   u = throttle within [0, 1], 0 below min_throttle
 *   y' = (u - y) / time_constant
 *   thrust = y max_thrust - exit_area pressure, not below 0
 *   mass_flow = y max_thrust / (g0 specific_impulse),  propellant' = -mass_flow
 *   force = thrust d,  torque = r x force
 *
 * d is the direction, r the position. The event `burnout` ends thrust and flow at once.
 *
 * Source: G. P. Sutton, O. Biblarz, Rocket Propulsion Elements, 9th ed. (2017), sections 2.1 and 2.2.
 *
 * Limits: specific impulse does not depend on the throttle; no gimbal, no flow separation in the nozzle, no limit of
 * restarts, no jet damping. The end of the exponential lag is thrust below min_throttle.
 */
#include <stdbool.h>

#include "clamp.h"
#include "fcsl/fcsl_model.h"
#include "vectors.h"

/* Standard gravity, m/s^2: part of the definition of specific impulse, on any planet. */
#define G0 9.80665

enum { THROTTLE, PROPELLANT, CONTINUOUS_STATES };
enum { BURNOUT, EVENTS };

typedef struct {
    struct {
        double throttle;
        double pressure;
    } inputs;
    struct {
        double max_thrust;
        double min_throttle;
        double time_constant;
        double specific_impulse;
        double exit_area;
        double direction_body[3];
        double position_body[3];
        double propellant_mass;
    } parameters;
    struct { /* the first two are integrated */
        double throttle;
        double propellant_mass;
        bool burnt_out;
    } state;
    struct {
        double thrust;
        double force_body[3];
        double torque_body[3];
        double mass_flow;
        double propellant_mass;
        bool burnt_out;
    } outputs;
} rocket_engine_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    rocket_engine_t *engine = self;
    (void)context;
    if (!(engine->parameters.max_thrust >= 0.0)) {
        return "parameters.max_thrust must not be negative";
    }
    if (!(engine->parameters.min_throttle >= 0.0) || !(engine->parameters.min_throttle <= 1.0)) {
        return "parameters.min_throttle must be from 0 to 1";
    }
    if (!(engine->parameters.time_constant > 0.0)) {
        return "parameters.time_constant must be positive";
    }
    if (!(engine->parameters.specific_impulse > 0.0)) {
        return "parameters.specific_impulse must be positive";
    }
    if (!(engine->parameters.exit_area >= 0.0)) {
        return "parameters.exit_area must not be negative";
    }
    if (!(vector_norm(engine->parameters.direction_body) > 0.0)) {
        return "parameters.direction_body must not be zero";
    }
    if (!(engine->parameters.propellant_mass >= 0.0)) {
        return "parameters.propellant_mass must not be negative";
    }
    engine->state.propellant_mass = engine->parameters.propellant_mass;
    engine->state.burnt_out = engine->parameters.propellant_mass == 0.0;
    return NULL;
}

static double mass_flow_of(const rocket_engine_t *engine, const double *x)
{
    const double vacuum_thrust = engine->state.burnt_out ? 0.0 : x[THROTTLE] * engine->parameters.max_thrust;
    return vacuum_thrust / (G0 * engine->parameters.specific_impulse);
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const rocket_engine_t *engine = self;
    (void)t;
    const double throttle = clamp(engine->inputs.throttle, 0.0, 1.0);
    const double command = throttle < engine->parameters.min_throttle ? 0.0 : throttle;
    dx[THROTTLE] = engine->state.burnt_out ? 0.0 : (command - x[THROTTLE]) / engine->parameters.time_constant;
    dx[PROPELLANT] = -mass_flow_of(engine, x);
}

static void output(void *self, double t, const double *x)
{
    rocket_engine_t *engine = self;
    (void)t;
    const double back_pressure = engine->parameters.exit_area * engine->inputs.pressure;
    const double net = x[THROTTLE] * engine->parameters.max_thrust - back_pressure;
    const double thrust = engine->state.burnt_out || net < 0.0 ? 0.0 : net;
    const double length = vector_norm(engine->parameters.direction_body);
    engine->outputs.thrust = thrust;
    for (int i = 0; i < 3; i++) {
        engine->outputs.force_body[i] = thrust * (engine->parameters.direction_body[i] / length);
    }
    vector_cross(engine->parameters.position_body, engine->outputs.force_body, engine->outputs.torque_body);
    engine->outputs.mass_flow = mass_flow_of(engine, x);
    engine->outputs.propellant_mass = x[PROPELLANT];
    engine->outputs.burnt_out = engine->state.burnt_out;
}

static void event(const void *self, double t, const double *x, double *value)
{
    const rocket_engine_t *engine = self;
    (void)t;
    value[BURNOUT] = engine->state.burnt_out ? 1.0 : x[PROPELLANT];
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    rocket_engine_t *engine = self;
    (void)context, (void)number;
    engine->state.throttle = 0.0;
    engine->state.propellant_mass = 0.0;
    engine->state.burnt_out = true;
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(rocket_engine_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(rocket_engine_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.throttle, "", "0 to 1"),
    SCALAR(OPTIONAL_INPUT, inputs.pressure, "Pa", "of the air around"),
    SCALAR(PARAMETER, parameters.max_thrust, "N", "in vacuum"),
    SCALAR(PARAMETER, parameters.min_throttle, "", "below it the engine is off"),
    SCALAR(PARAMETER, parameters.time_constant, "s", "of the lag behind the throttle"),
    SCALAR(PARAMETER, parameters.specific_impulse, "s", "in vacuum"),
    SCALAR(PARAMETER, parameters.exit_area, "m^2", "of the nozzle"),
    VECTOR(PARAMETER, parameters.direction_body, "", "of the force on the body, of any length"),
    VECTOR(PARAMETER, parameters.position_body, "m", "where the force acts, from the centre of mass"),
    SCALAR(PARAMETER, parameters.propellant_mass, "kg", "at the start"),
    SCALAR(STATE, state.throttle, "", "what the engine does"),
    SCALAR(STATE, state.propellant_mass, "kg", ""),
    SCALAR(STATE, state.burnt_out, "", ""),
    SCALAR(FEEDTHROUGH, outputs.thrust, "N", ""),
    VECTOR(FEEDTHROUGH, outputs.force_body, "N", ""),
    VECTOR(FEEDTHROUGH, outputs.torque_body, "N*m", "about the centre of mass"),
    SCALAR(OUTPUT, outputs.mass_flow, "kg/s", "positive when propellant leaves"),
    SCALAR(OUTPUT, outputs.propellant_mass, "kg", "what is left"),
    SCALAR(OUTPUT, outputs.burnt_out, "", "the propellant is used up"),
};

static const fcsl_model_event_t events[EVENTS] = {
    [BURNOUT] = {"burnout", FCSL_FALLING, "the propellant is used up"},
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "rocket_engine",
    .doc = "a rocket engine with lag, pressure thrust and propellant",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(rocket_engine_t),
    .align = _Alignof(rocket_engine_t),
    .continuous_offset = offsetof(rocket_engine_t, state),
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
