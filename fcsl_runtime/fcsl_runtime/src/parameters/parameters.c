/* SPDX-License-Identifier: Apache-2.0
 *
 * Parameter files: their values, checked, as fields of a machine.
 */
#include "fcsl/fcsl_parameters.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_run.h"
#include "fcsl/fcsl_scalar.h"
#include "machine/scalar_text.h"
#include "names.h"
#include "yaml.h"

enum { NODE_BYTES = 512, TEXT_BYTES = 256, NAME_SHOWN = 60, FAILED = -2 };

/* Where a field got its value last. */
typedef struct {
    uint32_t section;
    uint32_t line;
} given_t;

typedef struct {
    const fcsl_machine_t *machine;
    const char *file;
    char node[NODE_BYTES];
    fcsl_parameter_take_t take;
    void *ctx;
    uint8_t *bytes; /* of the largest parameter */
    given_t *given; /* per field */
    int is_meant;   /* a section is for this machine */
    char other[TEXT_BYTES]; /* the first node of which one is not */
} reading_t;

/* ---- values -------------------------------------------------------------------------------------------------------- */

/* [-+]digits[.digits][e[-+]digits], with a digit before or behind the point. */
static int is_number(const char *text)
{
    const char *at = text + (*text == '-' || *text == '+');
    const size_t whole = strspn(at, "0123456789");
    at += whole;
    size_t fraction = 0;
    if (*at == '.') {
        fraction = strspn(++at, "0123456789");
        at += fraction;
    }
    if (whole + fraction == 0u) {
        return 0;
    }
    if (*at == 'e' || *at == 'E') {
        at += at[1] == '-' || at[1] == '+' ? 2 : 1;
        const size_t exponent = strspn(at, "0123456789");
        at += exponent;
        return exponent > 0u && *at == '\0';
    }
    return *at == '\0';
}

/* YAML 1.1 reads 017 as 15. */
static int is_octal(const char *text)
{
    const char *digits = text + (*text == '-' || *text == '+');
    return digits[0] == '0' && digits[1] != '\0' && strpbrk(digits, ".eE") == NULL;
}

static const char *read_number(const yaml_item_t *item, const char *text, uint8_t type, uint8_t *bytes)
{
    if (item->kind != YAML_WORD || !is_number(text)) {
        return type == FCSL_F32 || type == FCSL_F64 ? "expected a finite number" : "expected an integer";
    }
    if (is_octal(text)) {
        return "a whole number does not begin with 0";
    }
    return type == FCSL_F32 || type == FCSL_F64 ? fcsl_float_from_text(text, type, bytes)
                                                : fcsl_integer_from_text(text, type, bytes);
}

static const char *read_bool(const yaml_item_t *item, const char *text, uint8_t *bytes)
{
    bytes[0] = strcmp(text, "true") == 0 || strcmp(text, "True") == 0 || strcmp(text, "TRUE") == 0;
    const int is_false = strcmp(text, "false") == 0 || strcmp(text, "False") == 0 || strcmp(text, "FALSE") == 0;
    return item->kind == YAML_WORD && (bytes[0] != 0 || is_false) ? NULL : "expected true or false";
}

static const char *read_scalar(const reading_t *r, const yaml_item_t *item, uint8_t type, uint8_t *bytes)
{
    char text[TEXT_BYTES];
    if (item->kind != YAML_WORD && item->kind != YAML_STRING) {
        return item->kind == YAML_OPEN ? "expected one value, not a list" : "expected a value";
    }
    if (item->size >= sizeof text ||
        ((type != FCSL_HEALTH && type != FCSL_TRANSITION_REQUEST) && item->size >= SCALAR_TEXT_BYTES)) {
        return "the value is too long";
    }
    memcpy(text, item->text, item->size);
    text[item->size] = '\0';
    if (type == FCSL_BOOL) {
        return read_bool(item, text, bytes);
    }
    return type >= FCSL_I32 && type <= FCSL_F64 ? read_number(item, text, type, bytes)
                                                : fcsl_enumerator_from_text(r->machine, text, type, bytes);
}

typedef struct {
    const reading_t *r;
    const fcsl_field_t *field;
    yaml_cursor_t cursor;
    uint8_t *bytes; /* of the next scalar */
    uint32_t count; /* that were read */
    const char *problem;
    fcsl_error_t *error;
} value_t;

