/* SPDX-License-Identifier: Apache-2.0
 *
 * What `rigid_body` and `rigid_body_geodetic` share: the motion of a rigid body in a frame that does not turn.
 *
 * r' = v,  v' = g + R F / m,  q' = q w / 2,  I w' = T - w x I w - I' w
 *
 * Source: B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016), section 1.5. The norm of
 * q is held at 1 by a term of q' that is zero there.
 */
#ifndef FCSL_SIM_MODELS_RIGID_BODY_MOTION_H
#define FCSL_SIM_MODELS_RIGID_BODY_MOTION_H

#include "fcsl/fcsl_model.h"
#include "vectors.h"

typedef struct {
    double force_body[3];
    double torque_body[3];
    double gravity_inertial[3];
    double mass;
    double inertia[3][3];
    double inertia_rate[3][3];
} rigid_body_inputs_t;

typedef struct {
    double position_inertial[3];
    double velocity_inertial[3];
    double attitude_body_to_inertial[4];
    double rate_body[3];
} rigid_body_states_t;

typedef struct {
    double position_inertial[3];
    double velocity_inertial[3];
    double attitude_body_to_inertial[4];
    double rate_body[3];
    double specific_force_body[3];
    double angular_acceleration_body[3];
} rigid_body_outputs_t;

enum {
    RIGID_BODY_STATES = sizeof(rigid_body_states_t) / sizeof(double),
    POSITION = 0,
    VELOCITY = 3,
    ATTITUDE = 6,
    RATE = 10
};

/* Euler's equations for any inertia. */
static inline void rigid_body_angular_acceleration(const rigid_body_inputs_t *u, const double *rate,
                                                   double *acceleration)
{
    double momentum[3], gyroscopic[3], change[3], torque[3];
    matrix_times(u->inertia, rate, momentum);
    vector_cross(rate, momentum, gyroscopic);
    matrix_times(u->inertia_rate, rate, change);
    for (int i = 0; i < 3; i++) {
        torque[i] = u->torque_body[i] - gyroscopic[i] - change[i];
    }
    matrix_solve(u->inertia, torque, acceleration);
}

static inline void rigid_body_derivative(const rigid_body_inputs_t *u, const double *x, double *dx)
{
    double attitude[4], force_inertial[3];
    quaternion_normalize(x + ATTITUDE, attitude);
    quaternion_rotate(attitude, u->force_body, force_inertial);
    for (int i = 0; i < 3; i++) {
        dx[POSITION + i] = x[VELOCITY + i];
        dx[VELOCITY + i] = u->gravity_inertial[i] + force_inertial[i] / u->mass;
    }
    const double *q = x + ATTITUDE;
    const double turn[4] = {0.0, x[RATE], x[RATE + 1], x[RATE + 2]};
    double product[4];
    quaternion_multiply(q, turn, product);
    const double excess = 1.0 - (q[0] * q[0] + vector_dot(q + 1, q + 1));
    for (int i = 0; i < 4; i++) {
        dx[ATTITUDE + i] = 0.5 * product[i] + excess * q[i];
    }
    rigid_body_angular_acceleration(u, x + RATE, dx + RATE);
}

static inline void rigid_body_output(const rigid_body_inputs_t *u, const double *x, rigid_body_outputs_t *y)
{
    for (int i = 0; i < 3; i++) {
        y->position_inertial[i] = x[POSITION + i];
        y->velocity_inertial[i] = x[VELOCITY + i];
        y->rate_body[i] = x[RATE + i];
        y->specific_force_body[i] = u->force_body[i] / u->mass;
    }
    quaternion_normalize(x + ATTITUDE, y->attitude_body_to_inertial);
    rigid_body_angular_acceleration(u, x + RATE, y->angular_acceleration_body);
}

#define RIGID_BODY_FIELDS(struct_)                                                                                     \
    FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_INPUT, inputs.force_body, "N", "of all but gravity, at the centre of mass"),  \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OPTIONAL_INPUT, inputs.torque_body, "N*m", "about the centre of mass"),   \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OPTIONAL_INPUT, inputs.gravity_inertial, "m/s^2", ""),                    \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_INPUT, inputs.mass, "kg", ""),                                            \
        FCSL_MODEL_MATRIX(struct_, FCSL_ROLE_INPUT, inputs.inertia, "kg*m^2", "about the centre of mass, body axes"),  \
        FCSL_MODEL_MATRIX(struct_, FCSL_ROLE_OPTIONAL_INPUT, inputs.inertia_rate, "kg*m^2/s",                          \
                          "of a mass that changes"),                                                                   \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_STATE, state.position_inertial, "m", ""),                                 \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_STATE, state.velocity_inertial, "m/s", ""),                               \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_STATE, state.attitude_body_to_inertial, "", "w, x, y, z"),                \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_STATE, state.rate_body, "rad/s", ""),                                     \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OUTPUT, outputs.position_inertial, "m", "of the centre of mass"),         \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OUTPUT, outputs.velocity_inertial, "m/s", ""),                            \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OUTPUT, outputs.attitude_body_to_inertial, "",                            \
                          "unit quaternion, w, x, y, z"),                                                              \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OUTPUT, outputs.rate_body, "rad/s", "of the body in the inertial frame"), \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.specific_force_body, "m/s^2",                        \
                          "what an accelerometer feels"),                                                              \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.angular_acceleration_body, "rad/s^2", "")

#endif /* FCSL_SIM_MODELS_RIGID_BODY_MOTION_H */
