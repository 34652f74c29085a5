/* SPDX-License-Identifier: Apache-2.0
 *
 * Numbers, names, fields and functions of expressions.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "parser.h"

int fcsl_parser_fail(parser_t *p, const char *text)
{
    p->error->code = "bad_expression";
    p->error->hint = "";
    p->error->at = p->at;
    (void)snprintf(p->error->text, sizeof p->error->text, "%s", text);
    return -1;
}

void fcsl_parser_skip_blanks(parser_t *p)
{
    while (p->text[p->at] != '\0' && strchr(" \t\r\n", p->text[p->at]) != NULL) {
        p->at++;
    }
}

static int is_letter(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

static int is_digit(char c)
{
    return c >= '0' && c <= '9';
}

int fcsl_parser_take(parser_t *p, const char *symbol)
{
    fcsl_parser_skip_blanks(p);
    const size_t length = strlen(symbol);
    if (strncmp(p->text + p->at, symbol, length) != 0) {
        return 0;
    }
    p->at += length;
    return 1;
}

int fcsl_parser_take_word(parser_t *p, const char *word)
{
    fcsl_parser_skip_blanks(p);
    const size_t length = strlen(word);
    const char behind = strncmp(p->text + p->at, word, length) == 0 ? p->text[p->at + length] : 'x';
    if (is_letter(behind) || is_digit(behind) || behind == '.' || behind == '[') {
        return 0;
    }
    p->at += length;
    return 1;
}

/* ---- atoms --------------------------------------------------------------------------------------------------------- */

static int read_number(parser_t *p, part_t *part)
{
    const size_t from = p->at;
    const char *text = p->text;
    int real = 0;
    while (is_digit(text[p->at])) {
        p->at++;
    }
    if (text[p->at] == '.') {
        real = 1;
        p->at++;
        while (is_digit(text[p->at])) {
            p->at++;
        }
    }
    if ((text[p->at] == 'e' || text[p->at] == 'E') &&
        is_digit(text[p->at + 1 + (text[p->at + 1] == '-' || text[p->at + 1] == '+')])) {
        real = 1;
        p->at += 2;
        while (is_digit(text[p->at])) {
            p->at++;
        }
    }
    if (is_letter(text[p->at]) || text[p->at] == '.' || (!real && text[from] == '0' && p->at - from > 1)) {
        return fcsl_parser_fail(p, "malformed number");
    }
    part->kind = real ? FCSL_EXPRESSION_FLOAT : FCSL_EXPRESSION_INTEGER;
    if (fcsl_parser_emit(p, real ? STEP_FLOAT : STEP_INTEGER, 1) != 0) {
        return -1;
    }
    if (real) {
        fcsl_parser_last(p)->with.real = strtod(text + from, NULL);
        return 0;
    }
    errno = 0;
    fcsl_parser_last(p)->with.integer = strtoll(text + from, NULL, 10);
    return errno == 0 ? 0 : fcsl_parser_fail(p, "this integer does not fit 64 bits");
}

static int read_name(parser_t *p, part_t *part)
{
    const char quote = p->text[p->at++];
    part->kind = FCSL_EXPRESSION_NAME;
    part->literal = p->text + p->at;
    part->step = p->expression->count;
    while (p->text[p->at] != quote) {
        if (p->text[p->at] == '\0' || p->text[p->at] == '\\') {
            return fcsl_parser_fail(p, "a name without its closing quote");
        }
        p->at++;
        part->length++;
    }
    p->at++;
    return fcsl_parser_emit(p, STEP_NAME, 1);
}

static int read_bool(parser_t *p, part_t *part, int value)
{
    part->kind = FCSL_EXPRESSION_BOOL;
    if (fcsl_parser_emit(p, STEP_BOOL, 1) != 0) {
        return -1;
    }
    fcsl_parser_last(p)->with.integer = value;
    return 0;
}

