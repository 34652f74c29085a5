/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "value.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"

enum { NAME_BYTES = 256, NUMBER_BYTES = 64, RANK_MAX = 8 };

static const char *const HEALTH_NAMES[] = {"nominal", "degraded", "failed", "stale"};

/* Turns the index list behind a path, "[2,1]" or "[2][1]", into a row-major scalar index. */
static int read_indices(const fcsl_field_t *field, const char *text, uint32_t *element)
{
    uint32_t row_major = 0;
    for (uint32_t level = 0; level < field->rank; level++) {
        if (level == 0 ? *text == '[' : *text == ',') {
            text++;
        } else if (level > 0 && text[0] == ']' && text[1] == '[') {
            text += 2;
        } else {
            return -1;
        }
        if (*text < '0' || *text > '9') {
            return -1;
        }
        char *end = NULL;
        errno = 0;
        const unsigned long index = strtoul(text, &end, 10);
        if (errno != 0 || index >= field->shape[level]) {
            return -1;
        }
        row_major = row_major * field->shape[level] + (uint32_t)index;
        text = end;
    }
    *element = row_major;
    return field->rank > 0 && text[0] == ']' && text[1] == '\0' ? 0 : -1;
}

/* What stands in `path` behind a field's own path: "" or indices; null for another field. An index of an array of structs
 * is part of the field's path, "targets[2][1].valid", and may also be written "targets[2,1].valid". */
static const char *behind_field(const fcsl_field_t *field, const char *path)
{
    const char *own = field->path;
    while (*own != '\0') {
        if (*own == *path) {
            own++;
            path++;
        } else if (own[0] == ']' && own[1] == '[' && *path == ',') {
            own += 2;
            path++;
        } else {
            return NULL;
        }
    }
    return *path == '\0' || *path == '[' ? path : NULL;
}

target_status_t value_resolve(const fcsl_machine_t *machine, const char *path, target_t *target)
{
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        const char *indices = behind_field(field, path);
        if (indices == NULL) {
            continue;
        }
        *target = (target_t){.field = field, .index = i, .element = 0, .count = field->count, .whole = 1};
        if (*indices == '\0') {
            return TARGET_OK;
        }
        target->count = 1;
        target->whole = 0;
        return read_indices(field, indices, &target->element) == 0 ? TARGET_OK : TARGET_INDEX;
    }
    return TARGET_UNKNOWN;
}

static void write_scalar(const fcsl_machine_t *machine, uint8_t type, const uint8_t *bytes, json_out_t *out)
{
    int32_t i32 = 0;
    uint32_t u32 = 0;
    int64_t i64 = 0;
    uint64_t u64 = 0;
    float f32 = 0.0f;
    double f64 = 0.0;
    switch (type) {
    case FCSL_BOOL:
        fcsl_json_raw(out, bytes[0] != 0 ? "true" : "false");
        return;
    case FCSL_I64:
        memcpy(&i64, bytes, sizeof i64);
        fcsl_json_raw(out, "%" PRId64, i64);
        return;
    case FCSL_U32:
        memcpy(&u32, bytes, sizeof u32);
        fcsl_json_raw(out, "%" PRIu32, u32);
        return;
    case FCSL_U64:
        memcpy(&u64, bytes, sizeof u64);
        fcsl_json_raw(out, "%" PRIu64, u64);
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
        break;
    }
    memcpy(&i32, bytes, sizeof i32);
    if (type == FCSL_I32) {
        fcsl_json_raw(out, "%" PRId32, i32);
    } else if (type == FCSL_HEALTH) {
        fcsl_json_quoted(out, i32 >= 0 && i32 <= (int32_t)FCSL_STALE ? HEALTH_NAMES[i32] : "?");
    } else if (type == FCSL_STATE) {
        fcsl_json_quoted(out, i32 >= 0 && (uint32_t)i32 < machine->state_count ? machine->states[i32].name : "?");
    } else {
        char text[NAME_BYTES + 8] = "";
        if (i32 > 0 && (uint32_t)i32 <= machine->request_count) {
            (void)snprintf(text, sizeof text, "tr_%s", machine->requests[i32 - 1]);
        }
        fcsl_json_quoted(out, text);
    }
}

void value_write(const fcsl_machine_t *machine, const target_t *target, const uint8_t *bytes, json_out_t *out)
{
    const fcsl_field_t *field = target->field;
    const uint32_t scalar = fcsl_scalar_size(field->type);
    const uint32_t rank = target->whole ? field->rank : 0;
    for (uint32_t i = 0; i < target->count; i++) {
        /* A bracket opens before every scalar that begins a row of some level, and closes behind every one that ends one. */
        uint32_t row = 1;
        uint32_t opened = 0;
        uint32_t closed = 0;
        for (uint32_t level = rank; level > 0; level--) {
            row *= field->shape[level - 1];
            opened += i % row == 0;
            closed += (i + 1) % row == 0;
        }
        fcsl_json_raw(out, "%s%.*s", i > 0 ? "," : "", (int)opened, "[[[[[[[[");
        write_scalar(machine, field->type, bytes + (size_t)i * scalar, out);
        fcsl_json_raw(out, "%.*s", (int)closed, "]]]]]]]]");
    }
}

