/* SPDX-License-Identifier: Apache-2.0
 *
 * Recursive descent: each part is read, checked and emitted at once.
 */
#include "parser.h"

#include <string.h>

#include "machine/enumerators.h"

int fcsl_parser_deeper(parser_t *p, part_t *part, part_reader_t *read)
{
    if (p->depth == FCSL_EXPRESSION_DEPTH_MAX) {
        return fcsl_parser_fail(p, "nested too deeply");
    }
    p->depth++;
    const int status = read(p, part);
    p->depth--;
    return status;
}

int fcsl_parser_emit(parser_t *p, operation_t operation, int pushed)
{
    fcsl_expression_t *expression = p->expression;
    p->height += (uint32_t)pushed;
    if (expression->count == FCSL_EXPRESSION_STEPS_MAX || p->height > STACK_MAX) {
        return fcsl_parser_fail(p, "the expression is too long");
    }
    expression->steps[expression->count++] =
        (fcsl_expression_step_t){.operation = (uint8_t)operation, .at = (uint16_t)p->at};
    return 0;
}

fcsl_expression_step_t *fcsl_parser_last(parser_t *p)
{
    return &p->expression->steps[p->expression->count - 1u];
}

/* ---- what a part must be ------------------------------------------------------------------------------------------- */

int fcsl_parser_need_number(parser_t *p, const part_t *part)
{
    return part->kind != FCSL_EXPRESSION_NAME ? 0 : fcsl_parser_fail(p, "a name is not a number");
}

int fcsl_parser_need_bool(parser_t *p, const part_t *part)
{
    return part->kind == FCSL_EXPRESSION_BOOL && part->count == 0
               ? 0
               : fcsl_parser_fail(p, "`and`, `or` and `not` need conditions: compare this value");
}

int fcsl_parser_need_scalar(parser_t *p, const part_t *part)
{
    return part->count == 0 ? 0 : fcsl_parser_fail(p, "vectors have no order: take an element, or `norm`");
}

int fcsl_parser_same_count(parser_t *p, part_t *part, const part_t *other)
{
    if (part->count != 0 && other->count != 0 && part->count != other->count) {
        return fcsl_parser_fail(p, "vectors of different sizes");
    }
    part->count = part->count != 0 ? part->count : other->count;
    return 0;
}

/* ---- arithmetic ---------------------------------------------------------------------------------------------------- */

/* Reads the right operand; `part` becomes the result's. */
static int read_right(parser_t *p, part_t *part, operation_t operation, part_reader_t *read)
{
    part_t right;
    if (fcsl_parser_need_number(p, part) != 0 || read(p, &right) != 0 || fcsl_parser_need_number(p, &right) != 0 ||
        fcsl_parser_same_count(p, part, &right) != 0) {
        return -1;
    }
    const int real = part->kind == FCSL_EXPRESSION_FLOAT || right.kind == FCSL_EXPRESSION_FLOAT ||
                     operation == STEP_DIVIDE || operation == STEP_POWER;
    part->kind = real ? FCSL_EXPRESSION_FLOAT : FCSL_EXPRESSION_INTEGER;
    return fcsl_parser_emit(p, operation, -1);
}

static int read_unary(parser_t *p, part_t *part);

static int read_exponent(parser_t *p, part_t *part)
{
    return fcsl_parser_deeper(p, part, read_unary);
}

/* `**` binds closer than a sign before it, and not as close as one behind it. */
static int read_power(parser_t *p, part_t *part)
{
    if (fcsl_parser_atom(p, part) != 0) {
        return -1;
    }
    return fcsl_parser_take(p, "**") ? read_right(p, part, STEP_POWER, read_exponent) : 0;
}

static int read_unary(parser_t *p, part_t *part)
{
    const int minus = fcsl_parser_take(p, "-");
    if (!minus && !fcsl_parser_take(p, "+")) {
        return read_power(p, part);
    }
    if (fcsl_parser_deeper(p, part, read_unary) != 0 || fcsl_parser_need_number(p, part) != 0) {
        return -1;
    }
    part->kind = part->kind == FCSL_EXPRESSION_BOOL ? FCSL_EXPRESSION_INTEGER : part->kind;
    return fcsl_parser_emit(p, minus ? STEP_NEGATIVE : STEP_POSITIVE, 0);
}

static int read_term(parser_t *p, part_t *part)
{
    if (read_unary(p, part) != 0) {
        return -1;
    }
    for (;;) {
        operation_t operation = STEP_MULTIPLY;
        if (fcsl_parser_take(p, "//")) {
            operation = STEP_FLOOR_DIVIDE;
        } else if (fcsl_parser_take(p, "/")) {
            operation = STEP_DIVIDE;
        } else if (fcsl_parser_take(p, "%")) {
            operation = STEP_MODULO;
        } else if (!fcsl_parser_take(p, "*")) {
            return 0;
        }
        if (read_right(p, part, operation, read_unary) != 0) {
            return -1;
        }
    }
}

