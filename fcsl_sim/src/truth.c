/* SPDX-License-Identifier: Apache-2.0
 *
 * The plant's outputs as ROS 2 messages: a type generated from each model's field table, and its CDR.
 */
#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "fail.h"
#include "fcsl/fcsl_scalar.h"
#include "model.h"
#include "sim_internal.h"

#define RULE "================================================================================\n"

static const char dependencies[] = RULE "MSG: std_msgs/Header\n"
                                        "builtin_interfaces/Time stamp\n"
                                        "string frame_id\n" RULE "MSG: builtin_interfaces/Time\n"
                                        "int32 sec\n"
                                        "uint32 nanosec\n";

static const char *ros_type(uint8_t type)
{
    switch (type) {
    case FCSL_BOOL:
        return "bool";
    case FCSL_I32:
        return "int32";
    case FCSL_I64:
        return "int64";
    case FCSL_U32:
        return "uint32";
    case FCSL_U64:
        return "uint64";
    case FCSL_F32:
        return "float32";
    default:
        return "float64";
    }
}

/* "lander_plant" -> "fcsl_sim/msg/LanderPlant"; the name is lower_snake_case, checked at load. */
static char *build_type(const char *name)
{
    static const char prefix[] = "fcsl_sim/msg/";
    char *text = malloc(sizeof prefix + strlen(name));
    if (!text) {
        return NULL;
    }
    char *out = text + sizeof prefix - 1;
    memcpy(text, prefix, sizeof prefix);
    for (const char *c = name; *c; c++) {
        const int first = c == name || c[-1] == '_';
        if (*c != '_') {
            *out++ = (char)(first && *c >= 'a' && *c <= 'z' ? *c - 'a' + 'A' : *c);
        }
    }
    *out = '\0';
    return text;
}

static char *build_schema(const fcsl_model_t *model)
{
    size_t capacity = 256 + sizeof dependencies;
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        capacity += 64 + strlen(field->path) + strlen(field->unit) + strlen(field->doc);
    }
    char *text = malloc(capacity);
    if (!text) {
        return NULL;
    }
    size_t used = (size_t)snprintf(text, capacity, "std_msgs/Header header\n");
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        if (field->role != FCSL_ROLE_OUTPUT) {
            continue;
        }
        char extent[16] = "";
        if (field->rank) {
            (void)snprintf(extent, sizeof extent, "[%u]", field->count);
        }
        used += (size_t)snprintf(text + used, capacity - used, "%s%s %s  # %s%s%s\n", ros_type(field->type), extent,
                                 field->path + strlen("outputs."), field->unit,
                                 field->unit[0] && field->doc[0] ? ", " : "", field->doc);
    }
    (void)snprintf(text + used, capacity - used, "%s", dependencies);
    return text;
}

/* ---- CDR ------------------------------------------------------------------------------------------------------------- */

typedef struct {
    uint8_t *bytes; /* null: only measure */
    size_t capacity;
    size_t used;
} cdr_t;

/* Appends `size` bytes at a multiple of `align`, counted from the end of the encapsulation header; padding is zero. */
static void put(cdr_t *cdr, const void *value, uint32_t size, uint32_t align)
{
    const size_t at = cdr->used < 4 ? cdr->used : (cdr->used - 4 + align - 1) / align * align + 4;
    if (cdr->bytes && at + size <= cdr->capacity) {
        memset(cdr->bytes + cdr->used, 0, at - cdr->used);
        memcpy(cdr->bytes + at, value, size);
    }
    cdr->used = at + size;
}

