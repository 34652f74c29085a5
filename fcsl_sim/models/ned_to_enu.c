/* SPDX-License-Identifier: Apache-2.0
 *
 * A vector of north, east, down in the axes east, north, up of ROS.
 *
 *   enu = (east, north, -down)
 *
 * Source: REP 103, Standard Units of Measure and Coordinate Conventions (ROS, 2010), section "Axis Orientation".
 *
 * Limits: both frames have the same origin. The same formula goes back.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double vector_ned[3];
    } inputs;
    struct {
        double vector_enu[3];
    } outputs;
} ned_to_enu_t;

static void output(void *self, double t, const double *x)
{
    ned_to_enu_t *conversion = self;
    (void)t, (void)x;
    conversion->outputs.vector_enu[0] = conversion->inputs.vector_ned[1];
    conversion->outputs.vector_enu[1] = conversion->inputs.vector_ned[0];
    conversion->outputs.vector_enu[2] = -conversion->inputs.vector_ned[2];
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(ned_to_enu_t, FCSL_ROLE_INPUT, inputs.vector_ned, "", ""),
    FCSL_MODEL_VECTOR(ned_to_enu_t, FCSL_ROLE_FEEDTHROUGH, outputs.vector_enu, "", "in the unit of the input"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "ned_to_enu",
    .doc = "a vector of north, east, down in east, north, up",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(ned_to_enu_t),
    .align = _Alignof(ned_to_enu_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