static int load(parser_t *p, const fcsl_expression_operand_t *operand, part_t *part)
{
    part->count = operand->count;
    part->type = operand->type;
    part->machine = operand->machine;
    switch (operand->type) {
    case FCSL_BOOL:
        part->kind = FCSL_EXPRESSION_BOOL;
        break;
    case FCSL_I32:
    case FCSL_U32:
    case FCSL_I64:
    case FCSL_U64:
        part->kind = FCSL_EXPRESSION_INTEGER;
        break;
    case FCSL_F32:
    case FCSL_F64:
        part->kind = FCSL_EXPRESSION_FLOAT;
        break;
    default:
        part->kind = FCSL_EXPRESSION_NAME;
    }
    if (fcsl_parser_emit(p, STEP_LOAD, 1) != 0) {
        return -1;
    }
    fcsl_expression_step_t *step = fcsl_parser_last(p);
    step->type = operand->type;
    step->with.data = operand->elements[operand->count == 0 ? 0 : p->element];
    return 0;
}

/* Letters, digits, dots, and whatever stands in brackets. */
static int read_path(parser_t *p, part_t *part)
{
    char path[FCSL_EXPRESSION_BYTES_MAX];
    size_t length = 0;
    const size_t from = p->at;
    int inside = 0;
    for (;;) {
        const char c = p->text[p->at];
        if (c == '\0' || (!inside && !is_letter(c) && !is_digit(c) && c != '.' && c != '[')) {
            break;
        }
        inside = c == '[' ? 1 : c == ']' ? 0 : inside;
        if (c != ' ') {
            path[length++] = c;
        }
        p->at++;
    }
    path[length] = '\0';
    fcsl_expression_operand_t operand;
    if (p->find(p->context, path, &operand, p->error) != 0) {
        p->error->at = from;
        return -1;
    }
    if (operand.count > 0 && p->element < 0) {
        p->at = from;
        return fcsl_parser_fail(p, "a vector: name one of its elements, or take its `norm`");
    }
    return load(p, &operand, part);
}

/* ---- functions ----------------------------------------------------------------------------------------------------- */

typedef struct {
    const char *name;
    operation_t operation;
    int is_test;  /* its value is a bool */
    int is_real;  /* its value is a double */
    int is_of_many;
} function_t;

static const function_t FUNCTIONS[] = {
    {"abs", STEP_ABS, 0, 0, 0},           {"sqrt", STEP_SQRT, 0, 1, 0},   {"degrees", STEP_DEGREES, 0, 1, 0},
    {"isnan", STEP_ISNAN, 1, 0, 0},       {"min", STEP_MINIMUM, 0, 0, 1}, {"max", STEP_MAXIMUM, 0, 0, 1},
    {"isfinite", STEP_ISFINITE, 1, 0, 0},
};

static int read_argument(parser_t *p, part_t *part)
{
    return fcsl_parser_deeper(p, part, fcsl_parser_expression) != 0 ? -1 : fcsl_parser_need_number(p, part);
}

static int read_arguments(parser_t *p, const function_t *function, part_t *part)
{
    int count = 1;
    if (read_argument(p, part) != 0) {
        return -1;
    }
    part->kind = part->kind == FCSL_EXPRESSION_BOOL ? FCSL_EXPRESSION_INTEGER : part->kind;
    for (; fcsl_parser_take(p, ","); count++) {
        part_t more;
        if (!function->is_of_many || count == FCSL_EXPRESSION_ARGUMENTS_MAX) {
            return fcsl_parser_fail(p, function->is_of_many ? "a function takes at most 8 values"
                                                            : "this function takes one value");
        }
        if (read_argument(p, &more) != 0 || fcsl_parser_same_count(p, part, &more) != 0 ||
            fcsl_parser_emit(p, function->operation, -1) != 0) {
            return -1;
        }
        part->kind = more.kind == FCSL_EXPRESSION_FLOAT ? FCSL_EXPRESSION_FLOAT : part->kind;
    }
    if (function->is_of_many) {
        return count > 1 ? 0 : fcsl_parser_fail(p, "min and max take two values or more");
    }
    if (function->is_test && fcsl_parser_need_scalar(p, part) != 0) {
        return -1;
    }
    part->kind = function->is_test ? FCSL_EXPRESSION_BOOL : function->is_real ? FCSL_EXPRESSION_FLOAT : part->kind;
    return fcsl_parser_emit(p, function->operation, 0);
}