static int is_integer_text(const char *text)
{
    return strpbrk(text, ".eE") == NULL;
}

static const char *read_float(const json_t *json, uint32_t token, uint8_t type, uint8_t *bytes)
{
    char text[NUMBER_BYTES];
    const json_token_t *number = &json->tokens[token];
    if (number->type == JSON_STRING) {
        if (fcsl_json_string(json, token, text, sizeof text) != 0 ||
            (strcmp(text, "nan") != 0 && strcmp(text, "inf") != 0 && strcmp(text, "-inf") != 0)) {
            return "expected a number, or \"nan\", \"inf\" or \"-inf\"";
        }
    } else if (number->type == JSON_NUMBER && number->end - number->start < sizeof text) {
        memcpy(text, json->text + number->start, number->end - number->start);
        text[number->end - number->start] = '\0';
    } else {
        return "expected a number";
    }
    if (type == FCSL_F32) {
        const float value = strtof(text, NULL);
        if (number->type == JSON_NUMBER && isinf(value)) {
            return "out of the range of f32";
        }
        memcpy(bytes, &value, sizeof value);
    } else {
        const double value = strtod(text, NULL);
        if (number->type == JSON_NUMBER && isinf(value)) {
            return "out of the range of f64";
        }
        memcpy(bytes, &value, sizeof value);
    }
    return NULL;
}

static const char *read_integer(const json_t *json, uint32_t token, uint8_t type, uint8_t *bytes)
{
    char text[NUMBER_BYTES];
    const json_token_t *number = &json->tokens[token];
    if (number->type != JSON_NUMBER || number->end - number->start >= sizeof text) {
        return "expected an integer";
    }
    memcpy(text, json->text + number->start, number->end - number->start);
    text[number->end - number->start] = '\0';
    if (!is_integer_text(text)) {
        return "expected an integer, without point or exponent";
    }
    errno = 0;
    if (type == FCSL_U64 || type == FCSL_U32) {
        const unsigned long long value = text[0] == '-' ? 0 : strtoull(text, NULL, 10);
        if (text[0] == '-' || errno != 0 || (type == FCSL_U32 && value > UINT32_MAX)) {
            return type == FCSL_U32 ? "out of the range of u32" : "out of the range of u64";
        }
        const uint32_t narrow = (uint32_t)value;
        memcpy(bytes, type == FCSL_U32 ? (const void *)&narrow : (const void *)&value, fcsl_scalar_size(type));
        return NULL;
    }
    const long long value = strtoll(text, NULL, 10);
    if (errno != 0 || (type == FCSL_I32 && (value < INT32_MIN || value > INT32_MAX))) {
        return type == FCSL_I32 ? "out of the range of i32" : "out of the range of i64";
    }
    const int32_t narrow = (int32_t)value;
    memcpy(bytes, type == FCSL_I32 ? (const void *)&narrow : (const void *)&value, fcsl_scalar_size(type));
    return NULL;
}

static const char *read_enumerator(const fcsl_machine_t *machine, const json_t *json, uint32_t token, uint8_t type,
                                   uint8_t *bytes)
{
    char text[NAME_BYTES];
    if (fcsl_json_string(json, token, text, sizeof text) != 0) {
        return "expected a name";
    }
    int32_t value = FCSL_NONE;
    if (type == FCSL_STATE) {
        value = value_state(machine, text);
    } else if (type == FCSL_HEALTH) {
        for (int32_t i = 0; i <= (int32_t)FCSL_STALE; i++) {
            value = strcmp(text, HEALTH_NAMES[i]) == 0 ? i : value;
        }
    } else {
        value = text[0] == '\0' ? 0 : FCSL_NONE;
        for (uint32_t i = 0; i < machine->request_count && strncmp(text, "tr_", 3) == 0; i++) {
            value = strcmp(text + 3, machine->requests[i]) == 0 ? (int32_t)i + 1 : value;
        }
    }
    if (value == FCSL_NONE) {
        return "no such enumerator";
    }
    memcpy(bytes, &value, sizeof value);
    return NULL;
}

static const char *read_scalar(const fcsl_machine_t *machine, const json_t *json, uint32_t token, uint8_t type,
                               uint8_t *bytes)
{
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
        return read_float(json, token, type, bytes);
    default:
        return read_enumerator(machine, json, token, type, bytes);
    }
}

