/* SPDX-License-Identifier: Apache-2.0
 *
 * A vector of north, east, down in body axes.
 *
 *   v_body = q* v_ned q,  computed as  v - 2 w (u x v) + 2 u x (u x v)  with q = (w, u)
 *
 * Source: B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016), section 1.8.
 *
 * Limits: the quaternion has norm 1; the vector is turned, not moved.
 */
#include "fcsl/fcsl_model.h"
#include "vectors.h"

typedef struct {
    struct {
        double vector_ned[3];
        double attitude_body_to_ned[4];
    } inputs;
    struct {
        double vector_body[3];
    } outputs;
} ned_to_body_t;

static void output(void *self, double t, const double *x)
{
    ned_to_body_t *conversion = self;
    (void)t, (void)x;
    quaternion_rotate_back(conversion->inputs.attitude_body_to_ned, conversion->inputs.vector_ned,
                           conversion->outputs.vector_body);
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(ned_to_body_t, FCSL_ROLE_INPUT, inputs.vector_ned, "", ""),
    FCSL_MODEL_VECTOR(ned_to_body_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_ned, "", "w, x, y, z"),
    FCSL_MODEL_VECTOR(ned_to_body_t, FCSL_ROLE_FEEDTHROUGH, outputs.vector_body, "", "in the unit of the input"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "ned_to_body",
    .doc = "a vector of north, east, down in body axes",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(ned_to_body_t),
    .align = _Alignof(ned_to_body_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
