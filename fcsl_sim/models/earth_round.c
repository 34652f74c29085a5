/* SPDX-License-Identifier: Apache-2.0
 *
 * The Earth, or another body, as a sphere with gravity gm / r^2, which may turn (earth.h).
 */
#include "earth.h"

typedef struct {
    earth_inputs_t inputs;
    struct {
        double radius, gm, rotation_rate;
    } parameters;
    earth_outputs_t outputs;
} earth_round_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const earth_round_t *earth = self;
    (void)context;
    if (!(earth->parameters.radius > 0.0)) {
        return "parameters.radius must be positive";
    }
    return earth->parameters.gm >= 0.0 ? NULL : "parameters.gm must not be negative";
}

static void output(void *self, double t, const double *x)
{
    earth_round_t *earth = self;
    const ellipsoid_t sphere = {earth->parameters.radius, 0.0, earth->parameters.rotation_rate};
    (void)x;
    earth_kinematics(&sphere, t, &earth->inputs, &earth->outputs);
    earth_gravity(earth->parameters.gm, sphere.equatorial_radius, 0.0, earth->inputs.position_inertial,
                  earth->outputs.gravity_inertial);
    earth->outputs.gravity = vector_norm(earth->outputs.gravity_inertial);
}

static const fcsl_field_t fields[] = {
    EARTH_FIELDS(earth_round_t),
    FCSL_MODEL_VECTOR(earth_round_t, FCSL_ROLE_FEEDTHROUGH, outputs.position_ecef, "m", "Earth-centred, Earth-fixed"),
    FCSL_MODEL_SCALAR(earth_round_t, FCSL_ROLE_PARAMETER, parameters.radius, "m", ""),
    FCSL_MODEL_SCALAR(earth_round_t, FCSL_ROLE_PARAMETER, parameters.gm, "m^3/s^2", "3.986004418e14 for the Earth"),
    FCSL_MODEL_SCALAR(earth_round_t, FCSL_ROLE_PARAMETER, parameters.rotation_rate, "rad/s",
                      "7.292115e-5 for the Earth"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "earth_round",
    .doc = "a round Earth, which may turn: central gravity, position, velocity over ground",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(earth_round_t),
    .align = _Alignof(earth_round_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
