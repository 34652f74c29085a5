/* SPDX-License-Identifier: Apache-2.0
 *
 * An attitude of body axes forward, right, down in north, east, down as one of forward, left, up in east, north, up,
 * for ROS.
 *
 *   q_flu_to_enu = q_ned_to_enu q_frd_to_ned q_flu_to_frd
 *   q_ned_to_enu = (0, 1, 1, 0) / sqrt(2),   q_flu_to_frd = (0, 1, 0, 0)
 *
 * Each component of the product is a sum of two. Its sign is such that w is positive where the body heads north, level.
 *
 * Source: REP 103, Standard Units of Measure and Coordinate Conventions (ROS, 2010), sections "Axis Orientation" and
 * "Rotation Representation".
 *
 * Limits: ROS messages have the order x, y, z, w; here it is w, x, y, z.
 */
#include "fcsl/fcsl_model.h"

static const double SQRT_HALF = 0.70710678118654752440;

typedef struct {
    struct {
        double attitude_body_to_ned[4];
    } inputs;
    struct {
        double attitude_body_to_enu[4];
    } outputs;
} attitude_ned_to_enu_t;

static void output(void *self, double t, const double *x)
{
    attitude_ned_to_enu_t *conversion = self;
    (void)t, (void)x;
    const double *q = conversion->inputs.attitude_body_to_ned;
    conversion->outputs.attitude_body_to_enu[0] = SQRT_HALF * (q[0] + q[3]);
    conversion->outputs.attitude_body_to_enu[1] = SQRT_HALF * (q[1] + q[2]);
    conversion->outputs.attitude_body_to_enu[2] = SQRT_HALF * (q[1] - q[2]);
    conversion->outputs.attitude_body_to_enu[3] = SQRT_HALF * (q[0] - q[3]);
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(attitude_ned_to_enu_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_ned, "",
                      "w, x, y, z; the body is forward, right, down"),
    FCSL_MODEL_VECTOR(attitude_ned_to_enu_t, FCSL_ROLE_FEEDTHROUGH, outputs.attitude_body_to_enu, "",
                      "w, x, y, z; the body is forward, left, up"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "attitude_ned_to_enu",
    .doc = "an attitude of forward, right, down in north, east, down as one of ROS",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(attitude_ned_to_enu_t),
    .align = _Alignof(attitude_ned_to_enu_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
