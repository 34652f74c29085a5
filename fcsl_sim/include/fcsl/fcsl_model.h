/* SPDX-License-Identifier: Apache-2.0
 *
 * The model ABI: the interface between the simulator and plants, sensors or environments. Like a machine, a model instance
 * is one flat struct without pointers, described by the same field table, so one variable server serves both.
 *
 * A model library exports `fcsl_models`, ended by a null pointer; a model is found by its name, which is the stem of its
 * source file. All units are SI unless a field says otherwise.
 */
#ifndef FCSL_MODEL_H
#define FCSL_MODEL_H

#include <math.h>

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FCSL_MODEL_ABI_VERSION 2u

/* The noise stream of one instance. The same seed gives the same numbers, independent of other instances. */
typedef struct fcsl_noise fcsl_noise_t;

/* Services that a model may use while it runs. */
typedef struct {
    int64_t time_ns;
    fcsl_noise_t *noise;
    double (*gaussian)(fcsl_noise_t *noise); /* mean 0, standard deviation 1 */
    double (*uniform)(fcsl_noise_t *noise);  /* [0, 1) */
} fcsl_model_context_t;

typedef struct {
    uint32_t abi_version;
    const char *name;
    const char *doc;
    const fcsl_field_t *fields; /* roles input, output, parameter, state; paths without the instance: "outputs.pos_z" */
    uint32_t field_count;
    uint32_t size;
    uint32_t align;
    /* Continuous states: doubles, contiguous; integrated by the simulator. If there are none, the model has no derivative. */
    uint32_t continuous_offset;
    uint32_t continuous_count;
    /* uint8_t: zero after an update without a sample (a dropout); the channels connected to this instance are then left
     * out of the tick's sensor message. FCSL_NO_OFFSET: every update is a sample. */
    uint32_t sampled_offset;

    /* Called after parameters were written: checks them, sets states. Returns null, or an error text about a parameter. */
    const char *(*init)(void *self, const fcsl_model_context_t *context);
    /* dx/dt at time t (s) for state x; reads inputs and parameters of self, changes nothing. Null without continuous states. */
    void (*derivative)(const void *self, double t, const double *x, double *dx);
    /* Without continuous states: called at every update of its rate. With them: after every integration step, and once at
     * time 0. Makes the discrete changes (contact, dropouts) and writes all outputs. Its inputs are up to date. */
    void (*update)(void *self, const fcsl_model_context_t *context);
} fcsl_model_t;

/* Exported regardless of compiler flags. */
extern __attribute__((visibility("default"))) const fcsl_model_t *const fcsl_models[];

/* One scalar of a field table. A model's struct has the members `inputs`, `outputs`, `parameters` and `state` (as far as it
 * needs them), so that a path is a C expression; the type follows from the member (bool, int32_t … double):
 *
 *   FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_OUTPUT, outputs.pos_z, "m", "height above the ground")
 */
#define FCSL_MODEL_SCALAR(struct_, role_, path_, unit_, doc_)                                                          \
    {.path = #path_,                                                                                                   \
     .role = (role_),                                                                                                  \
     .type = FCSL_MODEL_TYPE(((struct_ *)0)->path_),                                                                   \
     .count = 1u,                                                                                                      \
     .offset = offsetof(struct_, path_),                                                                               \
     .size = sizeof(((struct_ *)0)->path_),                                                                            \
     .instance = FCSL_NONE,                                                                                            \
     .connected_from = FCSL_NONE,                                                                                      \
     .unit = (unit_),                                                                                                  \
     .doc = (doc_),                                                                                                    \
     .minimum = -(double)INFINITY,                                                                                     \
     .maximum = (double)INFINITY}
#define FCSL_MODEL_TYPE(member_)                                                                                       \
    _Generic((member_),                                                                                                \
        _Bool: FCSL_BOOL,                                                                                              \
        int32_t: FCSL_I32,                                                                                             \
        int64_t: FCSL_I64,                                                                                             \
        uint32_t: FCSL_U32,                                                                                            \
        uint64_t: FCSL_U64,                                                                                            \
        float: FCSL_F32,                                                                                               \
        double: FCSL_F64)

#ifdef __cplusplus
}
#endif

#endif /* FCSL_MODEL_H */
