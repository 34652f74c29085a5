/* SPDX-License-Identifier: Apache-2.0
 *
 * A propeller or rotor of fixed pitch. It turns right-handed about its axis a with direction 1, left-handed with -1,
 * and pulls along the axis in both cases. With n = speed / (2 pi), diameter D, air density rho:
 *
 *   v = velocity_air + rate x r                    of the hub, at position r, through the air
 *   thrust = rho n |n| D^4 Ct - rho |n| D^3 Ci (v . a)
 *   force = thrust a - rho |n| D^3 Cd (v - (v . a) a)
 *   load_torque = rho n |n| D^5 Cq
 *   h = direction inertia speed a
 *   torque = r x force - direction reaction a - rate x h
 *
 * With `motor_reacts` the reaction is motor_torque: the motor pushes the body back with what it gives to the shaft,
 * also while the rotor speeds up. Without, it is load_torque, as if the speed were steady.
 *
 * Sources: J. B. Brandt, M. S. Selig, Propeller Performance Data at Low Reynolds Numbers, AIAA 2011-1255, for the
 * coefficients; Ci is a line through their thrust over the advance ratio v . a / (n D), which is zero at Ct / Ci. Drag
 * in the plane: P. Martin, E. Salaun, The True Role of Accelerometer Feedback in Quadrotor Control, ICRA 2010;
 * R. Mahony, V. Kumar, P. Corke, Multirotor Aerial Vehicles, IEEE Robotics & Automation Magazine 19 (2012) 20-32.
 *
 * Limits: the torque does not depend on the inflow; no vortex ring, no hub moment from flapping, no ground effect, no
 * wake of another rotor. The inertia across the axis belongs to the body.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"
#include "vectors.h"

static const double TWO_PI = 6.283185307179586;

typedef struct {
    struct {
        double speed;
        double density;
        double velocity_air_body[3];
        double rate_body[3];
        double motor_torque;
    } inputs;
    struct {
        double thrust_coefficient;
        double torque_coefficient;
        double inflow_coefficient;
        double drag_coefficient;
        double diameter;
        double inertia;
        double direction;
        double position_body[3];
        double axis_body[3];
        bool motor_reacts;
    } parameters;
    struct {
        double force_body[3];
        double torque_body[3];
        double thrust;
        double load_torque;
    } outputs;
} rotor_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const rotor_t *rotor = self;
    (void)context;
    if (!(rotor->parameters.thrust_coefficient >= 0.0)) {
        return "parameters.thrust_coefficient must not be negative";
    }
    if (!(rotor->parameters.torque_coefficient >= 0.0)) {
        return "parameters.torque_coefficient must not be negative";
    }
    if (!(rotor->parameters.inflow_coefficient >= 0.0)) {
        return "parameters.inflow_coefficient must not be negative";
    }
    if (!(rotor->parameters.drag_coefficient >= 0.0)) {
        return "parameters.drag_coefficient must not be negative";
    }
    if (!(rotor->parameters.diameter > 0.0)) {
        return "parameters.diameter must be positive";
    }
    if (!(rotor->parameters.inertia >= 0.0)) {
        return "parameters.inertia must not be negative";
    }
    if (!(fabs(rotor->parameters.direction) == 1.0)) {
        return "parameters.direction must be 1 or -1";
    }
    if (!(vector_norm(rotor->parameters.axis_body) > 0.0)) {
        return "parameters.axis_body must not be zero";
    }
    return NULL;
}

static void axis_of(const rotor_t *rotor, double *axis)
{
    const double length = vector_norm(rotor->parameters.axis_body);
    for (int i = 0; i < 3; i++) {
        axis[i] = rotor->parameters.axis_body[i] / length;
    }
}

/* The force of the air; `per_speed` is rho |n| D^3. */
static void set_force(rotor_t *rotor, const double *axis, double per_speed)
{
    const double diameter = rotor->parameters.diameter;
    const double revolutions = rotor->inputs.speed / TWO_PI;
    double velocity[3];
    vector_cross(rotor->inputs.rate_body, rotor->parameters.position_body, velocity);
    for (int i = 0; i < 3; i++) {
        velocity[i] += rotor->inputs.velocity_air_body[i];
    }
    const double inflow = vector_dot(velocity, axis);
    const double thrust = per_speed * (rotor->parameters.thrust_coefficient * revolutions * diameter -
                                       rotor->parameters.inflow_coefficient * inflow);
    for (int i = 0; i < 3; i++) {
        const double across = velocity[i] - inflow * axis[i];
        rotor->outputs.force_body[i] = thrust * axis[i] - per_speed * rotor->parameters.drag_coefficient * across;
    }
    rotor->outputs.thrust = thrust;
}

