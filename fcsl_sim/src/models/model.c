/* SPDX-License-Identifier: Apache-2.0
 *
 * Loads and checks model plugins.
 */
#include "model.h"

#include <dlfcn.h>
#include <string.h>

#include "fcsl/fcsl_library.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_error.h"

/* A longer table counts as one without its null terminator. */
#define MAX_MODELS_PER_LIBRARY 256

static const char *role_prefix(uint8_t role)
{
    switch (role) {
    case FCSL_ROLE_INPUT:
        return "inputs.";
    case FCSL_ROLE_OUTPUT:
        return "outputs.";
    case FCSL_ROLE_PARAMETER:
        return "parameters.";
    case FCSL_ROLE_STATE:
        return "state.";
    default:
        return NULL;
    }
}

/* Output names become ROS 2 message fields, so the stricter rule applies to all names. */
static int is_field_name(const char *name)
{
    if (*name < 'a' || *name > 'z') {
        return 0;
    }
    for (const char *c = name; *c; c++) {
        if (!((*c >= 'a' && *c <= 'z') || (*c >= '0' && *c <= '9') || *c == '_')) {
            return 0;
        }
    }
    const size_t length = strlen(name);
    return name[length - 1] != '_' && !strstr(name, "__");
}

/* Members of structs are joined with dots: "wind.east". */
static int is_member_path(const char *path)
{
    char name[FCSL_MODEL_MAX_PATH + 1u];
    while (*path) {
        const size_t length = strcspn(path, ".");
        if (length == 0 || length > FCSL_MODEL_MAX_PATH) {
            return 0;
        }
        memcpy(name, path, length);
        name[length] = '\0';
        if (!is_field_name(name)) {
            return 0;
        }
        path += length;
        if (*path == '.' && *++path == '\0') {
            return 0;
        }
    }
    return 1;
}

/* The error in one field, or null. */
static const char *check_field(const fcsl_model_t *model, const fcsl_field_t *field)
{
    const char *prefix = role_prefix(field->role);
    if (!prefix) {
        return "its role is not input, output, parameter or state";
    }
    if (strncmp(field->path, prefix, strlen(prefix)) != 0) {
        return "its path does not begin with its role";
    }
    if (strlen(field->path) > FCSL_MODEL_MAX_PATH || !field->path[strlen(prefix)] ||
        !is_member_path(field->path + strlen(prefix))) {
        return "its name is not lower_snake_case";
    }
    if (strcmp(field->path, "outputs.header") == 0) {
        return "the message that carries it has a header of its own";
    }
    const uint32_t scalar = fcsl_scalar_size(field->type);
    if (field->type > FCSL_F64) {
        return "models have no such type";
    }
    if (field->rank && !field->shape) {
        return "it has a rank but no shape";
    }
    uint64_t count = 1;
    for (uint32_t i = 0; i < field->rank; i++) {
        count *= field->shape[i];
        if (count == 0 || count > FCSL_MODEL_MAX_BYTES) {
            return "its shape is empty or too large";
        }
    }
    if (field->count != count) {
        return "its count is not the product of its shape";
    }
    if (field->size != count * scalar) {
        return "its size is not that of its scalars";
    }
    if (field->offset > model->size || field->size > model->size - field->offset) {
        return "it lies outside the struct";
    }
    if (field->offset % scalar) {
        return "its offset is not aligned";
    }
    if ((field->flags & FCSL_FIELD_FEEDTHROUGH) != 0 && (field->role != FCSL_ROLE_OUTPUT || !model->output)) {
        return "only an output that `output` writes depends on inputs of the same instant";
    }
    if ((field->flags & FCSL_FIELD_OPTIONAL) != 0 && field->role != FCSL_ROLE_INPUT &&
        field->role != FCSL_ROLE_PARAMETER) {
        return "only an input or a parameter is optional";
    }
    if ((field->flags & FCSL_FIELD_TABLE) != 0 &&
        (field->role != FCSL_ROLE_PARAMETER || field->rank != 1 || field->type != FCSL_F64)) {
        return "only a parameter that is a vector of doubles is a table";
    }
    if (!field->unit || !field->doc) {
        return "its unit or doc is null";
    }
    return NULL;
}

