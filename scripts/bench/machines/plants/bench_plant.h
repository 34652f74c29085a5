/* SPDX-License-Identifier: Apache-2.0
 *
 * What all plants of the bench are as models: the functions around those of their headers.
 */
#ifndef BENCH_PLANT_H
#define BENCH_PLANT_H

#include <string.h>

#include "fcsl/fcsl_model.h"

#define SCALAR(plant_, path_, unit_) FCSL_MODEL_SCALAR(plant_##_t, FCSL_ROLE_PARAMETER, parameters.path_, unit_, "")
#define VECTOR(plant_, path_, unit_) FCSL_MODEL_VECTOR(plant_##_t, FCSL_ROLE_PARAMETER, parameters.path_, unit_, "")
#define STATES(plant_)                                                                                                 \
    FCSL_MODEL_VECTOR(plant_##_t, FCSL_ROLE_STATE, state.x, "", ""),                                                   \
        FCSL_MODEL_VECTOR(plant_##_t, FCSL_ROLE_OUTPUT, outputs.x, "", "")

/* `derivative` and `output` of the model. */
#define PLANT(plant_)                                                                                                  \
    static void derivative(const void *self, double t, const double *x, double *dx)                                    \
    {                                                                                                                  \
        (void)t;                                                                                                       \
        plant_##_derivative(self, x, dx);                                                                              \
    }                                                                                                                  \
    static void output(void *self, double t, const double *x)                                                          \
    {                                                                                                                  \
        plant_##_t *plant = self;                                                                                      \
        (void)t;                                                                                                       \
        memcpy(plant->outputs.x, x, sizeof plant->outputs.x);                                                          \
    }

/* `event` and `reset`. */
#define PLANT_EVENTS(plant_)                                                                                           \
    static void event(const void *self, double t, const double *x, double *value)                                      \
    {                                                                                                                  \
        (void)t;                                                                                                       \
        plant_##_event(self, x, value);                                                                                \
    }                                                                                                                  \
    static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)                                \
    {                                                                                                                  \
        (void)context;                                                                                                 \
        plant_##_reset(self, number);                                                                                  \
    }

/* The members of the descriptor that all have. */
#define PLANT_MEMBERS(plant_, doc_)                                                                                    \
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = #plant_, .doc = doc_, .fields = fields,                             \
    .field_count = sizeof fields / sizeof *fields, .size = sizeof(plant_##_t), .align = _Alignof(plant_##_t),          \
    .continuous_offset = offsetof(plant_##_t, state.x),                                                                \
    .continuous_count = sizeof((plant_##_t *)0)->state.x / sizeof(double), .sampled_offset = FCSL_NO_OFFSET,           \
    .init = init, .derivative = derivative, .output = output

#endif /* BENCH_PLANT_H */
