/* SPDX-License-Identifier: Apache-2.0
 *
 * The sum of up to six forces and torques in body axes.
 *
 *   force = sum of force_i,  torque = sum of torque_i,  i = 1 ... 6
 *
 * What is not connected is zero. The sum is taken in the order of the numbers, so the same forces give the same bits.
 *
 * Limits: all torques are about the centre of mass; a force that acts elsewhere needs its torque beside it.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double force_1_body[3], force_2_body[3], force_3_body[3];
        double force_4_body[3], force_5_body[3], force_6_body[3];
        double torque_1_body[3], torque_2_body[3], torque_3_body[3];
        double torque_4_body[3], torque_5_body[3], torque_6_body[3];
    } inputs;
    struct {
        double force_body[3];
        double torque_body[3];
    } outputs;
} force_sum_t;

static void output(void *self, double t, const double *x)
{
    force_sum_t *sum = self;
    (void)t, (void)x;
    for (int i = 0; i < 3; i++) {
        sum->outputs.force_body[i] = sum->inputs.force_1_body[i] + sum->inputs.force_2_body[i] +
                                     sum->inputs.force_3_body[i] + sum->inputs.force_4_body[i] +
                                     sum->inputs.force_5_body[i] + sum->inputs.force_6_body[i];
        sum->outputs.torque_body[i] = sum->inputs.torque_1_body[i] + sum->inputs.torque_2_body[i] +
                                      sum->inputs.torque_3_body[i] + sum->inputs.torque_4_body[i] +
                                      sum->inputs.torque_5_body[i] + sum->inputs.torque_6_body[i];
    }
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.force_1_body, "N", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.force_2_body, "N", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.force_3_body, "N", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.force_4_body, "N", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.force_5_body, "N", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.force_6_body, "N", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.torque_1_body, "N*m", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.torque_2_body, "N*m", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.torque_3_body, "N*m", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.torque_4_body, "N*m", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.torque_5_body, "N*m", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.torque_6_body, "N*m", ""),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_FEEDTHROUGH, outputs.force_body, "N", "the sum"),
    FCSL_MODEL_VECTOR(force_sum_t, FCSL_ROLE_FEEDTHROUGH, outputs.torque_body, "N*m", "the sum"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "force_sum",
    .doc = "the sum of up to six forces and torques",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(force_sum_t),
    .align = _Alignof(force_sum_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
