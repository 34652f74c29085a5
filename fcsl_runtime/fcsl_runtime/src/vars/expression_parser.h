/* SPDX-License-Identifier: Apache-2.0
 *
 * What the two halves of the expression parser share: operators (expression.c), atoms (expression_atom.c).
 */
#ifndef FCSL_VARS_EXPRESSION_PARSER_H
#define FCSL_VARS_EXPRESSION_PARSER_H

#include "expression_value.h"

typedef struct {
    const char *text;
    size_t at;
    int depth;
    int values;
    int skip;
    const catalog_t *catalog;
    const uint8_t *snapshot;
    expression_error_t *error;
} expression_parser_t;

/* Notes what is wrong, at this place; always -1. */
int fcsl_parser_fail(expression_parser_t *p, const char *text);
/* 0 when null, else the failure. */
int fcsl_parser_judge(expression_parser_t *p, const char *problem);
void fcsl_parser_skip_blanks(expression_parser_t *p);
/* Take the symbol, or the word, when it stands here. */
int fcsl_parser_take(expression_parser_t *p, const char *symbol);
int fcsl_parser_take_word(expression_parser_t *p, const char *word);

/* Reads and evaluates; 0, or -1. */
typedef int expression_reader_t(expression_parser_t *p, expression_value_t *value);
expression_reader_t fcsl_parser_atom;
expression_reader_t fcsl_parser_expression;
/* What stands in a parenthesis, or behind a sign or `not`. Nothing else makes the parser call itself. */
int fcsl_parser_deeper(expression_parser_t *p, expression_value_t *value, expression_reader_t *read);

#endif /* FCSL_VARS_EXPRESSION_PARSER_H */
