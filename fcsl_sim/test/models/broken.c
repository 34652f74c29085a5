/* SPDX-License-Identifier: Apache-2.0
 *
 * A model that the loader must reject; BREAK selects the defect.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double x;
    } outputs;
    double state[2];
} broken_t;

static void derivative(const void *self, double t, const double *x, double *dx)
{
    (void)self;
    (void)t;
    dx[0] = x[0];
    dx[1] = x[1];
}

static void output(void *self, double t, const double *x)
{
    ((broken_t *)self)->outputs.x = x[0];
    (void)t;
}

#define OUTPUT(path_, offset_, size_, count_, type_)                                                                   \
    {.path = path_,                                                                                                    \
     .role = FCSL_ROLE_OUTPUT,                                                                                         \
     .type = type_,                                                                                                    \
     .count = count_,                                                                                                  \
     .offset = offset_,                                                                                                \
     .size = size_,                                                                                                    \
     .instance = FCSL_NONE,                                                                                            \
     .connected_from = FCSL_NONE,                                                                                      \
     .unit = "",                                                                                                       \
     .doc = ""}

static const fcsl_field_t fields[] = {
#if BREAK == 1
    OUTPUT("outputs.x", 20, 8, 1, FCSL_F64),
#elif BREAK == 2
    OUTPUT("outputs.x", 4, 8, 1, FCSL_F64),
#elif BREAK == 3
    OUTPUT("outputs.x", 0, 16, 1, FCSL_F64),
#elif BREAK == 4
    OUTPUT("inputs.x", 0, 8, 1, FCSL_F64),
#elif BREAK == 5
    OUTPUT("outputs.X", 0, 8, 1, FCSL_F64),
#elif BREAK == 6
    OUTPUT("outputs.x", 0, 4, 1, FCSL_HEALTH),
#elif BREAK == 7
    OUTPUT("outputs.x", 0, 16, 2, FCSL_F64),
#elif BREAK == 8
    OUTPUT("outputs.x", 0, 8, 1, FCSL_F64),
    OUTPUT("outputs.x", 0, 8, 1, FCSL_F64),
#elif BREAK == 15
    OUTPUT("outputs.x.y", 0, 8, 1, FCSL_F64),
    OUTPUT("outputs.x_y", 8, 8, 1, FCSL_F64),
#elif BREAK == 16
    FCSL_MODEL_SCALAR(broken_t, FCSL_ROLE_OUTPUT, outputs.x, "", ""),
    {.path = "outputs.y",
     .role = FCSL_ROLE_OUTPUT,
     .flags = FCSL_FIELD_OPTIONAL,
     .type = FCSL_F64,
     .count = 1,
     .offset = 8,
     .size = 8,
     .unit = "",
     .doc = ""},
#elif BREAK == 17
    {.path = "parameters.y",
     .role = FCSL_ROLE_PARAMETER,
     .flags = FCSL_FIELD_TABLE,
     .type = FCSL_F64,
     .count = 1,
     .offset = 8,
     .size = 8,
     .unit = "",
     .doc = ""},
#else
    OUTPUT("outputs.x", 0, 8, 1, FCSL_F64),
#endif
};

static const fcsl_model_t model = {
#if BREAK == 9
    .abi_version = FCSL_MODEL_ABI_VERSION + 1,
#else
    .abi_version = FCSL_MODEL_ABI_VERSION,
#endif
#if BREAK == 10
    .name = "other",
#else
    .name = "broken",
#endif
    .doc = "",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(broken_t),
    .align = _Alignof(broken_t),
    .continuous_offset = offsetof(broken_t, state),
#if BREAK == 11
    .continuous_count = 3,
#else
    .continuous_count = 2,
#endif
    .sampled_offset = FCSL_NO_OFFSET,
#if BREAK != 12
    .derivative = derivative,
#endif
#if BREAK != 13
    .output = output,
#endif
};

#if BREAK == 14
const int unrelated = 0;
#else
const fcsl_model_t *const fcsl_models[] = {&model, NULL};
#endif