static void output(void *self, double t, const double *x)
{
    rotor_t *rotor = self;
    (void)t, (void)x;
    const double diameter = rotor->parameters.diameter;
    const double revolutions = rotor->inputs.speed / TWO_PI;
    const double per_speed = rotor->inputs.density * fabs(revolutions) * (diameter * diameter * diameter);
    double axis[3], momentum[3], arm[3], gyroscopic[3];
    axis_of(rotor, axis);
    set_force(rotor, axis, per_speed);
    rotor->outputs.load_torque = per_speed * revolutions * (diameter * diameter) * rotor->parameters.torque_coefficient;

    const double reaction = rotor->parameters.motor_reacts ? rotor->inputs.motor_torque : rotor->outputs.load_torque;
    for (int i = 0; i < 3; i++) {
        momentum[i] = rotor->parameters.direction * rotor->parameters.inertia * rotor->inputs.speed * axis[i];
    }
    vector_cross(rotor->parameters.position_body, rotor->outputs.force_body, arm);
    vector_cross(rotor->inputs.rate_body, momentum, gyroscopic);
    for (int i = 0; i < 3; i++) {
        rotor->outputs.torque_body[i] = arm[i] - rotor->parameters.direction * reaction * axis[i] - gyroscopic[i];
    }
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(rotor_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(rotor_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.speed, "rad/s", "positive when it turns in its direction"),
    SCALAR(INPUT, inputs.density, "kg/m^3", ""),
    VECTOR(OPTIONAL_INPUT, inputs.velocity_air_body, "m/s", "of the body through the air"),
    VECTOR(OPTIONAL_INPUT, inputs.rate_body, "rad/s", ""),
    SCALAR(OPTIONAL_INPUT, inputs.motor_torque, "N*m", "on the shaft, for `motor_reacts`"),
    SCALAR(PARAMETER, parameters.thrust_coefficient, "", "Ct"),
    SCALAR(PARAMETER, parameters.torque_coefficient, "", "Cq, the power coefficient / (2 pi)"),
    SCALAR(PARAMETER, parameters.inflow_coefficient, "", "Ci, Ct / advance ratio of zero thrust; 0: no effect"),
    SCALAR(PARAMETER, parameters.drag_coefficient, "", "Cd, in the plane of the rotor"),
    SCALAR(PARAMETER, parameters.diameter, "m", ""),
    SCALAR(PARAMETER, parameters.inertia, "kg*m^2", "about the axis, all that turns"),
    SCALAR(PARAMETER, parameters.direction, "", "1: right-handed about the axis, -1: left-handed"),
    VECTOR(PARAMETER, parameters.position_body, "m", "of the hub, from the centre of mass"),
    VECTOR(PARAMETER, parameters.axis_body, "", "direction of the thrust, of any length"),
    SCALAR(PARAMETER, parameters.motor_reacts, "", "the reaction is motor_torque, else load_torque"),
    VECTOR(FEEDTHROUGH, outputs.force_body, "N", ""),
    VECTOR(FEEDTHROUGH, outputs.torque_body, "N*m", "about the centre of mass"),
    SCALAR(FEEDTHROUGH, outputs.thrust, "N", "along the axis"),
    SCALAR(FEEDTHROUGH, outputs.load_torque, "N*m", "of the air, against the rotation"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "rotor",
    .doc = "a propeller or rotor: thrust, drag, reaction and gyroscopic torque",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(rotor_t),
    .align = _Alignof(rotor_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
