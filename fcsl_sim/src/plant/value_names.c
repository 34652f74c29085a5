/* SPDX-License-Identifier: Apache-2.0
 *
 * Names of values within models, and the search for one that is no number.
 */
#include "value_names.h"

#include <math.h>
#include <stdio.h>

#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_error.h"

/* "[2]", or "[1][2]"; "" for a scalar. */
static void name_element(const fcsl_field_t *field, uint32_t element, char *text, size_t size)
{
    size_t used = 0;
    uint32_t stride = field->count;
    text[0] = '\0';
    for (uint32_t i = 0; i < field->rank && used < size; i++) {
        stride /= field->shape[i];
        used += (size_t)snprintf(text + used, size - used, "[%u]", element / stride % field->shape[i]);
    }
}

void fcsl_sim_name_value(const fcsl_instance_state_t *instance, size_t offset, char *text, size_t size)
{
    const fcsl_model_t *model = instance->model;
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        if (offset >= field->offset && offset < (size_t)field->offset + field->size) {
            char element[64];
            name_element(field, (uint32_t)((offset - field->offset) / fcsl_scalar_size(field->type)), element,
                         sizeof element);
            (void)snprintf(text, size, "%s.%s%s", instance->name, field->path, element);
            return;
        }
    }
    const size_t state = (offset - model->continuous_offset) / sizeof(double);
    if (offset >= model->continuous_offset && state < model->continuous_count) {
        (void)snprintf(text, size, "continuous state %zu of %s", state, instance->name);
    } else {
        (void)snprintf(text, size, "byte %zu of the struct of %s, which is in no field", offset, instance->name);
    }
}

static double value_at(const uint8_t *from, uint8_t type)
{
    float single;
    double value;
    if (type == FCSL_F32) {
        memcpy(&single, from, sizeof single);
        return (double)single;
    }
    memcpy(&value, from, sizeof value);
    return value;
}

static int check_field(const fcsl_plant_t *plant, const fcsl_instance_state_t *instance, const fcsl_field_t *field,
                       fcsl_error_t *error)
{
    const uint32_t scalar = fcsl_scalar_size(field->type);
    for (uint32_t i = 0; i < field->count; i++) {
        const double value = value_at(instance->data + field->offset + (size_t)i * scalar, field->type);
        if (!isfinite(value)) {
            char name[FCSL_VALUE_NAME_BYTES];
            fcsl_sim_name_value(instance, field->offset + (size_t)i * scalar, name, sizeof name);
            return fcsl_fail(error, "%s became %g at %.9f s", name, isnan(value) ? (double)NAN : value,
                             (double)plant->time_ns / 1e9);
        }
    }
    return 0;
}

int fcsl_sim_check_outputs(const fcsl_plant_t *plant, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < plant->instance_count; i++) {
        const fcsl_model_t *model = plant->instances[i].model;
        for (uint32_t f = 0; f < model->field_count; f++) {
            const fcsl_field_t *field = &model->fields[f];
            if (field->role == FCSL_ROLE_OUTPUT && (field->type == FCSL_F64 || field->type == FCSL_F32) &&
                check_field(plant, &plant->instances[i], field, error)) {
                return -1;
            }
        }
    }
    return 0;
}
