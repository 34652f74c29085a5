/* SPDX-License-Identifier: Apache-2.0
 *
 * y = the sum of a table's values + x + offset: an input that is needed, one that is optional, and a table of any length.
 */
#include "fcsl/fcsl_model.h"

enum { CAPACITY = 4 };

typedef struct {
    struct {
        double x, offset;
    } inputs;
    struct {
        double values[CAPACITY];
    } parameters;
    struct {
        double y, last;
    } outputs;
} curve_t;

static void output(void *self, double t, const double *x)
{
    curve_t *curve = self;
    (void)t, (void)x;
    double sum = curve->inputs.x + curve->inputs.offset;
    for (int i = 0; i < CAPACITY; i++) {
        sum += curve->parameters.values[i];
    }
    curve->outputs.y = sum;
    curve->outputs.last = curve->parameters.values[CAPACITY - 1];
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(curve_t, FCSL_ROLE_INPUT, inputs.x, "m", ""),
    FCSL_MODEL_SCALAR(curve_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.offset, "m", ""),
    FCSL_MODEL_VECTOR(curve_t, FCSL_ROLE_TABLE, parameters.values, "m", ""),
    FCSL_MODEL_SCALAR(curve_t, FCSL_ROLE_FEEDTHROUGH, outputs.y, "m", ""),
    FCSL_MODEL_SCALAR(curve_t, FCSL_ROLE_OUTPUT, outputs.last, "m", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "curve",
    .doc = "the sum of a table and two inputs",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(curve_t),
    .align = _Alignof(curve_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