static int read_sum(parser_t *p, part_t *part)
{
    if (read_term(p, part) != 0) {
        return -1;
    }
    for (;;) {
        const int plus = fcsl_parser_take(p, "+");
        if (!plus && !fcsl_parser_take(p, "-")) {
            return 0;
        }
        if (read_right(p, part, plus ? STEP_ADD : STEP_SUBTRACT, read_term) != 0) {
            return -1;
        }
    }
}

/* ---- comparisons --------------------------------------------------------------------------------------------------- */

/* Names of healths are the same everywhere. */
static int has_names_of(const part_t *a, const part_t *b)
{
    return a->type == b->type && (a->type == FCSL_HEALTH || a->machine == b->machine);
}

/* The number of a name in quotes, which only the field that it is compared with knows. */
static int resolve_name(parser_t *p, part_t *literal, const part_t *field)
{
    const int32_t number = fcsl_enumerator_find(field->machine, field->type, literal->literal, literal->length);
    if (number == FCSL_NONE || (literal->is_resolved && !has_names_of(literal, field))) {
        p->at = (size_t)(literal->literal - p->text);
        return fcsl_parser_fail(p, "the field never has this name");
    }
    literal->is_resolved = 1;
    literal->type = field->type;
    literal->machine = field->machine;
    p->expression->steps[literal->step].with.integer = number;
    return 0;
}

static int need_comparable(parser_t *p, part_t *left, comparison_t comparison, part_t *right)
{
    if (fcsl_parser_need_scalar(p, left) != 0 || fcsl_parser_need_scalar(p, right) != 0) {
        return -1;
    }
    if (left->kind != FCSL_EXPRESSION_NAME && right->kind != FCSL_EXPRESSION_NAME) {
        return 0;
    }
    if (left->kind != right->kind) {
        return fcsl_parser_fail(p, "a name and a number cannot be compared");
    }
    if (comparison != COMPARE_EQUAL && comparison != COMPARE_NOT_EQUAL) {
        return fcsl_parser_fail(p, "names have no order");
    }
    if (left->literal == NULL && right->literal == NULL) {
        return has_names_of(left, right) ? 0 : fcsl_parser_fail(p, "names of different kinds cannot be compared");
    }
    if (left->literal != NULL && right->literal != NULL) {
        return fcsl_parser_fail(p, "a name in quotes is compared with a field");
    }
    return left->literal != NULL ? resolve_name(p, left, right) : resolve_name(p, right, left);
}

static int take_comparison(parser_t *p, comparison_t *comparison)
{
    static const char *const symbols[] = {"<=", ">=", "==", "!=", "<", ">"};
    static const comparison_t comparisons[] = {COMPARE_LESS_EQUAL, COMPARE_GREATER_EQUAL, COMPARE_EQUAL,
                                               COMPARE_NOT_EQUAL,  COMPARE_LESS,          COMPARE_GREATER};
    for (size_t i = 0; i < sizeof comparisons / sizeof comparisons[0]; i++) {
        if (fcsl_parser_take(p, symbols[i])) {
            *comparison = comparisons[i];
            return 1;
        }
    }
    return 0;
}

/* `in` or `not in`, when it stands here; a list may follow at once, `in[1, 2]`. */
static int take_membership(parser_t *p, int *negated)
{
    const size_t from = p->at;
    *negated = fcsl_parser_take_word(p, "not");
    if (fcsl_parser_take_word(p, "in") || fcsl_parser_take(p, "in[")) {
        p->at -= p->text[p->at - 1u] == '[' ? 1u : 0u;
        return 1;
    }
    p->at = from;
    return 0;
}

