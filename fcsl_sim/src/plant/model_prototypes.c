/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds functions of a model that have another prototype than fcsl_model.h says. Where FCSL compiles a model, the compiler does;
 * a library that was compiled elsewhere shows it only by what its functions do.
 */
#define _GNU_SOURCE
#include "model_prototypes.h"

#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "base/aligned_memory.h"
#include "fcsl/fcsl_error.h"

enum { REASON_BYTES_MAX = 1000 };

const char *fcsl_sim_init_reason(const char *returned)
{
    Dl_info in;
    size_t length = 0;
    /* A void function leaves any number in the register of the result. */
    if (dladdr(returned, &in) != 0) {
        while (length < REASON_BYTES_MAX && ((unsigned char)returned[length] >= ' ' || returned[length] == '\n')) {
            length++;
        }
    }
    return length > 0 && returned[length] == '\0'
               ? returned
               : "`init` returned neither null nor a text of its library: is it "
                 "`const char *init(void *self, const fcsl_model_context_t *context)`?";
}

/* An instance's struct, and behind it the values of `derivative` and `event`. */
typedef struct {
    fcsl_plant_t *plant;
    uint32_t index;
    const fcsl_instance_state_t *instance;
    size_t bytes;
    uint8_t *first;
    uint8_t *second;
} trial_t;

/* Calls a function with a copy of the instance, at a time with these halves. A function that takes a float gets the low one, in
 * the registers of x86-64 and of AArch64. */
static void call(const trial_t *trial, fcsl_function_t function, uint8_t *memory, uint32_t high, float low)
{
    const fcsl_model_t *model = trial->instance->model;
    uint32_t half = 0;
    memcpy(&half, &low, sizeof half);
    const uint64_t bits = (uint64_t)high << 32 | half;
    double t = 0.0;
    memcpy(&t, &bits, sizeof t);
    memset(memory, 0, trial->bytes);
    memcpy(memory, trial->instance->data, model->size);
    double *values = (double *)(void *)(memory + trial->bytes) - model->continuous_count - model->event_count;
    const double *x = model->continuous_count > 0
                          ? (const double *)(const void *)(trial->instance->data + model->continuous_offset)
                          : NULL;
    fcsl_plant_enter(trial->plant, trial->index, function);
    if (function == FCSL_IN_DERIVATIVE) {
        model->derivative(memory, t, x, values);
    } else if (function == FCSL_IN_EVENT) {
        model->event(memory, t, x, values + model->continuous_count);
    } else {
        model->output(memory, t, x);
    }
}

/* Whether a function depends on the low half of its time, and not on the high one. */
static int takes_float(const trial_t *trial, fcsl_function_t function)
{
    /* Of 1.2345 and 2.71828: no times at which a model would do something else a millionth later. */
    static const uint32_t highs[2] = {0x3ff3c083u, 0x4005bf09u};
    static const float lows[] = {0.001f, 1.0f, 2.5f, 1000.0f};
    const size_t count = sizeof lows / sizeof *lows;
    int depends = 0;
    call(trial, function, trial->first, highs[0], lows[0]);
    for (size_t i = 1; i < count; i++) {
        call(trial, function, trial->second, highs[0], lows[i]);
        depends = depends || memcmp(trial->first, trial->second, trial->bytes) != 0;
    }
    for (size_t i = 0; depends && i < count; i++) {
        call(trial, function, trial->first, highs[0], lows[i]);
        call(trial, function, trial->second, highs[1], lows[i]);
        depends = memcmp(trial->first, trial->second, trial->bytes) == 0;
    }
    return depends;
}

static const char *find_float(const trial_t *trial)
{
    const fcsl_model_t *model = trial->instance->model;
    if (model->derivative && takes_float(trial, FCSL_IN_DERIVATIVE)) {
        return "derivative";
    }
    if (model->event && takes_float(trial, FCSL_IN_EVENT)) {
        return "event";
    }
    return model->output && takes_float(trial, FCSL_IN_OUTPUT) ? "output" : NULL;
}

int fcsl_sim_check_prototypes(fcsl_plant_t *plant, uint32_t index, fcsl_error_t *error)
{
    const fcsl_instance_state_t *instance = &plant->instances[index];
    const fcsl_model_t *model = instance->model;
    const size_t values = (size_t)model->continuous_count + model->event_count;
    trial_t trial = {.plant = plant, .index = index, .instance = instance};
    trial.bytes = ((size_t)model->size + 7u) / 8u * 8u + values * sizeof(double);
    trial.first = fcsl_sim_allocate(trial.bytes, model->align);
    trial.second = fcsl_sim_allocate(trial.bytes, model->align);
    if (!trial.first || !trial.second) {
        free(trial.first);
        free(trial.second);
        return fcsl_fail(error, "no memory for instance `%s`", instance->name);
    }
    const char *wrong = find_float(&trial);
    free(trial.first);
    free(trial.second);
    return wrong ? fcsl_fail(error, "`%s` of model `%s` takes its time as a float, and fcsl_model.h says `double t`",
                             wrong, model->name)
                 : 0;
}
