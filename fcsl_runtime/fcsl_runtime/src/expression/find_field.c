/* SPDX-License-Identifier: Apache-2.0
 *
 * Fields by their path in an expression.
 */
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_expression.h"
#include "machine/view.h"

/* The field whose path is followed by nothing but brackets, the longest; `rest` is where these begin. */
static const fcsl_field_t *named(const fcsl_field_t *fields, uint32_t count, const char *path, const char **rest)
{
    const fcsl_field_t *found = NULL;
    for (uint32_t i = 0; i < count; i++) {
        const size_t length = strlen(fields[i].path);
        const char *behind = path + length;
        const int fits = strncmp(path, fields[i].path, length) == 0 && (*behind == '\0' || *behind == '[');
        if (fits && (found == NULL || behind > *rest)) {
            found = &fields[i];
            *rest = behind;
        }
    }
    return found;
}

static int fail(fcsl_expression_error_t *error, const char *code, const char *what, const char *path)
{
    *error = (fcsl_expression_error_t){.code = code, .hint = ""};
    (void)snprintf(error->text, sizeof error->text, "%s '%.80s'", what, path);
    return -1;
}

int fcsl_expression_find_field(const fcsl_field_t *fields, uint32_t count, const fcsl_machine_t *machine,
                               const uint8_t *data, const char *path, fcsl_expression_operand_t *operand,
                               fcsl_expression_error_t *error)
{
    const char *rest = path;
    const fcsl_field_t *field = named(fields, count, path, &rest);
    if (field == NULL) {
        return fail(error, "unknown_path", "no field", path);
    }
    if (machine == NULL && field->type > FCSL_F64) {
        return fail(error, "bad_expression", "no names are known of", path);
    }
    view_t view = fcsl_view_whole(field);
    if (fcsl_view_index(&view, rest) != 0) {
        return fail(error, "bad_index", "no element", path);
    }
    const uint32_t elements = fcsl_view_count(&view);
    if (view.rank > 1 || elements == 0 || elements > FCSL_EXPRESSION_VECTOR_MAX) {
        return fail(error, "bad_expression", "name one element of", path);
    }
    *operand =
        (fcsl_expression_operand_t){.machine = machine, .type = field->type, .count = view.rank == 1 ? elements : 0};
    for (uint32_t i = 0; i < elements; i++) {
        operand->elements[i] = data + field->offset + fcsl_view_byte(&view, i);
    }
    return 0;
}
