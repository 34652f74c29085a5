/* SPDX-License-Identifier: Apache-2.0
 *
 * `eval`: expressions over what is served.
 */
#include "evaluate.h"

#include <stdio.h>

#include "machine/enumerators.h"

typedef struct {
    const catalog_t *catalog;
    const uint8_t *snapshot;
} served_t;

static int find(const void *context, const char *path, fcsl_expression_operand_t *operand,
                fcsl_expression_error_t *error)
{
    const served_t *served = context;
    target_t target;
    const target_status_t status = fcsl_catalog_find(served->catalog, path, &target);
    *error = (fcsl_expression_error_t){.code = "unknown_path", .hint = ""};
    if (status != TARGET_OK) {
        error->code = status == TARGET_INDEX ? "bad_index" : "unknown_path";
        error->hint = status == TARGET_INDEX ? target.entry->path : fcsl_catalog_nearest(served->catalog, path);
        (void)snprintf(error->text, sizeof error->text, "no field '%.80s'", path);
        return -1;
    }
    const uint32_t count = fcsl_view_count(&target.view);
    if (target.view.rank > 1 || count == 0 || count > FCSL_EXPRESSION_VECTOR_MAX ||
        (target.machine == NULL && target.field->type > FCSL_F64)) {
        error->code = "bad_expression";
        (void)snprintf(error->text, sizeof error->text, "name one element of '%.80s'", path);
        return -1;
    }
    *operand = (fcsl_expression_operand_t){
        .machine = target.machine, .type = target.field->type, .count = target.view.rank == 1 ? count : 0};
    for (uint32_t i = 0; i < count; i++) {
        operand->elements[i] = served->snapshot + target.at + fcsl_view_byte(&target.view, i);
    }
    return 0;
}

int fcsl_evaluate(const char *text, const catalog_t *catalog, const uint8_t *snapshot, evaluated_t *evaluated,
                  fcsl_expression_error_t *error)
{
    const served_t served = {.catalog = catalog, .snapshot = snapshot};
    fcsl_expression_t expression;
    if (fcsl_expression_compile(text, find, &served, &expression, error) != 0) {
        return -1;
    }
    evaluated->type = expression.type;
    evaluated->machine = expression.machine;
    return fcsl_expression_run(&expression, &evaluated->value, error);
}

void fcsl_evaluated_write(const evaluated_t *evaluated, json_out_t *out)
{
    char text[PATH_BYTES_MAX];
    const fcsl_expression_value_t *value = &evaluated->value;
    switch (value->kind) {
    case FCSL_EXPRESSION_BOOL:
        fcsl_json_text(out, value->integer ? "true" : "false");
        return;
    case FCSL_EXPRESSION_INTEGER:
        fcsl_json_i64(out, value->integer);
        return;
    case FCSL_EXPRESSION_FLOAT:
        fcsl_json_f64(out, value->real);
        return;
    default:
        fcsl_json_quoted(
            out, fcsl_enumerator_name(evaluated->machine, evaluated->type, (int32_t)value->integer, text, sizeof text));
    }
}