/* The error in the descriptor as a whole, or null. */
static const char *check_descriptor(const fcsl_model_t *model)
{
    if (strlen(model->name) > 64 || !is_field_name(model->name)) {
        return "its name is not lower_snake_case";
    }
    if (!model->doc) {
        return "its doc is null";
    }
    if (!model->update && !model->output) {
        return "it has neither `output` nor `update`: nothing writes its outputs";
    }
    if (model->continuous_count && !model->output) {
        return "it has continuous states and no `output`";
    }
    if (model->is_second_order && (model->continuous_count == 0 || model->continuous_count % 2u != 0)) {
        return "it is of second order without as many velocities as positions";
    }
    if ((model->event_count > 0) != (model->event != NULL) || (model->event_count > 0) != (model->reset != NULL) ||
        (model->event_count > 0 && !model->events)) {
        return "it must have `events`, `event` and `reset` together, or none of them";
    }
    if (model->event_count > 0 && !model->output) {
        return "it has events and no `output`: its inputs would be those of its last update";
    }
    if (model->event_count > FCSL_MODEL_MAX_EVENTS) {
        return "it has too many events";
    }
    for (uint32_t i = 0; i < model->event_count; i++) {
        const fcsl_model_event_t *event = &model->events[i];
        if (!event->name || !is_field_name(event->name) || !event->doc || event->crossing < FCSL_FALLING ||
            event->crossing > FCSL_EITHER) {
            return "an event has no name in lower_snake_case, no doc or no crossing";
        }
    }
    if (model->size == 0 || model->size > FCSL_MODEL_MAX_BYTES) {
        return "its size is zero or above 1 MiB";
    }
    if (model->align == 0 || model->align > 64 || (model->align & (model->align - 1))) {
        return "its alignment is not a small power of 2";
    }
    if (model->field_count > FCSL_MODEL_MAX_FIELDS || (model->field_count && !model->fields)) {
        return "it has too many fields, or none where it says so";
    }
    if ((model->continuous_count > 0) != (model->derivative != NULL)) {
        return "it must have a derivative exactly when it has continuous states";
    }
    if (model->continuous_count > FCSL_MODEL_MAX_CONTINUOUS) {
        return "it has too many continuous states";
    }
    if (model->continuous_count) {
        const uint64_t end = (uint64_t)model->continuous_offset + 8u * (uint64_t)model->continuous_count;
        if (end > model->size || model->continuous_offset % 8) {
            return "its continuous states lie outside the struct or unaligned";
        }
    }
    if (model->sampled_offset != FCSL_NO_OFFSET && model->sampled_offset >= model->size) {
        return "its sampled byte lies outside the struct";
    }
    return NULL;
}

/* The error in what the table says of places that the descriptor names, or null. */
static const char *check_places(const fcsl_model_t *model)
{
    const uint64_t begin = model->continuous_offset;
    const uint64_t end = begin + 8u * (uint64_t)model->continuous_count;
    int is_bool = 0;
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        const uint64_t last = (uint64_t)field->offset + field->size;
        if (field->offset < end && last > begin && (field->role != FCSL_ROLE_STATE || field->type != FCSL_F64)) {
            return "its continuous states reach into a field that is no state of doubles: continuous_count is too "
                   "large";
        }
        is_bool = is_bool || (field->type == FCSL_BOOL && field->offset == model->sampled_offset);
    }
    if (model->sampled_offset != FCSL_NO_OFFSET && !is_bool) {
        return "sampled_offset is no field of type bool: write that of `outputs.sampled`, or FCSL_NO_OFFSET";
    }
    return NULL;
}

/* Whether two outputs are the same member of a ROS 2 message, in which `.` becomes `_`. */
static int is_same_member(const char *a, const char *b)
{
    for (; *a && (*a == '.' ? '_' : *a) == (*b == '.' ? '_' : *b); a++) {
        b++;
    }
    return *a == *b;
}