static int wrong(value_t *value, const char *problem)
{
    value->problem = problem;
    return -1;
}

static int next(value_t *value, yaml_item_t *item)
{
    return yaml_next(&value->cursor, item, value->error) == 0 ? 0 : wrong(value, value->error->text);
}

static int put(value_t *value, const yaml_item_t *item)
{
    if (value->count == value->field->count) {
        return wrong(value, "too many values");
    }
    const char *problem = read_scalar(value->r, item, value->field->type, value->bytes);
    value->bytes += fcsl_scalar_size(value->field->type);
    value->count++;
    return problem == NULL ? 0 : wrong(value, problem);
}

/* Behind the `[` of an axis. Its items are lists of the next one, or scalars: of the last axis, or of all, row by row, as ROS 2 has
 * them. */
static int read_axis(value_t *value, uint32_t level)
{
    static const char *const SHAPE = "expected lists nested as its shape, or one list, row by row";
    const fcsl_field_t *field = value->field;
    uint32_t lists = 0;
    uint32_t scalars = 0;
    yaml_item_t item;
    for (int status = next(value, &item); item.kind != YAML_CLOSE; status = next(value, &item)) {
        const int is_list = item.kind == YAML_OPEN;
        if (status == 0 && (is_list ? level + 1u >= field->rank || scalars > 0u : lists > 0u)) {
            return wrong(value, SHAPE);
        }
        if (status != 0 || (is_list ? read_axis(value, level + 1u) : put(value, &item)) != 0) {
            return -1;
        }
        lists += is_list ? 1u : 0u;
        scalars += is_list ? 0u : 1u;
    }
    const int is_flat = level == 0u && scalars == field->count;
    const int is_row = level + 1u == field->rank && scalars == field->shape[level];
    return is_flat || is_row || (scalars == 0u && lists == field->shape[level]) ? 0 : wrong(value, SHAPE);
}

static int read_value(value_t *value)
{
    yaml_item_t item;
    if (next(value, &item) != 0) {
        return -1;
    }
    if (value->field->rank == 0u) {
        return put(value, &item);
    }
    return item.kind == YAML_OPEN ? read_axis(value, 0) : wrong(value, "expected a list");
}

/* ---- entries -------------------------------------------------------------------------------------------------------- */

static int is_finite(const fcsl_field_t *field, const uint8_t *bytes)
{
    for (uint32_t at = 0; at < field->size && (field->type == FCSL_F32 || field->type == FCSL_F64);
         at += fcsl_scalar_size(field->type)) {
        if (!isfinite(fcsl_scalar_as_double(bytes + at, field->type))) {
            return 0;
        }
    }
    return 1;
}

static int check_unit(const yaml_entry_t *entry, const fcsl_field_t *field, const char *file, fcsl_error_t *error)
{
    if (entry->unit_size == 0u ||
        (entry->unit_size == strlen(field->unit) && memcmp(entry->unit, field->unit, entry->unit_size) == 0)) {
        return 0;
    }
    const int length = entry->unit_size < NAME_SHOWN ? (int)entry->unit_size : NAME_SHOWN;
    return field->unit[0] == '\0'
               ? yaml_fail(file, entry->line, error, "`%.120s` has no unit, but the comment says [%.*s]", entry->name,
                           length, entry->unit)
               : yaml_fail(file, entry->line, error,
                           "`%.120s` is in %.60s, but the comment says [%.*s]: convert the value", entry->name,
                           field->unit, length, entry->unit);
}

/* The field of a name; FCSL_NONE for one of the node itself, or FAILED. */
static int32_t find_field(const reading_t *r, const yaml_entry_t *entry, fcsl_error_t *error)
{
    const int32_t found = fcsl_parameter_find(r->machine, entry->name);
    char nearest[PARAMETER_NAME_BYTES];
    if (found != FCSL_NONE || fcsl_parameter_is_foreign(r->machine, entry->name, nearest)) {
        return found;
    }
    const int is_meant = nearest[0] != '\0';
    (void)yaml_fail(r->file, entry->line, error, "machine `%.60s` has no parameter `%.120s`%s%.120s%s",
                    r->machine->name, entry->name, is_meant ? "; did you mean `" : "", nearest, is_meant ? "`?" : "");
    return FAILED;
}

