/* SPDX-License-Identifier: Apache-2.0
 *
 * The model ABI: the interface between the simulator and plants, sensors or environments. Like a machine, a model instance
 * is one flat struct without pointers, described by the same field table, so one variable server serves both. The
 * simulator copies and moves instances; nothing else may keep an address of one.
 *
 * A model library exports `fcsl_models`, ended by a null pointer; a model is found by its name, which is the stem of its
 * source file. All units are SI unless a field says otherwise.
 */
#ifndef FCSL_MODEL_H
#define FCSL_MODEL_H

#include <math.h>

#include "fcsl/fcsl_exact_math.h"
#include "fcsl/fcsl_machine.h"
#include "fcsl/fcsl_math.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FCSL_MODEL_ABI_VERSION 4u

/* Streams of noise that each instance has, numbered from 0. A model uses one for each kind of random number, so that one
 * that it stops drawing changes none of the others. */
#define FCSL_NOISE_STREAMS 16u

/* The noise of one instance: Philox4x32-10 (Salmon et al., SC11), keyed by the seed; stream and instance are in its counter. */
typedef struct fcsl_noise fcsl_noise_t;

struct fcsl_model;

/* Services that a model may use in init, update and reset. */
typedef struct {
    int64_t time_ns;
    fcsl_noise_t *noise;
    double (*gaussian)(fcsl_noise_t *noise, uint32_t stream); /* mean 0, standard deviation 1; NaN: no such stream */
    double (*uniform)(fcsl_noise_t *noise, uint32_t stream);  /* [0, 1); NaN: no such stream */
    const struct fcsl_model *model;
} fcsl_model_context_t;

/* Which sign changes of an event function count. */
typedef enum { FCSL_FALLING = 1, FCSL_RISING = 2, FCSL_EITHER = 3 } fcsl_crossing_t;

typedef struct {
    const char *name; /* lower_snake_case */
    uint8_t crossing; /* fcsl_crossing_t */
    const char *doc;
} fcsl_model_event_t;

/* With u the inputs, p the parameters, x the continuous states and d the other states of an instance:
 *
 *   y     = output(t, x, u, p, d)        at any instant, so also within steps of the integrator
 *   dx/dt = derivative(t, x, u, p, d)
 *   d, x  = update(t, x, u, p, d)        at the rate of the instance
 *   d, x  = reset(t, x, u, p, d)         when event(t, x, u, p, d) changes its sign
 *
 * `output`, `derivative` and `event` get x as an argument: the states in `self` are older. They are pure; only `output` writes,
 * and only outputs. Whatever a function does not use is null. */
typedef struct fcsl_model {
    uint32_t abi_version;
    const char *name;
    const char *doc;
    const fcsl_field_t *fields; /* roles input, output, parameter, state; paths without the instance: "outputs.pos_z" */
    uint32_t field_count;
    uint32_t size;
    uint32_t align;
    /* Continuous states: doubles, contiguous; integrated by the simulator. If there are none, there is no derivative. */
    uint32_t continuous_offset;
    uint32_t continuous_count;
    /* For velocity Verlet: the first half of the continuous states are positions, the second half their velocities in the same
     * order, and the accelerations do not depend on velocities. */
    uint8_t is_second_order;
    /* uint8_t: zero after an update without a sample (a dropout); the channels connected to this instance are then left
     * out of the tick's sensor message. FCSL_NO_OFFSET: every update is a sample. */
    uint32_t sampled_offset;
    const fcsl_model_event_t *events;
    uint32_t event_count;

    /* Called after parameters were written: checks them, sets states. Returns null, or an error text about a parameter. */
    const char *(*init)(void *self, const fcsl_model_context_t *context);
    /* dx/dt at time t (s) for the states x. */
    void (*derivative)(const void *self, double t, const double *x, double *dx);
    /* Writes every output but those that `update` writes, from time t (s) and the states x; x is null without continuous states.
     * What `update` writes holds until the next update. Null: `update` writes all. */
    void (*output)(void *self, double t, const double *x);
    /* Called at the rate of the instance, with current inputs and states. May change any state. */
    void (*update)(void *self, const fcsl_model_context_t *context);
    /* Writes the value of each event function at time t (s) for the states x. */
    void (*event)(const void *self, double t, const double *x, double *value);
    /* Event `number` happened, at most 1 ns ago; inputs, states and outputs are those of now. May change any state. */
    void (*reset)(void *self, const fcsl_model_context_t *context, uint32_t number);
    /* The next time later than t (s) at which `derivative`, `event` or `output` jumps as a function of t; INFINITY: it never does.
     * It depends on parameters and the other states d. A step ends there: t is below that time before, and not below it after.
     * Null: they do not jump. */
    double (*next_time)(const void *self, double t);
} fcsl_model_t;

/* Exported regardless of compiler flags. */
extern __attribute__((visibility("default"))) const fcsl_model_t *const fcsl_models[];

