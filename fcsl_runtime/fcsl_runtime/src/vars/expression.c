/* SPDX-License-Identifier: Apache-2.0
 *
 * Recursive descent that evaluates as it reads. What short-circuit evaluation leaves out is read with `skip` set: its paths
 * must exist, but nothing is computed.
 */
#include "expression.h"

#include <inttypes.h>
#include <string.h>

#include "arithmetic.h"
#include "expression_parser.h"

int fcsl_parser_deeper(expression_parser_t *p, expression_value_t *value, expression_reader_t *read)
{
    if (p->depth == EXPRESSION_DEPTH_MAX) {
        return fcsl_parser_fail(p, "nested too deeply");
    }
    p->depth++;
    const int status = read(p, value);
    p->depth--;
    return status;
}

/* ---- operators ----------------------------------------------------------------------------------------------------- */

static int read_unary(expression_parser_t *p, expression_value_t *value)
{
    if (fcsl_parser_take(p, "-")) {
        expression_value_t operand;
        const int status = fcsl_parser_deeper(p, &operand, read_unary);
        *value = operand;
        return status == 0 && !p->skip ? fcsl_parser_judge(p, fcsl_value_negate(&operand, value)) : status;
    }
    if (fcsl_parser_take(p, "+")) {
        const int status = fcsl_parser_deeper(p, value, read_unary);
        return status == 0 && !p->skip && !fcsl_value_is_number(value) ? fcsl_parser_fail(p, "a sign needs a number")
                                                                       : status;
    }
    return fcsl_parser_atom(p, value);
}

static int apply(expression_parser_t *p, operator_t op, expression_value_t *left, const expression_value_t *right)
{
    expression_value_t result;
    memset(&result, 0, sizeof result);
    if (p->skip) {
        return 0;
    }
    const int status = fcsl_parser_judge(p, fcsl_value_operate(op, left, right, &result));
    *left = result;
    return status;
}

static int read_term(expression_parser_t *p, expression_value_t *value)
{
    expression_value_t right;
    if (read_unary(p, value) != 0) {
        return -1;
    }
    for (;;) {
        operator_t op = OP_MULTIPLY;
        if (fcsl_parser_take(p, "//")) {
            op = OP_FLOOR_DIVIDE;
        } else if (fcsl_parser_take(p, "/")) {
            op = OP_DIVIDE;
        } else if (fcsl_parser_take(p, "%")) {
            op = OP_MODULO;
        } else if (!fcsl_parser_take(p, "*")) {
            return 0;
        }
        if (read_unary(p, &right) != 0 || apply(p, op, value, &right) != 0) {
            return -1;
        }
    }
}

static int read_sum(expression_parser_t *p, expression_value_t *value)
{
    expression_value_t right;
    if (read_term(p, value) != 0) {
        return -1;
    }
    for (;;) {
        const int plus = fcsl_parser_take(p, "+");
        if (!plus && !fcsl_parser_take(p, "-")) {
            return 0;
        }
        if (read_term(p, &right) != 0 || apply(p, plus ? OP_ADD : OP_SUBTRACT, value, &right) != 0) {
            return -1;
        }
    }
}

static int take_comparison(expression_parser_t *p, comparison_t *op)
{
    static const char *const symbols[] = {"<=", ">=", "==", "!=", "<", ">"};
    static const comparison_t ops[] = {OP_LESS_EQUAL, OP_GREATER_EQUAL, OP_EQUAL, OP_NOT_EQUAL, OP_LESS, OP_GREATER};
    for (size_t i = 0; i < sizeof ops / sizeof ops[0]; i++) {
        if (fcsl_parser_take(p, symbols[i])) {
            *op = ops[i];
            return 1;
        }
    }
    return 0;
}

/* A chain `a < b < c`: as `a < b and b < c`, each read once. */
static int read_comparison(expression_parser_t *p, expression_value_t *value)
{
    expression_value_t left;
    expression_value_t right;
    comparison_t op = OP_LESS;
    const int skip = p->skip;
    int holds = 1;
    if (read_sum(p, &left) != 0) {
        return -1;
    }
    *value = left;
    while (take_comparison(p, &op)) {
        p->skip = skip || !holds;
        if (read_sum(p, &right) != 0 ||
            (!p->skip && fcsl_parser_judge(p, fcsl_value_compare(op, &left, &right, &holds)) != 0)) {
            return -1;
        }
        *value = (expression_value_t){.kind = VALUE_BOOL, .integer = holds};
        left = right;
    }
    p->skip = skip;
    return 0;
}

static int read_not(expression_parser_t *p, expression_value_t *value)
{
    if (!fcsl_parser_take_word(p, "not")) {
        return read_comparison(p, value);
    }
    const int status = fcsl_parser_deeper(p, value, read_not);
    if (status != 0 || p->skip) {
        return status;
    }
    value->integer = !value->integer;
    return value->kind == VALUE_BOOL ? 0 : fcsl_parser_fail(p, "`not` needs a bool");
}

/* Operands of `word`, of which the value `decisive` decides at once. */
static int read_logic(expression_parser_t *p, expression_value_t *value, const char *word, int decisive,
                      expression_reader_t *read)
{
    const int skip = p->skip;
    expression_value_t right;
    if (read(p, value) != 0) {
        return -1;
    }
    while (fcsl_parser_take_word(p, word)) {
        if (!skip && value->kind != VALUE_BOOL) {
            return fcsl_parser_fail(p, "`and` and `or` need bools");
        }
        p->skip = skip || value->integer == decisive;
        if (read(p, &right) != 0) {
            return -1;
        }
        if (!p->skip) {
            if (right.kind != VALUE_BOOL) {
                return fcsl_parser_fail(p, "`and` and `or` need bools");
            }
            *value = right;
        }
    }
    p->skip = skip;
    return 0;
}

static int read_and(expression_parser_t *p, expression_value_t *value)
{
    return read_logic(p, value, "and", 0, read_not);
}

int fcsl_parser_expression(expression_parser_t *p, expression_value_t *value)
{
    return read_logic(p, value, "or", 1, read_and);
}

int fcsl_expression_evaluate(const char *text, const catalog_t *catalog, const uint8_t *snapshot,
                             expression_value_t *value, expression_error_t *error)
{
    expression_parser_t p = {.text = text, .catalog = catalog, .snapshot = snapshot, .error = error};
    if (fcsl_parser_expression(&p, value) != 0) {
        return -1;
    }
    fcsl_parser_skip_blanks(&p);
    return text[p.at] == '\0' ? 0 : fcsl_parser_fail(&p, "an operator expected");
}

void fcsl_expression_write(const expression_value_t *value, json_out_t *out)
{
    switch (value->kind) {
    case VALUE_BOOL:
        fcsl_json_raw(out, value->integer ? "true" : "false");
        return;
    case VALUE_INTEGER:
        fcsl_json_raw(out, "%" PRId64, value->integer);
        return;
    case VALUE_FLOAT:
        fcsl_json_f64(out, value->real);
        return;
    default:
        fcsl_json_quoted(out, value->name);
    }
}
