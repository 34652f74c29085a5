/* SPDX-License-Identifier: Apache-2.0
 *
 * A vector in body axes forward, right, down in the body axes forward, left, up of ROS.
 *
 *   flu = (forward, -right, -down)
 *
 * Source: REP 103, Standard Units of Measure and Coordinate Conventions (ROS, 2010), section "Axis Orientation".
 *
 * Limits: both frames have the same origin. The same formula goes back.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double vector_frd[3];
    } inputs;
    struct {
        double vector_flu[3];
    } outputs;
} frd_to_flu_t;

static void output(void *self, double t, const double *x)
{
    frd_to_flu_t *conversion = self;
    (void)t, (void)x;
    conversion->outputs.vector_flu[0] = conversion->inputs.vector_frd[0];
    conversion->outputs.vector_flu[1] = -conversion->inputs.vector_frd[1];
    conversion->outputs.vector_flu[2] = -conversion->inputs.vector_frd[2];
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(frd_to_flu_t, FCSL_ROLE_INPUT, inputs.vector_frd, "", ""),
    FCSL_MODEL_VECTOR(frd_to_flu_t, FCSL_ROLE_FEEDTHROUGH, outputs.vector_flu, "", "in the unit of the input"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "frd_to_flu",
    .doc = "a vector of forward, right, down in forward, left, up",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(frd_to_flu_t),
    .align = _Alignof(frd_to_flu_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