static int take_value(reading_t *r, const yaml_entry_t *entry, uint32_t index, fcsl_error_t *error)
{
    const fcsl_field_t *field = &r->machine->fields[index];
    fcsl_error_t problem;
    value_t value = {.r = r, .field = field, .cursor = entry->value, .bytes = r->bytes, .error = &problem};
    if (read_value(&value) != 0) {
        return yaml_fail(r->file, entry->line, error, "`%.120s`: %.200s", entry->name, value.problem);
    }
    if (!is_finite(field, r->bytes)) {
        return yaml_fail(r->file, entry->line, error, "`%.120s`: expected a finite number", entry->name);
    }
    if (fcsl_check_value(r->machine, field, r->bytes, field->size, &problem) != 0) {
        return yaml_fail(r->file, entry->line, error, "`%.120s` %.200s", entry->name, problem.text);
    }
    return check_unit(entry, field, r->file, error) != 0 ? -1 : r->take(r->ctx, index, r->bytes, error);
}

static int take_entry(void *ctx, const yaml_entry_t *entry, fcsl_error_t *error)
{
    reading_t *r = ctx;
    if (!fcsl_node_matches(entry->node, r->node)) {
        if (r->other[0] == '\0') {
            (void)snprintf(r->other, sizeof r->other, "%s", entry->node);
        }
        return 0;
    }
    r->is_meant = 1;
    const int32_t found = find_field(r, entry, error);
    if (found < 0) {
        return found == FCSL_NONE ? 0 : -1;
    }
    given_t *given = &r->given[found];
    if (given->section == entry->section) {
        return yaml_fail(r->file, entry->line, error, "`%.120s` is given twice, first in line %u", entry->name,
                         (unsigned)given->line);
    }
    *given = (given_t){.section = entry->section, .line = entry->line};
    if ((r->machine->fields[found].flags & FCSL_FIELD_FROZEN) != 0) {
        return yaml_fail(
            r->file, entry->line, error,
            "`%.120s` is frozen: the compiler folded its value into the code. Write the value into the machine "
            "JSON and build a variant, or take it out of `frozen`",
            entry->name);
    }
    return take_value(r, entry, (uint32_t)found, error);
}

/* ---- a file --------------------------------------------------------------------------------------------------------- */

static int read_all(reading_t *r, const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    const int64_t sections = yaml_read(parameters->text, parameters->size, parameters->name, take_entry, r, error);
    if (sections < 0) {
        return -1;
    }
    if (sections == 0) {
        return yaml_fail(
            r->file, 0, error,
            "no `ros__parameters:` in it; a parameter file begins with `/**:`, below it `ros__parameters:`, and below "
            "it the parameters");
    }
    if (parameters->used != NULL) {
        *parameters->used |= r->is_meant;
    } else if (!r->is_meant && r->other[0] != '\0') {
        return yaml_fail(r->file, 0, error,
                         "no section is for `%.120s`; the first is for `%.120s`, `/**:` is for every node", r->node,
                         r->other);
    }
    return 0;
}

int fcsl_parameters_each(const fcsl_machine_t *machine, const fcsl_parameters_t *parameters, fcsl_parameter_take_t take,
                         void *ctx, fcsl_error_t *error)
{
    reading_t r = {.machine = machine, .file = parameters->name, .take = take, .ctx = ctx};
    const char *name_space = parameters->name_space + strspn(parameters->name_space, "/");
    (void)snprintf(r.node, sizeof r.node, "%s%s/%s", name_space[0] != '\0' ? "/" : "", name_space, machine->name);
    uint32_t largest = 1;
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        largest = field->role == FCSL_ROLE_PARAMETER && field->size > largest ? field->size : largest;
    }
    r.bytes = malloc(largest);
    r.given = calloc(machine->field_count + 1u, sizeof *r.given);
    const int status = r.bytes == NULL || r.given == NULL ? fcsl_fail(error, "out of memory for parameters")
                                                          : read_all(&r, parameters, error);
    free(r.bytes);
    free(r.given);
    return status;
}
