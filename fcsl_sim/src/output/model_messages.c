/* SPDX-License-Identifier: Apache-2.0
 *
 * The plant's outputs as ROS 2 messages: a type generated from each model's field table, and its CDR.
 */
#include "model_messages.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_cdr.h"
#include "fcsl/fcsl_scalar.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "base/scalar_bits.h"
#include "models/model.h"

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

/* "outputs.wind.east" -> "wind_east": a member of a struct as a field of its own. */
static void flatten(const char *path, char name[FCSL_MODEL_MAX_PATH + 1u])
{
    (void)snprintf(name, FCSL_MODEL_MAX_PATH + 1u, "%s", path + strlen("outputs."));
    for (char *c = name; *c; c++) {
        *c = *c == '.' ? '_' : *c;
    }
}

static char *build_schema(const fcsl_model_t *model)
{
    size_t capacity = 256 + sizeof FCSL_SCHEMA_HEADER;
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
        char name[FCSL_MODEL_MAX_PATH + 1u];
        flatten(field->path, name);
        if (field->rank) {
            (void)snprintf(extent, sizeof extent, "[%u]", field->count);
        }
        used += (size_t)snprintf(text + used, capacity - used, "%s%s %s  # %s%s%s%s\n", ros_type(field->type), extent,
                                 name, field->unit[0] ? "[" : "", field->unit, field->unit[0] ? "] " : "", field->doc);
    }
    (void)snprintf(text + used, capacity - used, FCSL_SCHEMA_HEADER);
    return text;
}

/* ---- CDR ------------------------------------------------------------------------------------------------------------- */

static void write_scalar(fcsl_cdr_t *cdr, const uint8_t *from, uint8_t type)
{
    uint8_t value[8] = {0};
    fcsl_scalars_export(value, from, type, 1);
    switch (fcsl_scalar_size(type)) {
    case 1:
        fcsl_cdr_u8(cdr, value[0]);
        break;
    case 4:
        fcsl_cdr_u32(cdr, fcsl_get_u32(value));
        break;
    default:
        fcsl_cdr_u64(cdr, fcsl_get_u64(value));
        break;
    }
}

size_t fcsl_model_message_write(int64_t time_ns, const fcsl_instance_state_t *instance, uint8_t *cdr_bytes,
                                size_t capacity)
{
    const fcsl_model_t *model = instance->model;
    fcsl_cdr_t cdr;
    fcsl_cdr_begin(&cdr, cdr_bytes, capacity);
    fcsl_cdr_header(&cdr, (uint64_t)time_ns);
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        const uint32_t scalar = fcsl_scalar_size(field->type);
        for (uint32_t j = 0; field->role == FCSL_ROLE_OUTPUT && j < field->count; j++) {
            write_scalar(&cdr, instance->data + field->offset + (size_t)j * scalar, field->type);
        }
    }
    return fcsl_cdr_end(&cdr);
}

/* More than a message of the model takes: 16 bytes of header, and each scalar with its padding. */
static size_t message_bytes_max(const fcsl_model_t *model)
{
    size_t size = 32;
    for (uint32_t i = 0; i < model->field_count; i++) {
        size += model->fields[i].count * (size_t)fcsl_scalar_size(model->fields[i].type) + 8u;
    }
    return size;
}

/* ---- building ------------------------------------------------------------------------------------------------------------ */

static int describe(const fcsl_sim_t *sim, const fcsl_instance_state_t *instance, fcsl_model_message_t *message,
                    size_t largest, fcsl_error_t *error)
{
    message->type = build_type(instance->model->name);
    message->schema = build_schema(instance->model);
    if (!message->type || !message->schema) {
        return fcsl_fail(error, "no memory for message types");
    }
    message->size = (uint32_t)fcsl_model_message_write(sim->plant.time_ns, instance, sim->model_message_bytes, largest);
    return 0;
}

int fcsl_model_messages_build(fcsl_sim_t *sim, fcsl_error_t *error)
{
    size_t largest = sim->actuators ? message_bytes_max(&sim->actuators->model) : 0;
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        const size_t size = message_bytes_max(sim->plant.instances[i].model);
        largest = size > largest ? size : largest;
    }
    sim->model_messages = calloc(sim->plant.instance_count + 1u, sizeof *sim->model_messages);
    sim->model_message_bytes = malloc(largest);
    if (!sim->model_messages || !sim->model_message_bytes) {
        return fcsl_fail(error, "no memory for messages");
    }
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        if (describe(sim, &sim->plant.instances[i], &sim->model_messages[i], largest, error)) {
            return -1;
        }
    }
    fcsl_actuators_t *actuators = sim->actuators;
    return actuators ? describe(sim, &actuators->as_instance, &actuators->message, largest, error) : 0;
}

static void free_texts(fcsl_model_message_t *message)
{
    free(message->type);
    free(message->schema);
}

void fcsl_model_messages_free(fcsl_sim_t *sim)
{
    for (uint32_t i = 0; sim->model_messages && i < sim->plant.instance_count; i++) {
        free_texts(&sim->model_messages[i]);
    }
    if (sim->actuators) {
        free_texts(&sim->actuators->message);
    }
    free(sim->model_messages);
    free(sim->model_message_bytes);
}

const char *fcsl_sim_model_message_type(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->model_messages[instance].type : NULL;
}

const char *fcsl_sim_model_message_schema(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->model_messages[instance].schema : NULL;
}

int64_t fcsl_sim_model_message(const fcsl_sim_t *sim, uint32_t instance, uint8_t *cdr, size_t capacity)
{
    if (instance >= sim->plant.instance_count || capacity < sim->model_messages[instance].size) {
        return -1;
    }
    return (int64_t)fcsl_model_message_write(sim->plant.time_ns, &sim->plant.instances[instance], cdr, capacity);
}

/* ---- as numbers ---------------------------------------------------------------------------------------------------------- */

uint32_t fcsl_sim_truth_values(const fcsl_sim_t *sim, double *values, uint32_t capacity)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->plant.instances[i];
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
