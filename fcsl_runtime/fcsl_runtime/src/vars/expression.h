/* SPDX-License-Identifier: Apache-2.0
 *
 * Expressions over fields: arithmetic and logic with Python's meaning on 64-bit integers, doubles, booleans and names.
 * Where Python would raise, or an integer would not fit, evaluation fails; length, depth and number of values are bounded.
 *
 *   or-test:    and-test {"or" and-test}          and-test:  not-test {"and" not-test}
 *   not-test:   "not" not-test | comparison       comparison: sum {("<" | "<=" | ">" | ">=" | "==" | "!=") sum}
 *   sum:        term {("+" | "-") term}           term:      unary {("*" | "/" | "//" | "%") unary}
 *   unary:      ("-" | "+") unary | atom
 *   atom:       number | 'name' | "name" | true | false | path | function "(" or-test {"," or-test} ")" | "(" or-test ")"
 *   functions:  abs(x) min(x, y, ...) max(x, y, ...) sqrt(x) isnan(x) isfinite(x), of at most 8 arguments
 */
#ifndef FCSL_VARS_EXPRESSION_H
#define FCSL_VARS_EXPRESSION_H

#include "expression_value.h"
#include "json.h"

/* Evaluates over one publication; 0, or -1 with `error`. */
int fcsl_expression_evaluate(const char *text, const catalog_t *catalog, const uint8_t *snapshot,
                             expression_value_t *value, expression_error_t *error);

void fcsl_expression_write(const expression_value_t *value, json_out_t *out);

#endif /* FCSL_VARS_EXPRESSION_H */