static size_t write_message(const fcsl_instance_state_t *instance, int64_t time_ns, uint8_t *bytes, size_t capacity)
{
    static const uint8_t encapsulation[4] = {0, 1, 0, 0};
    const fcsl_model_t *model = instance->model;
    uint8_t word[4];
    cdr_t cdr = {bytes, capacity, 0};
    put(&cdr, encapsulation, 4, 1);
    fcsl_put_u32(word, (uint32_t)(time_ns / FCSL_NS_PER_S));
    put(&cdr, word, 4, 4);
    fcsl_put_u32(word, (uint32_t)(time_ns % FCSL_NS_PER_S));
    put(&cdr, word, 4, 4);
    fcsl_put_u32(word, 1); /* an empty frame_id: its length with the null byte */
    put(&cdr, word, 4, 4);
    put(&cdr, "", 1, 1);
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        if (field->role != FCSL_ROLE_OUTPUT) {
            continue;
        }
        const uint32_t scalar = fcsl_scalar_size(field->type);
        for (uint32_t j = 0; j < field->count; j++) {
            uint8_t value[8];
            fcsl_scalars_export(value, instance->data + field->offset + j * scalar, field->type, 1);
            put(&cdr, value, scalar, scalar);
        }
    }
    return cdr.used;
}

/* ---- building ------------------------------------------------------------------------------------------------------------ */

int fcsl_truth_build(fcsl_sim_t *sim, fcsl_error_t *error)
{
    uint32_t largest = 1;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->instances[i];
        instance->truth_type = build_type(instance->model->name);
        instance->truth_schema = build_schema(instance->model);
        if (!instance->truth_type || !instance->truth_schema) {
            return fcsl_sim_fail(error, "no memory for message types");
        }
        instance->truth_size = (uint32_t)write_message(instance, 0, NULL, 0);
        if (instance->truth_size > largest) {
            largest = instance->truth_size;
        }
    }
    sim->truth = malloc(largest);
    return sim->truth ? 0 : fcsl_sim_fail(error, "no memory for messages");
}

void fcsl_truth_free(fcsl_sim_t *sim)
{
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        free(sim->instances[i].truth_type);
        free(sim->instances[i].truth_schema);
    }
    free(sim->truth);
}

const char *fcsl_sim_truth_type(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->instance_count ? sim->instances[instance].truth_type : NULL;
}

const char *fcsl_sim_truth_schema(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->instance_count ? sim->instances[instance].truth_schema : NULL;
}

int64_t fcsl_sim_truth_message(const fcsl_sim_t *sim, uint32_t instance, uint8_t *cdr, size_t capacity)
{
    if (instance >= sim->instance_count || capacity < sim->instances[instance].truth_size) {
        return -1;
    }
    return (int64_t)write_message(&sim->instances[instance], sim->time_ns, cdr, capacity);
}

/* ---- as numbers ---------------------------------------------------------------------------------------------------------- */

double fcsl_as_double(uint64_t bits, uint8_t type)
{
    const uint32_t low = (uint32_t)bits;
    float f32;
    double f64;
    switch (type) {
    case FCSL_I32:
        return (double)(int32_t)low;
    case FCSL_I64:
        return (double)(int64_t)bits;
    case FCSL_F32:
        memcpy(&f32, &low, sizeof f32);
        return (double)f32;
    case FCSL_F64:
        memcpy(&f64, &bits, sizeof f64);
        return f64;
    default:
        return (double)bits;
    }
}

uint32_t fcsl_sim_truth_values(const fcsl_sim_t *sim, double *values, uint32_t capacity)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->instances[i];
        for (uint32_t f = 0; f < instance->model->field_count; f++) {
            const fcsl_field_t *field = &instance->model->fields[f];
            for (uint32_t j = 0; field->role == FCSL_ROLE_OUTPUT && j < field->count; j++, count++) {
                uint8_t bytes[8] = {0};
                const uint32_t scalar = fcsl_scalar_size(field->type);
                fcsl_scalars_export(bytes, instance->data + field->offset + j * scalar, field->type, 1);
                if (count < capacity) {
                    values[count] = fcsl_as_double(fcsl_get_u64(bytes), field->type);
                }
            }
        }
    }
    return count;
}
