/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds models that break the rules of fcsl_model.h, by trying their functions once on a copy: functions that change what they may
 * only read, and outputs that depend on an input without saying so.
 */
#include "model_contract.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "base/aligned_memory.h"
#include "fcsl/fcsl_error.h"
#include "value_names.h"

typedef struct {
    fcsl_plant_t *plant;
    uint32_t index;
    const fcsl_instance_state_t *instance;
    uint8_t *before;
    uint8_t *after;
    double *scratch; /* derivatives, or event functions */
} trial_t;

static double *states_in(const fcsl_model_t *model, uint8_t *data)
{
    return model->continuous_count > 0 ? (double *)(void *)(data + model->continuous_offset) : NULL;
}

static int is_output(const fcsl_model_t *model, uint32_t offset)
{
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        if (field->role == FCSL_ROLE_OUTPUT && offset >= field->offset && offset - field->offset < field->size) {
            return 1;
        }
    }
    return 0;
}

static int check_unchanged(const trial_t *trial, const char *function, int may_write_outputs, fcsl_error_t *error)
{
    const fcsl_model_t *model = trial->instance->model;
    for (uint32_t i = 0; i < model->size; i++) {
        if (trial->before[i] != trial->after[i] && !(may_write_outputs && is_output(model, i))) {
            char name[FCSL_VALUE_NAME_BYTES];
            fcsl_sim_name_value(trial->instance, i, name, sizeof name);
            return fcsl_fail(error, "`%s` of model `%s` changes %s%s; states change in `update` and `reset`", function,
                             model->name, name, may_write_outputs ? ", which is no output" : "");
        }
    }
    return 0;
}

static void change_inputs(const fcsl_model_t *model, uint8_t *data)
{
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        for (uint32_t k = 0; field->role == FCSL_ROLE_INPUT && k < field->count; k++) {
            double value;
            float single;
            if (field->type == FCSL_F64) {
                uint8_t *at = data + field->offset + (size_t)k * sizeof value;
                memcpy(&value, at, sizeof value);
                value += 0.75;
                memcpy(at, &value, sizeof value);
            } else if (field->type == FCSL_F32) {
                uint8_t *at = data + field->offset + (size_t)k * sizeof single;
                memcpy(&single, at, sizeof single);
                single += 0.75f;
                memcpy(at, &single, sizeof single);
            } else { /* the lowest bit, the first byte in memory */
                data[field->offset + (size_t)k * fcsl_scalar_size(field->type)] ^= 1u;
            }
        }
    }
}

static int check_feedthrough(const trial_t *trial, fcsl_error_t *error)
{
    const fcsl_model_t *model = trial->instance->model;
    memcpy(trial->before, trial->after, model->size);
    change_inputs(model, trial->after);
    model->output(trial->after, 0.0, states_in(model, trial->after));
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        if (field->role == FCSL_ROLE_OUTPUT && (field->flags & FCSL_FIELD_FEEDTHROUGH) == 0 &&
            memcmp(trial->before + field->offset, trial->after + field->offset, field->size) != 0) {
            return fcsl_fail(error,
                             "model `%s`: `%s` depends on an input of the same instant, and is not declared so; "
                             "give it the role FCSL_ROLE_FEEDTHROUGH",
                             model->name, field->path);
        }
    }
    return 0;
}

/* Other states and outputs in the struct than in x, where these are not what a function may read. */
static void change_what_is_older(const fcsl_model_t *model, uint8_t *data)
{
    double *x = states_in(model, data);
    for (uint32_t i = 0; i < model->continuous_count; i++) {
        x[i] += 0.75;
    }
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        for (uint32_t k = 0; field->role == FCSL_ROLE_OUTPUT && field->type == FCSL_F64 && k < field->count; k++) {
            const double value = 0.625;
            memcpy(data + field->offset + (size_t)k * sizeof value, &value, sizeof value);
        }
    }
}

/* Behind what a function may write; it finds these bits there again. */
enum { GUARDS = 4 };

/* Fills derivatives and event values with a number that no model computes, calls both functions, and checks the guards. */
static int call_both(const trial_t *trial, uint8_t *self, const double *x, uint64_t mark, double *values,
                     fcsl_error_t *error)
{
    const fcsl_model_t *model = trial->instance->model;
    const uint32_t n = model->continuous_count;
    double *events = values + n + GUARDS;
    for (uint32_t i = 0; i < n + model->event_count + 2u * GUARDS; i++) {
        memcpy(&values[i], &mark, sizeof mark);
    }
    if (model->derivative) {
        fcsl_plant_enter(trial->plant, trial->index, FCSL_IN_DERIVATIVE);
        model->derivative(self, 0.0, x, values);
    }
    if (model->event) {
        fcsl_plant_enter(trial->plant, trial->index, FCSL_IN_EVENT);
        model->event(self, 0.0, x, events);
    }
    if (model->next_time) {
        fcsl_plant_enter(trial->plant, trial->index, FCSL_IN_NEXT_TIME);
        (void)model->next_time(self, 0.0);
    }
    for (uint32_t i = 0; i < GUARDS; i++) {
        if (memcmp(&values[n + i], &mark, sizeof mark) != 0 ||
            memcmp(&events[model->event_count + i], &mark, sizeof mark) != 0) {
            return fcsl_fail(error, "`derivative` or `event` of model `%s` writes more values than the model has",
                             model->name);
        }
    }
    return 0;
}

