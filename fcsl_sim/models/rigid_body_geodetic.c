/* SPDX-License-Identifier: Apache-2.0
 *
 * A rigid body with six degrees of freedom (rigid_body_motion.h), which begins at a place over the Earth: latitude, longitude
 * and height, velocity over ground, attitude from north, east, down. It moves in the Earth-centred inertial axes of
 * `earth_round` or `earth_wgs84`; its parameters are those of the same Earth (flattening 0 for a round one).
 */
#include "earth.h"
#include "rigid_body_motion.h"

typedef struct {
    rigid_body_inputs_t inputs;
    struct {
        double latitude, longitude, height;
        double velocity_ned[3];
        double roll, pitch, yaw;
        double rate_over_ground_body[3];
        double equatorial_radius, flattening, rotation_rate;
    } parameters;
    rigid_body_states_t state;
    rigid_body_outputs_t outputs;
} rigid_body_geodetic_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    rigid_body_geodetic_t *body = self;
    const ellipsoid_t earth = {body->parameters.equatorial_radius, body->parameters.flattening,
                               body->parameters.rotation_rate};
    if (!(earth.equatorial_radius > 0.0)) {
        return "parameters.equatorial_radius must be positive";
    }
    if (!(earth.flattening >= 0.0 && earth.flattening < 1.0)) {
        return "parameters.flattening must be in [0, 1)";
    }
    double ecef[3], to_ecef[4], to_inertial[4], ned_to_inertial[4], velocity[3], euler[4], spin_body[3];
    ellipsoid_to_ecef(&earth, body->parameters.latitude, body->parameters.longitude, body->parameters.height, ecef);
    ned_to_ecef(body->parameters.latitude, body->parameters.longitude, to_ecef);
    ecef_to_inertial(&earth, (double)context->time_ns * 1e-9, to_inertial);
    quaternion_multiply(to_inertial, to_ecef, ned_to_inertial);
    quaternion_rotate(to_inertial, ecef, body->state.position_inertial);
    quaternion_rotate(ned_to_inertial, body->parameters.velocity_ned, velocity);
    const double spin[3] = {0.0, 0.0, earth.rotation_rate};
    double carried[3];
    vector_cross(spin, body->state.position_inertial, carried);
    quaternion_from_euler(body->parameters.roll, body->parameters.pitch, body->parameters.yaw, euler);
    quaternion_multiply(ned_to_inertial, euler, body->state.attitude_body_to_inertial);
    quaternion_rotate_back(body->state.attitude_body_to_inertial, spin, spin_body);
    for (int i = 0; i < 3; i++) {
        body->state.velocity_inertial[i] = velocity[i] + carried[i];
        body->state.rate_body[i] = body->parameters.rate_over_ground_body[i] + spin_body[i];
    }
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    (void)t;
    rigid_body_derivative(&((const rigid_body_geodetic_t *)self)->inputs, x, dx);
}

static void output(void *self, double t, const double *x)
{
    rigid_body_geodetic_t *body = self;
    (void)t;
    rigid_body_output(&body->inputs, x, &body->outputs);
}

#define PARAMETER(name_, unit_, doc_)                                                                                  \
    FCSL_MODEL_SCALAR(rigid_body_geodetic_t, FCSL_ROLE_PARAMETER, parameters.name_, unit_, doc_)
#define VECTOR_PARAMETER(name_, unit_, doc_)                                                                           \
    FCSL_MODEL_VECTOR(rigid_body_geodetic_t, FCSL_ROLE_PARAMETER, parameters.name_, unit_, doc_)

static const fcsl_field_t fields[] = {
    RIGID_BODY_FIELDS(rigid_body_geodetic_t),
    PARAMETER(latitude, "rad", "geodetic, where it begins"),
    PARAMETER(longitude, "rad", ""),
    PARAMETER(height, "m", "above the ellipsoid"),
    VECTOR_PARAMETER(velocity_ned, "m/s", "over ground"),
    PARAMETER(roll, "rad", "from north, east, down"),
    PARAMETER(pitch, "rad", ""),
    PARAMETER(yaw, "rad", ""),
    VECTOR_PARAMETER(rate_over_ground_body, "rad/s", "in Earth-fixed axes"),
    PARAMETER(equatorial_radius, "m", "of the Earth: WGS-84 has 6378137"),
    PARAMETER(flattening, "", "WGS-84 has 0.0033528106647474805"),
    PARAMETER(rotation_rate, "rad/s", "WGS-84 has 7.292115e-5"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "rigid_body_geodetic",
    .doc = "a rigid body with six degrees of freedom, which begins at a latitude, longitude and height",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(rigid_body_geodetic_t),
    .align = _Alignof(rigid_body_geodetic_t),
    .continuous_offset = offsetof(rigid_body_geodetic_t, state),
    .continuous_count = RIGID_BODY_STATES,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