/* An output before field number `last` that is the same member as that, or null. */
static const fcsl_field_t *same_member(const fcsl_model_t *model, uint32_t last)
{
    for (uint32_t i = 0; model->fields[last].role == FCSL_ROLE_OUTPUT && i < last; i++) {
        const fcsl_field_t *field = &model->fields[i];
        if (field->role == FCSL_ROLE_OUTPUT && is_same_member(field->path, model->fields[last].path)) {
            return field;
        }
    }
    return NULL;
}

int fcsl_model_check(const fcsl_model_t *model, const char *library, fcsl_error_t *error)
{
    const char *wrong = check_descriptor(model);
    if (wrong) {
        return fcsl_fail(error, "%s: model `%s`: %s", library, model->name, wrong);
    }
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        if (!field->path) {
            return fcsl_fail(error, "%s: model `%s`: field %u has no path", library, model->name, i);
        }
        wrong = check_field(model, field);
        if (wrong) {
            return fcsl_fail(error, "%s: model `%s`: field `%s`: %s", library, model->name, field->path, wrong);
        }
        if (fcsl_model_field(model, field->path) != field) {
            return fcsl_fail(error, "%s: model `%s`: field `%s` is there twice", library, model->name, field->path);
        }
        const fcsl_field_t *other = same_member(model, i);
        if (other) {
            return fcsl_fail(error, "%s: model `%s`: `%s` and `%s` have the same name in a message", library,
                             model->name, other->path, field->path);
        }
    }
    wrong = check_places(model);
    return wrong ? fcsl_fail(error, "%s: model `%s`: %s", library, model->name, wrong) : 0;
}

static const fcsl_model_t *find_model(const fcsl_model_t *const *models, const char *library, const char *name,
                                      fcsl_error_t *error)
{
    char names[200] = "";
    for (uint32_t i = 0; i < MAX_MODELS_PER_LIBRARY && models[i]; i++) {
        const fcsl_model_t *model = models[i];
        if (model->abi_version != FCSL_MODEL_ABI_VERSION) {
            (void)fcsl_fail(error, "%s: model ABI %u, this simulator has %u: compile the model again", library,
                            model->abi_version, FCSL_MODEL_ABI_VERSION);
            return NULL;
        }
        if (!model->name) {
            continue;
        }
        if (strcmp(model->name, name) == 0) {
            return model;
        }
        const size_t used = strlen(names);
        (void)snprintf(names + used, sizeof names - used, "%s`%s`", used ? ", " : "", model->name);
    }
    (void)fcsl_fail(error, "%s: no model `%s` in it (it has %s)", library, name, names[0] ? names : "none");
    return NULL;
}

const fcsl_model_t *fcsl_model_load(const char *library, const char *name, void **handle, fcsl_error_t *error)
{
    *handle = fcsl_library_open(library, "model", error);
    if (!*handle) {
        return NULL;
    }
    const fcsl_model_t *const *models = dlsym(*handle, "fcsl_models");
    const fcsl_model_t *model = NULL;
    if (!models) {
        (void)fcsl_fail(error, "%s: not a model library (it does not export fcsl_models)", library);
    } else {
        model = find_model(models, library, name, error);
    }
    if (model && fcsl_model_check(model, library, error) != 0) {
        model = NULL;
    }
    if (!model) {
        fcsl_model_unload(*handle);
        *handle = NULL;
    }
    return model;
}

void fcsl_model_unload(void *handle)
{
    if (handle) {
        (void)dlclose(handle); /* on failure the code stays mapped */
    }
}

const fcsl_field_t *fcsl_model_field(const fcsl_model_t *model, const char *path)
{
    for (uint32_t i = 0; i < model->field_count; i++) {
        if (strcmp(model->fields[i].path, path) == 0) {
            return &model->fields[i];
        }
    }
    return NULL;
}
