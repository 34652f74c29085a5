/* SPDX-License-Identifier: Apache-2.0
 *
 * Numbers, names, fields and functions of expressions.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arithmetic.h"
#include "expression_parser.h"
#include "fcsl/fcsl_scalar.h"
#include "value.h"

int fcsl_parser_fail(expression_parser_t *p, const char *text)
{
    p->error->code = "bad_expression";
    p->error->hint = "";
    p->error->at = p->at;
    (void)snprintf(p->error->text, sizeof p->error->text, "%s", text);
    return -1;
}

int fcsl_parser_judge(expression_parser_t *p, const char *problem)
{
    return problem == NULL ? 0 : fcsl_parser_fail(p, problem);
}

void fcsl_parser_skip_blanks(expression_parser_t *p)
{
    while (p->text[p->at] == ' ' || p->text[p->at] == '\t') {
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

int fcsl_parser_take(expression_parser_t *p, const char *symbol)
{
    fcsl_parser_skip_blanks(p);
    const size_t length = strlen(symbol);
    if (strncmp(p->text + p->at, symbol, length) != 0) {
        return 0;
    }
    p->at += length;
    return 1;
}

int fcsl_parser_take_word(expression_parser_t *p, const char *word)
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

static int read_number(expression_parser_t *p, expression_value_t *value)
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
    errno = 0;
    value->kind = real ? VALUE_FLOAT : VALUE_INTEGER;
    if (real) {
        value->real = strtod(text + from, NULL);
        return 0;
    }
    value->integer = strtoll(text + from, NULL, 10);
    return errno == 0 ? 0 : fcsl_parser_fail(p, "this integer does not fit 64 bits");
}

static int read_name(expression_parser_t *p, expression_value_t *value)
{
    const char quote = p->text[p->at++];
    size_t length = 0;
    while (p->text[p->at] != quote) {
        if (p->text[p->at] == '\0' || length + 1u >= sizeof value->name) {
            return fcsl_parser_fail(p, "a name without its closing quote");
        }
        value->name[length++] = p->text[p->at++];
    }
    p->at++;
    value->name[length] = '\0';
    value->kind = VALUE_NAME;
    return 0;
}

static int load(expression_parser_t *p, const target_t *target, expression_value_t *value)
{
    const uint8_t type = target->field->type;
    const uint8_t *bytes = p->snapshot + target->at + target->view.offset;
    uint64_t bits = 0;
    float f32 = 0.0f;
    int32_t i32 = 0;
    memcpy(&bits, bytes, fcsl_scalar_size(type)); /* for types of 8 bytes; `i32` for those of 4 */
    memcpy(&i32, bytes, fcsl_scalar_size(type) < sizeof i32 ? 0 : sizeof i32);
    value->kind = VALUE_INTEGER;
    switch (type) {
    case FCSL_BOOL:
        value->kind = VALUE_BOOL;
        value->integer = bytes[0] != 0;
        return 0;
    case FCSL_I32:
        value->integer = i32;
        return 0;
    case FCSL_U32:
        value->integer = (int64_t)(uint32_t)i32;
        return 0;
    case FCSL_I64:
        value->integer = (int64_t)bits;
        return 0;
    case FCSL_U64:
        value->integer = (int64_t)bits;
        return bits <= INT64_MAX ? 0 : fcsl_parser_fail(p, "this value does not fit 64 bits with a sign");
    case FCSL_F32:
        memcpy(&f32, bytes, sizeof f32);
        value->kind = VALUE_FLOAT;
        value->real = (double)f32;
        return 0;
    case FCSL_F64:
        value->kind = VALUE_FLOAT;
        memcpy(&value->real, bytes, sizeof value->real);
        return 0;
    default: {
        char text[PATH_BYTES_MAX];
        value->kind = VALUE_NAME;
        (void)snprintf(value->name, sizeof value->name, "%.255s",
                       fcsl_value_name(target->machine, type, i32, text, sizeof text));
        return 0;
    }
    }
}

/* Letters, digits, dots, and whatever stands in brackets. */
static int read_path(expression_parser_t *p, expression_value_t *value)
{
    char path[PATH_BYTES_MAX];
    size_t length = 0;
    const size_t from = p->at;
    int inside = 0;
    for (;;) {
        const char c = p->text[p->at];
        if (c == '\0' || (!inside && !is_letter(c) && !is_digit(c) && c != '.' && c != '[')) {
            break;
        }
        if (length + 1u >= sizeof path) {
            return fcsl_parser_fail(p, "a path is too long");
        }
        inside = c == '[' ? 1 : c == ']' ? 0 : inside;
        path[length++] = c;
        p->at++;
    }
    path[length] = '\0';
    target_t target;
    const target_status_t status = fcsl_catalog_find(p->catalog, path, &target);
    if (status != TARGET_OK) {
        p->error->code = status == TARGET_INDEX ? "bad_index" : "unknown_path";
        p->error->hint = status == TARGET_INDEX ? target.entry->path : fcsl_catalog_nearest(p->catalog, path);
        p->error->at = from;
        (void)snprintf(p->error->text, sizeof p->error->text, "no field '%.80s'", path);
        return -1;
    }
    if (target.view.rank > 0) {
        p->at = from;
        return fcsl_parser_fail(p, "an expression takes scalars: name one element of this array");
    }
    return p->skip ? 0 : load(p, &target, value);
}