const char *value_read(const fcsl_machine_t *machine, const target_t *target, const json_t *json, uint32_t token,
                       uint8_t *bytes)
{
    const fcsl_field_t *field = target->field;
    const uint32_t scalar = fcsl_scalar_size(field->type);
    if (!target->whole || field->rank == 0) {
        return read_scalar(machine, json, token, field->type, bytes);
    }
    /* Tokens stand in text order, so the scalars of properly nested arrays come in row-major order; what has to be checked
     * is that an array of the right length stands wherever a row of some level begins. */
    uint32_t at = token;
    for (uint32_t i = 0; i < field->count; i++) {
        for (uint32_t level = 0; level < field->rank; level++) {
            uint32_t row = 1;
            for (uint32_t below = level; below < field->rank; below++) {
                row *= field->shape[below];
            }
            if (i % row == 0) {
                if (json->tokens[at].type != JSON_ARRAY || json->tokens[at].count != field->shape[level]) {
                    return "expected arrays nested as the field's shape";
                }
                at++;
            }
        }
        if (json->tokens[at].type == JSON_ARRAY || json->tokens[at].type == JSON_OBJECT) {
            return "expected arrays nested as the field's shape";
        }
        const char *problem = read_scalar(machine, json, at, field->type, bytes + (size_t)i * scalar);
        if (problem != NULL) {
            return problem;
        }
        at++;
    }
    return NULL;
}

void value_type(const fcsl_field_t *field, char *text, size_t size)
{
    static const char *const names[] = {"bool",   "i32",  "i64", "u32", "u64", "f32", "f64", "TransitionRequest",
                                        "Health", "state"};
    int at = snprintf(text, size, "%s", names[field->type]);
    for (uint32_t i = 0; i < field->rank && at >= 0 && (size_t)at < size; i++) {
        at += snprintf(text + at, size - (size_t)at, "%s%" PRIu32 "%s", i == 0 ? "[" : ",", field->shape[i],
                       i + 1u == field->rank ? "]" : "");
    }
}

/* Edits (insert, delete, replace) between two names, or `limit` when there are at least as many. */
static uint32_t distance(const char *a, const char *b, uint32_t limit)
{
    uint32_t row[NAME_BYTES + 1];
    const size_t width = strnlen(b, NAME_BYTES);
    for (size_t j = 0; j <= width; j++) {
        row[j] = (uint32_t)j;
    }
    for (size_t i = 0; a[i] != '\0' && i < NAME_BYTES; i++) {
        uint32_t diagonal = row[0];
        uint32_t best = row[0] = (uint32_t)i + 1;
        for (size_t j = 1; j <= width; j++) {
            const uint32_t replaced = diagonal + (a[i] != b[j - 1]);
            const uint32_t inserted = row[j - 1] + 1;
            const uint32_t deleted = row[j] + 1;
            diagonal = row[j];
            row[j] = replaced < inserted ? replaced : inserted;
            row[j] = row[j] < deleted ? row[j] : deleted;
            best = row[j] < best ? row[j] : best;
        }
        if (best >= limit) {
            return limit;
        }
    }
    return row[width] < limit ? row[width] : limit;
}

typedef struct {
    const char *name;
    uint32_t edits;
} nearest_t;

static void consider(nearest_t *nearest, const char *candidate, const char *name)
{
    const uint32_t edits = distance(name, candidate, nearest->edits);
    if (edits < nearest->edits) {
        *nearest = (nearest_t){.name = candidate, .edits = edits};
    }
}

const char *value_nearest_path(const fcsl_machine_t *machine, const char *path)
{
    nearest_t nearest = {.name = "", .edits = NAME_BYTES};
    for (uint32_t i = 0; i < machine->field_count; i++) {
        consider(&nearest, machine->fields[i].path, path);
    }
    return nearest.name;
}

const char *value_nearest_state(const fcsl_machine_t *machine, const char *name)
{
    nearest_t nearest = {.name = "", .edits = NAME_BYTES};
    for (uint32_t i = 0; i < machine->state_count; i++) {
        consider(&nearest, machine->states[i].name, name);
    }
    return nearest.name;
}

const char *value_nearest(const char *const *names, const char *name)
{
    nearest_t nearest = {.name = "", .edits = NAME_BYTES};
    for (size_t i = 0; names[i] != NULL; i++) {
        consider(&nearest, names[i], name);
    }
    return nearest.name;
}

int32_t value_state(const fcsl_machine_t *machine, const char *name)
{
    for (uint32_t i = 0; i < machine->state_count; i++) {
        if (strcmp(machine->states[i].name, name) == 0) {
            return (int32_t)i;
        }
    }
    return FCSL_NONE;
}
