/* SPDX-License-Identifier: Apache-2.0
 *
 * One output from `output`, the time, and one from `update`, which counts; both of one model.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double time, count;
    } outputs;
} counter_t;

static void output(void *self, double t, const double *x)
{
    (void)x;
    ((counter_t *)self)->outputs.time = t;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    (void)context;
    ((counter_t *)self)->outputs.count += 1.0;
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(counter_t, FCSL_ROLE_OUTPUT, outputs.time, "s", ""),
    FCSL_MODEL_SCALAR(counter_t, FCSL_ROLE_OUTPUT, outputs.count, "", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "counter",
    .doc = "the time, and how many updates there were",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(counter_t),
    .align = _Alignof(counter_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
