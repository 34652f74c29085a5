/* SPDX-License-Identifier: Apache-2.0
 *
 * A rigid body with six degrees of freedom (rigid_body_motion.h), which begins where its parameters say, in the inertial frame.
 *
 * The inertial frame is that of the gravity that feeds it: north, east, down with `earth_flat`, Earth-centred with the
 * others. Body axes are forward, right, down.
 */
#include "rigid_body_motion.h"

typedef struct {
    rigid_body_inputs_t inputs;
    struct {
        double position_inertial[3];
        double velocity_inertial[3];
        double roll, pitch, yaw;
        double rate_body[3];
    } parameters;
    rigid_body_states_t state;
    rigid_body_outputs_t outputs;
} rigid_body_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    rigid_body_t *body = self;
    (void)context;
    for (int i = 0; i < 3; i++) {
        body->state.position_inertial[i] = body->parameters.position_inertial[i];
        body->state.velocity_inertial[i] = body->parameters.velocity_inertial[i];
        body->state.rate_body[i] = body->parameters.rate_body[i];
    }
    quaternion_from_euler(body->parameters.roll, body->parameters.pitch, body->parameters.yaw,
                          body->state.attitude_body_to_inertial);
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    (void)t;
    rigid_body_derivative(&((const rigid_body_t *)self)->inputs, x, dx);
}

static void output(void *self, double t, const double *x)
{
    rigid_body_t *body = self;
    (void)t;
    rigid_body_output(&body->inputs, x, &body->outputs);
}

static const fcsl_field_t fields[] = {
    RIGID_BODY_FIELDS(rigid_body_t),
    FCSL_MODEL_VECTOR(rigid_body_t, FCSL_ROLE_PARAMETER, parameters.position_inertial, "m", "where it begins"),
    FCSL_MODEL_VECTOR(rigid_body_t, FCSL_ROLE_PARAMETER, parameters.velocity_inertial, "m/s", ""),
    FCSL_MODEL_SCALAR(rigid_body_t, FCSL_ROLE_PARAMETER, parameters.roll, "rad", "from the inertial frame"),
    FCSL_MODEL_SCALAR(rigid_body_t, FCSL_ROLE_PARAMETER, parameters.pitch, "rad", ""),
    FCSL_MODEL_SCALAR(rigid_body_t, FCSL_ROLE_PARAMETER, parameters.yaw, "rad", ""),
    FCSL_MODEL_VECTOR(rigid_body_t, FCSL_ROLE_PARAMETER, parameters.rate_body, "rad/s", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "rigid_body",
    .doc = "a rigid body with six degrees of freedom",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(rigid_body_t),
    .align = _Alignof(rigid_body_t),
    .continuous_offset = offsetof(rigid_body_t, state),
    .continuous_count = RIGID_BODY_STATES,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
