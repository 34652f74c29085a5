/* SPDX-License-Identifier: Apache-2.0
 *
 * Values of fields to JSON and back.
 */
#define _GNU_SOURCE
#include "value.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "machine/enumerators.h"
#include "machine/scalar_text.h"

enum { VALUE_NAME_BYTES = 256 };

static void write_scalar(const target_t *target, const uint8_t *bytes, json_out_t *out)
{
    char text[VALUE_NAME_BYTES];
    int32_t i32 = 0;
    uint32_t u32 = 0;
    int64_t i64 = 0;
    uint64_t u64 = 0;
    float f32 = 0.0f;
    double f64 = 0.0;
    switch (target->field->type) {
    case FCSL_BOOL:
        fcsl_json_text(out, bytes[0] != 0 ? "true" : "false");
        return;
    case FCSL_I32:
        memcpy(&i32, bytes, sizeof i32);
        fcsl_json_i64(out, i32);
        return;
    case FCSL_I64:
        memcpy(&i64, bytes, sizeof i64);
        fcsl_json_i64(out, i64);
        return;
    case FCSL_U32:
        memcpy(&u32, bytes, sizeof u32);
        fcsl_json_u64(out, u32);
        return;
    case FCSL_U64:
        memcpy(&u64, bytes, sizeof u64);
        fcsl_json_u64(out, u64);
        return;
    case FCSL_F32:
        memcpy(&f32, bytes, sizeof f32);
        fcsl_json_f32(out, f32);
        return;
    case FCSL_F64:
        memcpy(&f64, bytes, sizeof f64);
        fcsl_json_f64(out, f64);
        return;
    default:
        memcpy(&i32, bytes, sizeof i32);
        fcsl_json_quoted(out, fcsl_enumerator_name(target->machine, target->field->type, i32, text, sizeof text));
    }
}

/* One axis of the target and those behind it; `at` is the byte where they begin. */
static void write_axis(const target_t *target, uint32_t level, int64_t at, const uint8_t *field, json_out_t *out)
{
    if (level == target->view.rank) {
        write_scalar(target, field + at, out);
        return;
    }
    fcsl_json_text(out, "[");
    for (uint32_t i = 0; i < target->view.axes[level].count && !out->overflow; i++) {
        fcsl_json_text(out, i > 0 ? "," : "");
        write_axis(target, level + 1, at + (int64_t)i * target->view.axes[level].stride, field, out);
    }
    fcsl_json_text(out, "]");
}

void fcsl_value_write(const target_t *target, const uint8_t *field, json_out_t *out)
{
    write_axis(target, 0, target->view.offset, field, out);
}

static const char *read_float(const json_t *json, uint32_t token, uint8_t type, int floats, uint8_t *bytes)
{
    char text[SCALAR_TEXT_BYTES];
    const json_token_t *number = &json->tokens[token];
    if (number->type == JSON_STRING) {
        if (fcsl_json_string(json, token, text, sizeof text) != 0 ||
            (strcmp(text, "nan") != 0 && strcmp(text, "inf") != 0 && strcmp(text, "-inf") != 0)) {
            return "expected a number, or \"nan\", \"inf\" or \"-inf\"";
        }
        if (floats == FINITE_ONLY) {
            return "not finite; say \"allow_non_finite\": true if that is meant";
        }
        (void)fcsl_float_from_text(text, type, bytes);
        return NULL;
    }
    if (number->type != JSON_NUMBER || number->end - number->start >= sizeof text) {
        return "expected a number";
    }
    memcpy(text, json->text + number->start, number->end - number->start);
    text[number->end - number->start] = '\0';
    return fcsl_float_from_text(text, type, bytes);
}

static const char *read_integer(const json_t *json, uint32_t token, uint8_t type, uint8_t *bytes)
{
    char text[SCALAR_TEXT_BYTES];
    const json_token_t *number = &json->tokens[token];
    if (number->type != JSON_NUMBER || number->end - number->start >= sizeof text) {
        return "expected an integer";
    }
    memcpy(text, json->text + number->start, number->end - number->start);
    text[number->end - number->start] = '\0';
    return fcsl_integer_from_text(text, type, bytes);
}

static const char *read_enumerator(const fcsl_machine_t *machine, const json_t *json, uint32_t token, uint8_t type,
                                   uint8_t *bytes)
{
    char text[VALUE_NAME_BYTES];
    return fcsl_json_string(json, token, text, sizeof text) != 0
               ? "expected a name"
               : fcsl_enumerator_from_text(machine, text, type, bytes);
}

static const char *read_scalar(const target_t *target, const json_t *json, uint32_t token, int floats, uint8_t *bytes)
{
    const uint8_t type = target->field->type;
    switch (type) {
    case FCSL_BOOL: {
        const json_type_t got = json->tokens[token].type;
        bytes[0] = got == JSON_TRUE;
        return got == JSON_TRUE || got == JSON_FALSE ? NULL : "expected true or false";
    }
    case FCSL_I32:
    case FCSL_I64:
    case FCSL_U32:
    case FCSL_U64:
        return read_integer(json, token, type, bytes);
    case FCSL_F32:
    case FCSL_F64:
        return read_float(json, token, type, floats, bytes);
    default:
        return read_enumerator(target->machine, json, token, type, bytes);
    }
}

/* One axis and those behind it. Tokens stand in text order, so `at` moves on by what was read. */
static const char *read_axis(const target_t *target, uint32_t level, const json_t *json, int floats, uint32_t *at,
                             uint8_t **bytes)
{
    if (level == target->view.rank) {
        const char *problem = read_scalar(target, json, *at, floats, *bytes);
        *at += 1;
        *bytes += fcsl_scalar_size(target->field->type);
        return problem;
    }
    const json_token_t *array = &json->tokens[*at];
    if (array->type != JSON_ARRAY || array->count != target->view.axes[level].count) {
        return "expected arrays nested as its shape";
    }
    *at += 1;
    for (uint32_t i = 0; i < array->count; i++) {
        const json_type_t type = json->tokens[*at].type;
        if (level + 1 == target->view.rank && (type == JSON_ARRAY || type == JSON_OBJECT)) {
            return "expected arrays nested as its shape";
        }
        const char *problem = read_axis(target, level + 1, json, floats, at, bytes);
        if (problem != NULL) {
            return problem;
        }
    }
    return NULL;
}

const char *fcsl_value_read(const target_t *target, const json_t *json, uint32_t token, int floats, uint8_t *bytes)
{
    return read_axis(target, 0, json, floats, &token, &bytes);
}

void fcsl_value_type(const fcsl_field_t *field, const view_t *view, char *text, size_t size)
{
    static const char *const names[] = {"bool",   "i32",  "i64", "u32", "u64", "f32", "f64", "TransitionRequest",
                                        "Health", "state"};
    int at = snprintf(text, size, "%s", names[field->type]);
    for (uint32_t i = 0; i < view->rank && at >= 0 && (size_t)at < size; i++) {
        at += snprintf(text + at, size - (size_t)at, "[%" PRIu32 "]", view->axes[i].count);
    }
}

const char *fcsl_value_source(const fcsl_field_t *fields, const fcsl_field_t *field)
{
    if (field->connected_from == FCSL_FROM_MACHINE) {
        return "the machine";
    }
    return field->connected_from == FCSL_NONE ? "" : fields[field->connected_from].path;
}
