/* SPDX-License-Identifier: Apache-2.0
 *
 * Python's operators on values of expressions.
 */
#ifndef FCSL_VARS_ARITHMETIC_H
#define FCSL_VARS_ARITHMETIC_H

#include "expression_value.h"

typedef enum { OP_ADD, OP_SUBTRACT, OP_MULTIPLY, OP_DIVIDE, OP_FLOOR_DIVIDE, OP_MODULO } operator_t;
typedef enum { OP_LESS, OP_LESS_EQUAL, OP_GREATER, OP_GREATER_EQUAL, OP_EQUAL, OP_NOT_EQUAL } comparison_t;

/* All return null, or what is wrong. */
const char *fcsl_value_operate(operator_t op, const expression_value_t *a, const expression_value_t *b,
                               expression_value_t *result);
const char *fcsl_value_compare(comparison_t op, const expression_value_t *a, const expression_value_t *b, int *holds);
const char *fcsl_value_negate(const expression_value_t *a, expression_value_t *result);

int fcsl_value_is_number(const expression_value_t *value);
double fcsl_value_as_double(const expression_value_t *value);

#endif /* FCSL_VARS_ARITHMETIC_H */
