/* SPDX-License-Identifier: Apache-2.0
 *
 * A brushless DC motor with its speed controller, which makes a duty cycle of the throttle. With the torque constant
 * kt = 1 / kv:
 *
 *   duty' = (throttle within [0, 1] - duty) / controller_time_constant
 *   i' = (max(0, (duty voltage - speed / kv) / resistance) - i) / winding_time_constant
 *   torque = kt (i - no_load_current),   inertia speed' = torque - load_torque
 *   current = duty i, not below 0
 *
 * i is the current of the windings, current that of the battery. i lags by inductance / resistance of the windings. So
 * no output depends on an input of the same instant, and a battery with a resistance makes no algebraic loop.
 *
 * Source: M. Drela, First-Order DC Electric Motor Model, MIT (2007), which is the steady state; the controller as an
 * ideal step-down converter.
 *
 * Limits: the windings never brake, and feed nothing back into the battery; no losses of the controller, no iron
 * losses that grow with speed, no heat. Below FRICTION_SPEED the friction kt no_load_current is taken in proportion to
 * the speed, so that the motor comes to rest.
 */
#include "clamp.h"
#include "fcsl/fcsl_model.h"

/* rad/s: about 100 revolutions a minute, far below what a motor is used at. */
#define FRICTION_SPEED 10.0

enum { SPEED, DUTY, CURRENT, CONTINUOUS_STATES };

typedef struct {
    struct {
        double throttle;
        double voltage;
        double load_torque;
    } inputs;
    struct {
        double kv;
        double resistance;
        double no_load_current;
        double inertia;
        double controller_time_constant;
        double winding_time_constant;
        double speed;
    } parameters;
    struct {
        double speed;
        double duty;
        double current;
    } state;
    struct {
        double speed;
        double current;
        double torque;
    } outputs;
} brushless_motor_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    brushless_motor_t *motor = self;
    (void)context;
    if (!(motor->parameters.kv > 0.0)) {
        return "parameters.kv must be positive";
    }
    if (!(motor->parameters.resistance > 0.0)) {
        return "parameters.resistance must be positive";
    }
    if (!(motor->parameters.no_load_current >= 0.0)) {
        return "parameters.no_load_current must not be negative";
    }
    if (!(motor->parameters.inertia > 0.0)) {
        return "parameters.inertia must be positive";
    }
    if (!(motor->parameters.controller_time_constant > 0.0)) {
        return "parameters.controller_time_constant must be positive";
    }
    if (!(motor->parameters.winding_time_constant > 0.0)) {
        return "parameters.winding_time_constant must be positive";
    }
    motor->state.speed = motor->parameters.speed;
    return NULL;
}

static double torque_of(const brushless_motor_t *motor, const double *x)
{
    const double sliding = clamp(x[SPEED] / FRICTION_SPEED, -1.0, 1.0);
    return (x[CURRENT] - motor->parameters.no_load_current * sliding) / motor->parameters.kv;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const brushless_motor_t *motor = self;
    (void)t;
    const double drop = x[DUTY] * motor->inputs.voltage - x[SPEED] / motor->parameters.kv;
    const double steady = drop < 0.0 ? 0.0 : drop / motor->parameters.resistance;
    const double throttle = clamp(motor->inputs.throttle, 0.0, 1.0);
    dx[SPEED] = (torque_of(motor, x) - motor->inputs.load_torque) / motor->parameters.inertia;
    dx[DUTY] = (throttle - x[DUTY]) / motor->parameters.controller_time_constant;
    dx[CURRENT] = (steady - x[CURRENT]) / motor->parameters.winding_time_constant;
}

static void output(void *self, double t, const double *x)
{
    brushless_motor_t *motor = self;
    (void)t;
    const double drawn = x[DUTY] * x[CURRENT]; /* below zero only by the error of an integrator */
    motor->outputs.speed = x[SPEED];
    motor->outputs.current = drawn < 0.0 ? 0.0 : drawn;
    motor->outputs.torque = torque_of(motor, x);
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(brushless_motor_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.throttle, "", "0 to 1"),
    SCALAR(INPUT, inputs.voltage, "V", "of the battery"),
    SCALAR(OPTIONAL_INPUT, inputs.load_torque, "N*m", "against the rotation"),
    SCALAR(PARAMETER, parameters.kv, "rad/(s*V)", "speed by voltage, without load"),
    SCALAR(PARAMETER, parameters.resistance, "Ohm", "of the windings and the controller"),
    SCALAR(PARAMETER, parameters.no_load_current, "A", "against friction"),
    SCALAR(PARAMETER, parameters.inertia, "kg*m^2", "of rotor and propeller"),
    SCALAR(PARAMETER, parameters.controller_time_constant, "s", "of the duty behind the throttle"),
    SCALAR(PARAMETER, parameters.winding_time_constant, "s", "inductance / resistance"),
    SCALAR(PARAMETER, parameters.speed, "rad/s", "at the start"),
    SCALAR(STATE, state.speed, "rad/s", ""),
    SCALAR(STATE, state.duty, "", ""),
    SCALAR(STATE, state.current, "A", "of the windings"),
    SCALAR(OUTPUT, outputs.speed, "rad/s", ""),
    SCALAR(OUTPUT, outputs.current, "A", "drawn from the battery"),
    SCALAR(OUTPUT, outputs.torque, "N*m", "of the shaft, friction taken off"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "brushless_motor",
    .doc = "a brushless DC motor with its speed controller",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(brushless_motor_t),
    .align = _Alignof(brushless_motor_t),
    .continuous_offset = offsetof(brushless_motor_t, state),
    .continuous_count = CONTINUOUS_STATES,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