static int read_items(parser_t *p, part_t *part, int negated)
{
    const char *closing = fcsl_parser_take(p, "(") ? ")" : "]";
    if (*closing == ']' && !fcsl_parser_take(p, "[")) {
        return fcsl_parser_fail(p, "`in` takes a list, such as ('RUN', 'SAFE')");
    }
    if (fcsl_parser_emit(p, STEP_BOOL, 1) != 0) {
        return -1;
    }
    int commas = 0;
    int items = 0;
    do {
        part_t item;
        if (items > 0 && fcsl_parser_take(p, closing)) {
            break;
        }
        if (fcsl_parser_deeper(p, &item, fcsl_parser_expression) != 0 ||
            need_comparable(p, part, COMPARE_EQUAL, &item) != 0 || fcsl_parser_emit(p, STEP_MEMBER, -1) != 0) {
            return -1;
        }
        items++;
        commas += fcsl_parser_take(p, ",");
        if (commas < items && !fcsl_parser_take(p, closing)) {
            return fcsl_parser_fail(p, "',' or the end of the list expected");
        }
    } while (commas == items);
    if (items == 1 && commas == 0 && *closing == ')') {
        return fcsl_parser_fail(p, "`in` takes a list: write a comma behind a single value");
    }
    *part = (part_t){.kind = FCSL_EXPRESSION_BOOL};
    if (fcsl_parser_emit(p, STEP_MEMBERS, -1) != 0) {
        return -1;
    }
    fcsl_parser_last(p)->type = (uint8_t)negated;
    return 0;
}

/* A chain `a < b < c`: as `a < b and b < c`, each read once. */
static int read_comparison(parser_t *p, part_t *part)
{
    comparison_t comparison = COMPARE_LESS;
    int negated = 0;
    if (read_sum(p, part) != 0) {
        return -1;
    }
    if (take_membership(p, &negated)) {
        return read_items(p, part, negated);
    }
    part_t left = *part;
    uint32_t first = FCSL_EXPRESSION_STEPS_MAX; /* of the chain's jumps, each of which leads to the one before */
    int more = take_comparison(p, &comparison);
    while (more) {
        part_t right;
        if (read_sum(p, &right) != 0 || need_comparable(p, &left, comparison, &right) != 0) {
            return -1;
        }
        comparison_t next = COMPARE_LESS;
        more = take_comparison(p, &next);
        if (fcsl_parser_emit(p, more ? STEP_CHAIN : STEP_COMPARE, -1) != 0) {
            return -1;
        }
        fcsl_expression_step_t *step = fcsl_parser_last(p);
        step->type = (uint8_t)comparison;
        if (more) {
            step->target = first;
            first = p->expression->count - 1u;
        }
        comparison = next;
        left = right;
        *part = (part_t){.kind = FCSL_EXPRESSION_BOOL};
    }
    while (first != FCSL_EXPRESSION_STEPS_MAX) {
        const uint32_t before = p->expression->steps[first].target;
        p->expression->steps[first].target = p->expression->count;
        first = before;
    }
    return 0;
}

/* ---- logic --------------------------------------------------------------------------------------------------------- */

static int read_not(parser_t *p, part_t *part)
{
    if (!fcsl_parser_take_word(p, "not")) {
        return read_comparison(p, part);
    }
    if (fcsl_parser_deeper(p, part, read_not) != 0 || fcsl_parser_need_bool(p, part) != 0) {
        return -1;
    }
    return fcsl_parser_emit(p, STEP_NOT, 0);
}

/* Operands of `word`; the jump leaves out those that no longer matter. */
static int read_logic(parser_t *p, part_t *part, const char *word, operation_t jump, part_reader_t *read)
{
    if (read(p, part) != 0) {
        return -1;
    }
    while (fcsl_parser_take_word(p, word)) {
        if (fcsl_parser_need_bool(p, part) != 0 || fcsl_parser_emit(p, jump, -1) != 0) {
            return -1;
        }
        fcsl_expression_step_t *step = fcsl_parser_last(p);
        if (read(p, part) != 0 || fcsl_parser_need_bool(p, part) != 0) {
            return -1;
        }
        step->target = p->expression->count;
    }
    return 0;
}

static int read_and(parser_t *p, part_t *part)
{
    return read_logic(p, part, "and", STEP_IF_FALSE, read_not);
}

int fcsl_parser_expression(parser_t *p, part_t *part)
{
    return read_logic(p, part, "or", STEP_IF_TRUE, read_and);
}

int fcsl_expression_compile(const char *text, fcsl_expression_find_t *find, const void *context,
                            fcsl_expression_t *expression, fcsl_expression_error_t *error)
{
    parser_t p = {
        .text = text, .element = -1, .find = find, .context = context, .expression = expression, .error = error};
    part_t part;
    expression->count = 0;
    if (strlen(text) >= FCSL_EXPRESSION_BYTES_MAX) {
        return fcsl_parser_fail(&p, "the expression is too long");
    }
    if (fcsl_parser_expression(&p, &part) != 0) {
        return -1;
    }
    fcsl_parser_skip_blanks(&p);
    if (text[p.at] != '\0') {
        return fcsl_parser_fail(&p, "an operator expected");
    }
    if (part.literal != NULL) {
        return fcsl_parser_fail(&p, "a name in quotes is compared with a field");
    }
    expression->kind = part.kind;
    expression->type = part.type;
    expression->machine = part.machine;
    return 0;
}