/* Fails where a function has left a value as it was marked. */
static int check_written(const trial_t *trial, const double *first, const double *second, const uint64_t marks[2],
                         fcsl_error_t *error)
{
    const fcsl_model_t *model = trial->instance->model;
    const uint32_t n = model->continuous_count;
    for (uint32_t i = 0; i < n + GUARDS + model->event_count; i++) {
        const int is_mark =
            memcmp(&first[i], &marks[0], sizeof *first) == 0 && memcmp(&second[i], &marks[1], sizeof *second) == 0;
        if (is_mark && i < n) {
            char name[FCSL_VALUE_NAME_BYTES];
            fcsl_sim_name_value(trial->instance, model->continuous_offset + i * sizeof *first, name, sizeof name);
            return fcsl_fail(error, "`derivative` of model `%s` does not write dx[%u], that of %s", model->name, i,
                             name);
        }
        if (is_mark && i >= n + GUARDS) {
            return fcsl_fail(error, "`event` of model `%s` does not write value[%u], that of `%s`", model->name,
                             i - n - GUARDS, model->events[i - n - GUARDS].name);
        }
    }
    return 0;
}

/* Whether `derivative` and `event` write all their values, take states from their argument, and nothing from outputs. */
static int check_argument(const trial_t *trial, fcsl_error_t *error)
{
    static const uint64_t marks[2] = {UINT64_C(0x7ff8feed00000001), UINT64_C(0x7ff8feed00000002)};
    const fcsl_model_t *model = trial->instance->model;
    const uint32_t n = model->continuous_count;
    const uint32_t count = n + model->event_count + 2u * GUARDS;
    double *first = trial->scratch;
    double *second = first + count;
    double *x = second + count;
    memcpy(trial->after, trial->before, model->size);
    if (n > 0) {
        memcpy(x, states_in(model, trial->before), n * sizeof *x);
    }
    change_what_is_older(model, trial->after);
    if (call_both(trial, trial->before, n > 0 ? x : NULL, marks[0], first, error) ||
        call_both(trial, trial->after, n > 0 ? x : NULL, marks[1], second, error) ||
        check_written(trial, first, second, marks, error)) {
        return -1;
    }
    for (uint32_t i = 0; i < count; i++) {
        const int is_guard = (i >= n && i < n + GUARDS) || i >= n + GUARDS + model->event_count;
        if (!is_guard && memcmp(&first[i], &second[i], sizeof *first) != 0 && !(isnan(first[i]) && isnan(second[i]))) {
            return fcsl_fail(error,
                             "`%s` of model `%s` reads integrated states, or outputs, in the struct: they are older "
                             "than its argument; take the states from x",
                             i < n ? "derivative" : "event", model->name);
        }
    }
    return 0;
}

/* Whether `output` writes the double at this offset. */
static int is_written(const trial_t *trial, size_t offset)
{
    static const double marks[2] = {0x1.23456789p-300, 0x1.3456789ap-300};
    const fcsl_model_t *model = trial->instance->model;
    int kept = 0;
    for (int pass = 0; pass < 2; pass++) {
        memcpy(trial->after, trial->before, model->size);
        memcpy(trial->after + offset, &marks[pass], sizeof marks[pass]);
        model->output(trial->after, 0.0, states_in(model, trial->after));
        kept += memcmp(trial->after + offset, &marks[pass], sizeof marks[pass]) == 0;
    }
    return kept < 2;
}

/* Whether `output` writes all outputs that are doubles. */
static int check_outputs_written(const trial_t *trial, fcsl_error_t *error)
{
    const fcsl_model_t *model = trial->instance->model;
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        for (uint32_t k = 0; field->role == FCSL_ROLE_OUTPUT && field->type == FCSL_F64 && k < field->count; k++) {
            const size_t offset = field->offset + (size_t)k * sizeof(double);
            if (!is_written(trial, offset)) {
                char name[FCSL_VALUE_NAME_BYTES];
                fcsl_sim_name_value(trial->instance, offset, name, sizeof name);
                return fcsl_fail(error, "`output` of model `%s` does not write %s", model->name, name);
            }
        }
    }
    return 0;
}

static int try_functions(const trial_t *trial, fcsl_error_t *error)
{
    const fcsl_model_t *model = trial->instance->model;
    memcpy(trial->before, trial->instance->data, model->size);
    memcpy(trial->after, trial->instance->data, model->size);
    if (check_argument(trial, error)) {
        return -1;
    }
    /* `before` went through both functions. */
    memcpy(trial->after, trial->before, model->size);
    memcpy(trial->before, trial->instance->data, model->size);
    if (check_unchanged(trial, "derivative`, `event` or `next_time", 0, error)) {
        return -1;
    }
    if (model->output) {
        fcsl_plant_enter(trial->plant, trial->index, FCSL_IN_OUTPUT);
        if (!model->update && check_outputs_written(trial, error)) { /* what `update` writes holds */
            return -1;
        }
        memcpy(trial->after, trial->before, model->size);
        model->output(trial->after, 0.0, states_in(model, trial->after));
        return check_unchanged(trial, "output", 1, error) || check_feedthrough(trial, error) ? -1 : 0;
    }
    return 0;
}

int fcsl_sim_check_contract(fcsl_plant_t *plant, uint32_t index, fcsl_error_t *error)
{
    const fcsl_instance_state_t *instance = &plant->instances[index];
    const fcsl_model_t *model = instance->model;
    trial_t trial = {.plant = plant, .index = index, .instance = instance};
    trial.before = fcsl_sim_allocate(model->size, model->align);
    trial.after = fcsl_sim_allocate(model->size, model->align);
    trial.scratch =
        calloc(3u * ((size_t)model->continuous_count + model->event_count) + 4u * GUARDS + 1u, sizeof *trial.scratch);
    const int failed = !trial.before || !trial.after || !trial.scratch
                           ? fcsl_fail(error, "no memory for instance `%s`", instance->name)
                           : try_functions(&trial, error);
    free(trial.before);
    free(trial.after);
    free(trial.scratch);
    return failed;
}