/* ---- functions ----------------------------------------------------------------------------------------------------- */

static const char *call(const char *name, const expression_value_t *arguments, int count, expression_value_t *value)
{
    const int smallest = strcmp(name, "min") == 0;
    for (int i = 0; i < count; i++) {
        if (!fcsl_value_is_number(&arguments[i])) {
            return "functions take numbers";
        }
    }
    *value = arguments[0];
    if (smallest || strcmp(name, "max") == 0) {
        for (int i = 1; i < count; i++) {
            int better = 0;
            (void)fcsl_value_compare(smallest ? OP_LESS : OP_GREATER, &arguments[i], value, &better);
            *value = better ? arguments[i] : *value;
        }
        return count > 1 ? NULL : "min and max take two numbers or more";
    }
    if (count != 1) {
        return "this function takes one number";
    }
    const double x = fcsl_value_as_double(&arguments[0]);
    if (strcmp(name, "abs") == 0) {
        return value->kind == VALUE_FLOAT ? (value->real = fabs(x), NULL)
               : value->integer < 0       ? fcsl_value_negate(&arguments[0], value)
                                          : NULL;
    }
    if (strcmp(name, "sqrt") == 0) {
        value->kind = VALUE_FLOAT;
        value->real = sqrt(x);
        return x < 0.0 ? "the square root of a negative number" : NULL;
    }
    value->kind = VALUE_BOOL;
    value->integer = strcmp(name, "isnan") == 0 ? isnan(x) != 0 : isfinite(x) != 0;
    return NULL;
}

static int read_call(expression_parser_t *p, const char *name, expression_value_t *value)
{
    expression_value_t arguments[ARGUMENTS_MAX];
    int count = 0;
    memset(arguments, 0, sizeof arguments);
    do {
        if (count == ARGUMENTS_MAX) {
            return fcsl_parser_fail(p, "a function takes at most 8 numbers");
        }
        if (fcsl_parser_deeper(p, &arguments[count++], fcsl_parser_expression) != 0) {
            return -1;
        }
    } while (fcsl_parser_take(p, ","));
    if (!fcsl_parser_take(p, ")")) {
        return fcsl_parser_fail(p, "',' or ')' expected");
    }
    return p->skip ? 0 : fcsl_parser_judge(p, call(name, arguments, count, value));
}

int fcsl_parser_atom(expression_parser_t *p, expression_value_t *value)
{
    static const char *const functions[] = {"abs", "min", "max", "sqrt", "isnan", "isfinite"};
    memset(value, 0, sizeof *value);
    fcsl_parser_skip_blanks(p);
    const char c = p->text[p->at];
    if (++p->values > EXPRESSION_VALUES_MAX) {
        return fcsl_parser_fail(p, "too many values");
    }
    if (c == '(') {
        p->at++;
        return fcsl_parser_deeper(p, value, fcsl_parser_expression) != 0 ? -1
               : fcsl_parser_take(p, ")")                                ? 0
                                                                         : fcsl_parser_fail(p, "')' expected");
    }
    if (is_digit(c) || (c == '.' && is_digit(p->text[p->at + 1]))) {
        return read_number(p, value);
    }
    if (c == '\'' || c == '"') {
        return read_name(p, value);
    }
    if (fcsl_parser_take_word(p, "true") || fcsl_parser_take_word(p, "True")) {
        *value = (expression_value_t){.kind = VALUE_BOOL, .integer = 1};
        return 0;
    }
    if (fcsl_parser_take_word(p, "false") || fcsl_parser_take_word(p, "False")) {
        *value = (expression_value_t){.kind = VALUE_BOOL};
        return 0;
    }
    const size_t from = p->at;
    for (size_t i = 0; i < sizeof functions / sizeof functions[0]; i++) {
        if (fcsl_parser_take_word(p, functions[i]) && fcsl_parser_take(p, "(")) {
            return read_call(p, functions[i], value);
        }
        p->at = from;
    }
    return is_letter(c) ? read_path(p, value) : fcsl_parser_fail(p, c == '\0' ? "incomplete" : "a value expected");
}
