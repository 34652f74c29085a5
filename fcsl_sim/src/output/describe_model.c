/* SPDX-License-Identifier: Apache-2.0
 *
 * A model's table as text, for the front end: one record per line, columns separated by tabs.
 *
 *   model NAME CONTINUOUS_OFFSET CONTINUOUS_STATES FUNCTIONS DOC
 *   event NAME CROSSING DOC
 *   field PATH ROLE FEEDTHROUGH OPTIONAL TABLE TYPE SHAPE OFFSET UNIT DOC
 *
 * SHAPE is empty for a scalar, else its extents separated by commas. FUNCTIONS are names separated by commas, `second_order`
 * among them where the model is; FEEDTHROUGH, OPTIONAL and TABLE are 1 or 0.
 */
#include <string.h>

#include "fcsl/fcsl_sim.h"
#include "fcsl/fcsl_error.h"
#include "models/model.h"

typedef struct {
    char *text;
    size_t capacity;
    size_t used; /* size of the whole text, even beyond the capacity */
} text_t;

static void put_char(text_t *text, char c)
{
    if (text->used < text->capacity) {
        text->text[text->used] = c;
    }
    text->used++;
}

/* One column and its terminator; a separator inside a column becomes a space. */
static void put(text_t *text, const char *column, char end)
{
    for (const char *c = column; *c; c++) {
        put_char(text, (unsigned char)*c < 0x20 ? ' ' : *c);
    }
    put_char(text, end);
}

static void put_number(text_t *text, uint64_t value, char end)
{
    char digits[24];
    (void)snprintf(digits, sizeof digits, "%llu", (unsigned long long)value);
    put(text, digits, end);
}

static const char *type_name(uint8_t type)
{
    static const char *const names[] = {"bool", "i32", "i64", "u32", "u64", "f32", "f64"};
    return type < sizeof names / sizeof *names ? names[type] : "?";
}

static void put_type(text_t *text, const fcsl_field_t *field)
{
    put(text, type_name(field->type), '\t');
    for (uint32_t i = 0; i < field->rank; i++) {
        char extent[16];
        (void)snprintf(extent, sizeof extent, "%s%u", i ? "," : "", field->shape[i]);
        for (const char *c = extent; *c; c++) {
            put_char(text, *c);
        }
    }
    put_char(text, '\t');
}

static void put_functions(text_t *text, const fcsl_model_t *model)
{
    char names[64];
    (void)snprintf(names, sizeof names, "%s%s%s%s", model->output ? "output," : "", model->update ? "update," : "",
                   model->is_second_order ? "second_order," : "", model->next_time ? "next_time," : "");
    put(text, names, '\t');
}

static void put_events(text_t *text, const fcsl_model_t *model)
{
    static const char *const crossings[] = {"", "falling", "rising", "either"};
    for (uint32_t i = 0; i < model->event_count; i++) {
        put(text, "event", '\t');
        put(text, model->events[i].name, '\t');
        put(text, crossings[model->events[i].crossing], '\t'); /* one of these: checked at load */
        put(text, model->events[i].doc, '\n');
    }
}

int64_t fcsl_sim_describe_model(const char *library, const char *name, char *text, size_t capacity, fcsl_error_t *error)
{
    static const char *const roles[] = {"machine", "input", "output", "parameter", "state"};
    void *handle = NULL;
    const fcsl_model_t *model = fcsl_model_load(library, name, &handle, error);
    if (!model) {
        return -1;
    }
    text_t out = {text, capacity, 0};
    put(&out, "model", '\t');
    put(&out, model->name, '\t');
    put_number(&out, model->continuous_offset, '\t');
    put_number(&out, model->continuous_count, '\t');
    put_functions(&out, model);
    put(&out, model->doc, '\n');
    put_events(&out, model);
    for (uint32_t i = 0; i < model->field_count; i++) {
        const fcsl_field_t *field = &model->fields[i];
        put(&out, "field", '\t');
        put(&out, field->path, '\t');
        put(&out, roles[field->role], '\t'); /* one of these four: checked at load */
        put_number(&out, (field->flags & FCSL_FIELD_FEEDTHROUGH) != 0, '\t');
        put_number(&out, (field->flags & FCSL_FIELD_OPTIONAL) != 0, '\t');
        put_number(&out, (field->flags & FCSL_FIELD_TABLE) != 0, '\t');
        put_type(&out, field);
        put_number(&out, field->offset, '\t');
        put(&out, field->unit, '\t');
        put(&out, field->doc, '\n');
    }
    fcsl_model_unload(handle);
    return (int64_t)out.used;
}