/* The square root of the sum of squares, from the first element to the last: its argument is read once for each. */
static int read_norm(parser_t *p, part_t *part)
{
    const int outer = p->element;
    const size_t from = p->at;
    p->element = 0;
    if (read_argument(p, part) != 0) {
        return -1;
    }
    const uint32_t count = part->count;
    if (count == 0) {
        return fcsl_parser_fail(p, "`norm` is of a vector");
    }
    if (fcsl_parser_emit(p, STEP_SQUARE, 0) != 0) {
        return -1;
    }
    while (++p->element < (int)count) {
        p->at = from;
        if (read_argument(p, part) != 0 || fcsl_parser_emit(p, STEP_SQUARE, 0) != 0 ||
            fcsl_parser_emit(p, STEP_ADD, -1) != 0) {
            return -1;
        }
    }
    p->element = outer;
    *part = (part_t){.kind = FCSL_EXPRESSION_FLOAT};
    return fcsl_parser_emit(p, STEP_SQRT, 0);
}

static int read_call(parser_t *p, const function_t *function, part_t *part)
{
    const int status = function == NULL ? read_norm(p, part) : read_arguments(p, function, part);
    if (status != 0) {
        return -1;
    }
    return fcsl_parser_take(p, ")") ? 0 : fcsl_parser_fail(p, "',' or ')' expected");
}

/* A call of the function, when its name and a parenthesis stand here. */
static int take_call(parser_t *p, const char *name)
{
    const size_t from = p->at;
    if (fcsl_parser_take_word(p, name) && fcsl_parser_take(p, "(")) {
        return 1;
    }
    p->at = from;
    return 0;
}

int fcsl_parser_atom(parser_t *p, part_t *part)
{
    memset(part, 0, sizeof *part);
    fcsl_parser_skip_blanks(p);
    const char c = p->text[p->at];
    if (c == '(') {
        p->at++;
        return fcsl_parser_deeper(p, part, fcsl_parser_expression) != 0 ? -1
               : fcsl_parser_take(p, ")")                               ? 0
                                                                        : fcsl_parser_fail(p, "')' expected");
    }
    p->values += p->element > 0 ? 0 : 1; /* `norm` reads its argument again for each element */
    if (p->values > FCSL_EXPRESSION_VALUES_MAX) {
        return fcsl_parser_fail(p, "too many values");
    }
    if (is_digit(c) || (c == '.' && is_digit(p->text[p->at + 1]))) {
        return read_number(p, part);
    }
    if (c == '\'' || c == '"') {
        return read_name(p, part);
    }
    if (fcsl_parser_take_word(p, "true") || fcsl_parser_take_word(p, "True")) {
        return read_bool(p, part, 1);
    }
    if (fcsl_parser_take_word(p, "false") || fcsl_parser_take_word(p, "False")) {
        return read_bool(p, part, 0);
    }
    for (size_t i = 0; i < sizeof FUNCTIONS / sizeof FUNCTIONS[0]; i++) {
        if (take_call(p, FUNCTIONS[i].name)) {
            return read_call(p, &FUNCTIONS[i], part);
        }
    }
    if (take_call(p, "norm")) {
        return read_call(p, NULL, part);
    }
    return is_letter(c) ? read_path(p, part) : fcsl_parser_fail(p, c == '\0' ? "incomplete" : "a value expected");
}