/* Flag of an output that depends on an input of the same instant. `update` and `derivative` are no such dependency. */
#define FCSL_FIELD_FEEDTHROUGH (1u << 4)
/* In place of FCSL_ROLE_OUTPUT in the macros below: an output with this flag. */
#define FCSL_ROLE_FEEDTHROUGH (FCSL_ROLE_OUTPUT | 0x80u)
/* Flag of an input that may stay unconnected, and of a parameter that a simulation may leave out. Both are zero then: a
 * disturbance, one of several forces; an error that a sensor does not have. */
#define FCSL_FIELD_OPTIONAL (1u << 5)
/* In place of FCSL_ROLE_INPUT and FCSL_ROLE_PARAMETER in the macros below: a field with this flag. */
#define FCSL_ROLE_OPTIONAL_INPUT     (FCSL_ROLE_INPUT | 0x40u)
#define FCSL_ROLE_OPTIONAL_PARAMETER (FCSL_ROLE_PARAMETER | 0x80u)
/* Flag of a parameter that is a vector of at most so many values: a simulation gives any number of them, or the column of a
 * file, and the last one fills the rest. */
#define FCSL_FIELD_TABLE (1u << 6)
/* In place of FCSL_ROLE_PARAMETER in FCSL_MODEL_VECTOR: a parameter with this flag. */
#define FCSL_ROLE_TABLE (FCSL_ROLE_PARAMETER | 0x40u)

/* One field of a table. A model's struct has the members `inputs`, `outputs`, `parameters` and `state` (as far as it needs
 * them), so that a path is a C expression; type and shape follow from the member (bool, int32_t … double):
 *
 *   FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_OUTPUT, outputs.pos_z, "m", "height above the ground")
 *   FCSL_MODEL_SCALAR(lander_t, FCSL_ROLE_FEEDTHROUGH, outputs.wind.east, "m/s", "a member of a struct")
 *   FCSL_MODEL_VECTOR(lander_t, FCSL_ROLE_STATE, state.rate, "rad/s", "double rate[3]")
 *   FCSL_MODEL_MATRIX(lander_t, FCSL_ROLE_PARAMETER, parameters.inertia, "kg*m^2", "double inertia[3][3]")
 */
#define FCSL_MODEL_SCALAR(struct_, role_, path_, unit_, doc_)                                                          \
    FCSL_MODEL_FIELD(struct_, role_, path_, path_, 0u, NULL, unit_, doc_)
#define FCSL_MODEL_VECTOR(struct_, role_, path_, unit_, doc_)                                                          \
    FCSL_MODEL_FIELD(struct_, role_, path_, path_[0], 1u,                                                              \
                     ((const uint32_t[]){FCSL_MODEL_EXTENT(struct_, path_, path_[0])}), unit_, doc_)
#define FCSL_MODEL_MATRIX(struct_, role_, path_, unit_, doc_)                                                          \
    FCSL_MODEL_FIELD(struct_, role_, path_, path_[0][0], 2u,                                                           \
                     ((const uint32_t[]){FCSL_MODEL_EXTENT(struct_, path_, path_[0]),                                  \
                                         FCSL_MODEL_EXTENT(struct_, path_[0], path_[0][0])}),                          \
                     unit_, doc_)
#define FCSL_MODEL_EXTENT(struct_, whole_, part_)                                                                      \
    ((uint32_t)(sizeof(((struct_ *)0)->whole_) / sizeof(((struct_ *)0)->part_)))
#define FCSL_MODEL_FIELD(struct_, role_, path_, element_, rank_, shape_, unit_, doc_)                                  \
    {.path = #path_,                                                                                                   \
     .role = (uint8_t)((role_) & 0x3fu),                                                                               \
     .type = FCSL_MODEL_TYPE(((struct_ *)0)->element_),                                                                \
     .flags = FCSL_MODEL_FLAGS(role_),                                                                                 \
     .rank = (rank_),                                                                                                  \
     .shape = (shape_),                                                                                                \
     .count = FCSL_MODEL_EXTENT(struct_, path_, element_),                                                             \
     .offset = offsetof(struct_, path_),                                                                               \
     .size = sizeof(((struct_ *)0)->path_),                                                                            \
     .instance = FCSL_NONE,                                                                                            \
     .connected_from = FCSL_NONE,                                                                                      \
     .unit = (unit_),                                                                                                  \
     .doc = (doc_),                                                                                                    \
     .minimum = -(double)INFINITY,                                                                                     \
     .maximum = (double)INFINITY}
#define FCSL_MODEL_FLAGS(role_)                                                                                        \
    ((role_) == FCSL_ROLE_FEEDTHROUGH                                                 ? FCSL_FIELD_FEEDTHROUGH         \
     : (role_) == FCSL_ROLE_OPTIONAL_INPUT || (role_) == FCSL_ROLE_OPTIONAL_PARAMETER ? FCSL_FIELD_OPTIONAL            \
     : (role_) == FCSL_ROLE_TABLE                                                     ? FCSL_FIELD_TABLE               \
                                                                                      : 0u)
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
