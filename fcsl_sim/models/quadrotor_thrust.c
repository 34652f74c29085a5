/* SPDX-License-Identifier: Apache-2.0
 *
 * The thrusts of four rotors, each of which follows its command with a lag. Their axes are parallel to body z, which
 * points down. Of rotor i at (x, y), which turns counterclockwise (direction 1) or clockwise (-1) seen from above:
 *
 *   time_constant thrust' = clamp(command, 0, max_thrust) - thrust
 *   force = (0, 0, -thrust)
 *   torque = (-y thrust, x thrust, direction torque_per_thrust thrust)
 *
 * Source: R. Mahony, V. Kumar, P. Corke, Multirotor Aerial Vehicles, IEEE Robotics & Automation Magazine 19 (2012)
 * 20-32, for thrust and reaction in proportion; the lag is that of a motor with its own control of speed, linearised.
 *
 * Limits: no air: neither inflow nor drag, nor a gyroscopic torque of the rotors. `brushless_motor` and `rotor` have
 * these. The arms' height is left out: forces are parallel to z, so it makes no torque.
 */
#include "clamp.h"
#include "fcsl/fcsl_model.h"

enum { ROTORS = 4 };

typedef struct {
    struct {
        double command[ROTORS];
    } inputs;
    struct {
        double position[ROTORS][2];
        double direction[ROTORS];
        double torque_per_thrust;
        double max_thrust;
        double time_constant;
        double thrust[ROTORS];
    } parameters;
    struct {
        double thrust[ROTORS]; /* integrated */
    } state;
    struct {
        double force_body[3];
        double torque_body[3];
        double thrust[ROTORS];
    } outputs;
} quadrotor_thrust_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    quadrotor_thrust_t *rotors = self;
    (void)context;
    if (!(rotors->parameters.torque_per_thrust >= 0.0)) {
        return "parameters.torque_per_thrust must not be negative";
    }
    if (!(rotors->parameters.max_thrust > 0.0)) {
        return "parameters.max_thrust must be positive";
    }
    if (!(rotors->parameters.time_constant > 0.0)) {
        return "parameters.time_constant must be positive";
    }
    for (int i = 0; i < ROTORS; i++) {
        if (!(fabs(rotors->parameters.direction[i]) == 1.0)) {
            return "parameters.direction must be 1 or -1 for each rotor";
        }
        if (!(rotors->parameters.thrust[i] >= 0.0 && rotors->parameters.thrust[i] <= rotors->parameters.max_thrust)) {
            return "parameters.thrust must be within 0 and max_thrust";
        }
        rotors->state.thrust[i] = rotors->parameters.thrust[i];
    }
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const quadrotor_thrust_t *rotors = self;
    (void)t;
    for (int i = 0; i < ROTORS; i++) {
        const double wanted = clamp(rotors->inputs.command[i], 0.0, rotors->parameters.max_thrust);
        dx[i] = (wanted - x[i]) / rotors->parameters.time_constant;
    }
}

static void output(void *self, double t, const double *x)
{
    quadrotor_thrust_t *rotors = self;
    double sum = 0.0, roll = 0.0, pitch = 0.0, yaw = 0.0;
    (void)t;
    for (int i = 0; i < ROTORS; i++) {
        sum += x[i];
        roll -= rotors->parameters.position[i][1] * x[i];
        pitch += rotors->parameters.position[i][0] * x[i];
        yaw += rotors->parameters.direction[i] * rotors->parameters.torque_per_thrust * x[i];
        rotors->outputs.thrust[i] = x[i];
    }
    rotors->outputs.force_body[0] = 0.0;
    rotors->outputs.force_body[1] = 0.0;
    rotors->outputs.force_body[2] = -sum;
    rotors->outputs.torque_body[0] = roll;
    rotors->outputs.torque_body[1] = pitch;
    rotors->outputs.torque_body[2] = yaw;
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(quadrotor_thrust_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(quadrotor_thrust_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    VECTOR(INPUT, inputs.command, "N", "thrust of each rotor"),
    FCSL_MODEL_MATRIX(quadrotor_thrust_t, FCSL_ROLE_PARAMETER, parameters.position, "m",
                      "x, y of each rotor from the centre of mass"),
    VECTOR(PARAMETER, parameters.direction, "", "seen from above, 1: counterclockwise, -1: clockwise"),
    SCALAR(PARAMETER, parameters.torque_per_thrust, "m", "reaction, N m per N"),
    SCALAR(PARAMETER, parameters.max_thrust, "N", "of a rotor"),
    SCALAR(PARAMETER, parameters.time_constant, "s", "of a rotor"),
    VECTOR(OPTIONAL_PARAMETER, parameters.thrust, "N", "at the start"),
    VECTOR(STATE, state.thrust, "N", ""),
    VECTOR(OUTPUT, outputs.force_body, "N", ""),
    VECTOR(OUTPUT, outputs.torque_body, "N*m", "about the centre of mass"),
    VECTOR(OUTPUT, outputs.thrust, "N", "of each rotor"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "quadrotor_thrust",
    .doc = "the thrusts of four rotors behind a lag",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(quadrotor_thrust_t),
    .align = _Alignof(quadrotor_thrust_t),
    .continuous_offset = offsetof(quadrotor_thrust_t, state),
    .continuous_count = ROTORS,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
