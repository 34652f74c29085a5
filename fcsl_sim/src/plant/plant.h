/* SPDX-License-Identifier: Apache-2.0
 *
 * The plant: instances of models, what connects them, and the order in which they are called.
 */
#ifndef FCSL_SIM_PLANT_H
#define FCSL_SIM_PLANT_H

#include <stdatomic.h>
#include <string.h>

#include "models/machine_model.h"
#include "models/noise.h"
#include "plan/plan.h"

#define FCSL_NO_COMPANION UINT32_MAX

/* One value copied from an output (or an actuator channel) to an input. */
typedef struct {
    const uint8_t *from;
    uint8_t *to;
    uint32_t size;
    uint32_t instance;  /* instance of the input */
    uint32_t source;    /* of the output; UINT32_MAX: a controller */
    uint32_t companion; /* whose actuator it is; FCSL_NO_COMPANION: not a companion's */
    uint32_t is_inner;  /* 1: an output that is evaluated whenever the input is used, within a group */
} fcsl_copy_t;

typedef struct {
    const char *name; /* in the plan */
    const fcsl_model_t *model;
    const fcsl_machine_model_t *machine; /* null: a plugin */
    uint8_t *data;
    fcsl_noise_t noise;
    uint32_t group;       /* or FCSL_PLAN_NO_GROUP */
    uint32_t first_state; /* in the vectors of its group */
    uint32_t first_event;
    uint64_t hz; /* of the grid of its updates; 0: it is not updated */
    uint64_t every;
    int64_t next_update_ns; /* INT64_MAX: none */
    uint64_t next_update;   /* the step of the grid */
    uint32_t first_copy;  /* its inputs: copies[first_copy .. first_copy + copy_count) */
    uint32_t copy_count;
    uint32_t outer_count; /* of them, those from outside of its group, which come first */
    uint32_t inner_count;
    uint8_t due;      /* its update is at the present */
    uint64_t samples; /* taken so far */
} fcsl_instance_state_t;

/* What models do at an instant, in order. */
typedef struct {
    uint32_t instance;
    fcsl_call_kind_t kind;
} fcsl_call_t;

/* Which function of which instance runs (for whoever finds that it does not end). */
typedef enum {
    FCSL_IN_NONE,
    FCSL_IN_INIT,
    FCSL_IN_DERIVATIVE,
    FCSL_IN_OUTPUT,
    FCSL_IN_UPDATE,
    FCSL_IN_EVENT,
    FCSL_IN_RESET,
    FCSL_IN_NEXT_TIME
} fcsl_function_t;

typedef struct {
    fcsl_instance_state_t *instances;
    uint32_t instance_count;
    fcsl_copy_t *copies; /* by instance of the input */
    uint32_t copy_count;
    fcsl_call_t *calls;
    uint32_t call_count;
    int64_t time_ns;        /* present */
    _Atomic uint64_t running_call; /* call, instance and function that run (fcsl_plant_enter) */
    uint64_t entries;       /* calls so far */
} fcsl_plant_t;

/* Copies inputs. */
static inline void fcsl_plant_copy(const fcsl_plant_t *plant, uint32_t first, uint32_t count)
{
    for (const fcsl_copy_t *copy = plant->copies + first, *end = copy + count; copy < end; copy++) {
        if (copy->size == sizeof(double)) {
            memcpy(copy->to, copy->from, sizeof(double));
        } else {
            memcpy(copy->to, copy->from, copy->size);
        }
    }
}

/* Copies one input; whether it was another one. */
static inline int fcsl_plant_copy_changed(const fcsl_copy_t *copy)
{
    const int changed = memcmp(copy->to, copy->from, copy->size) != 0;
    if (changed) {
        memcpy(copy->to, copy->from, copy->size);
    }
    return changed;
}

/* Names the function for the watchdog, and for the report of a crash. */
static inline void fcsl_plant_enter(fcsl_plant_t *plant, uint32_t instance, fcsl_function_t function)
{
    const uint64_t call = ++plant->entries << 24 | (uint64_t)instance << 8 | (uint64_t)function;
    atomic_store_explicit(&plant->running_call, call, memory_order_relaxed);
}

static inline fcsl_model_context_t fcsl_plant_context(fcsl_plant_t *plant, uint32_t instance, int64_t time_ns)
{
    return (fcsl_model_context_t){time_ns, &plant->instances[instance].noise, fcsl_noise_gaussian, fcsl_noise_uniform,
                                  plant->instances[instance].model};
}

#endif /* FCSL_SIM_PLANT_H */
