/* SPDX-License-Identifier: Apache-2.0
 *
 * A model that goes wrong at `at_s`, as `how` says: 1 crashes, 2 never returns, 3 aborts, 4 recurses for ever, 5 changes
 * the rounding; 10 more: in init.
 */
#include <fenv.h>
#include <stdlib.h>

#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double at_s;
        int64_t how;
    } parameters;
    struct {
        double y;
    } outputs;
} faulty_t;

static volatile int never;

static int recurse(volatile int *depth)
{
    volatile int below = *depth + 1;
    return below == 0 ? 0 : recurse(&below) + below;
}

static void go_wrong(faulty_t *faulty, int64_t how)
{
    volatile int depth = 0;
    switch (how) {
    case 1:
        *(volatile int *)16 = 1;
        break;
    case 2:
        while (!never) {
        }
        break;
    case 3:
        abort();
    case 4:
        faulty->outputs.y = recurse(&depth);
        break;
    case 5:
        (void)fesetround(FE_UPWARD);
        break;
    default:
        break;
    }
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    faulty_t *faulty = self;
    (void)context;
    go_wrong(faulty, faulty->parameters.how - 10);
    return NULL;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    faulty_t *faulty = self;
    if ((double)context->time_ns / 1e9 >= faulty->parameters.at_s) {
        go_wrong(faulty, faulty->parameters.how);
    }
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(faulty_t, FCSL_ROLE_PARAMETER, parameters.at_s, "s", ""),
    FCSL_MODEL_SCALAR(faulty_t, FCSL_ROLE_PARAMETER, parameters.how, "", ""),
    FCSL_MODEL_SCALAR(faulty_t, FCSL_ROLE_OUTPUT, outputs.y, "", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "faulty",
    .doc = "goes wrong",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(faulty_t),
    .align = _Alignof(faulty_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
