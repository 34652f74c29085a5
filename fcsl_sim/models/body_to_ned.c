/* SPDX-License-Identifier: Apache-2.0
 *
 * A vector of body axes in north, east, down.
 *
 *   v_ned = q v_body q*,  computed as  v + 2 w (u x v) + 2 u x (u x v)  with q = (w, u)
 *
 * Source: B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016), section 1.8.
 *
 * Limits: the quaternion has norm 1; the vector is turned, not moved.
 */
#include "fcsl/fcsl_model.h"
#include "vectors.h"

typedef struct {
    struct {
        double vector_body[3];
        double attitude_body_to_ned[4];
    } inputs;
    struct {
        double vector_ned[3];
    } outputs;
} body_to_ned_t;

static void output(void *self, double t, const double *x)
{
    body_to_ned_t *conversion = self;
    (void)t, (void)x;
    quaternion_rotate(conversion->inputs.attitude_body_to_ned, conversion->inputs.vector_body,
                      conversion->outputs.vector_ned);
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(body_to_ned_t, FCSL_ROLE_INPUT, inputs.vector_body, "", ""),
    FCSL_MODEL_VECTOR(body_to_ned_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_ned, "", "w, x, y, z"),
    FCSL_MODEL_VECTOR(body_to_ned_t, FCSL_ROLE_FEEDTHROUGH, outputs.vector_ned, "", "in the unit of the input"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "body_to_ned",
    .doc = "a vector of body axes in north, east, down",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(body_to_ned_t),
    .align = _Alignof(body_to_ned_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
