/* SPDX-License-Identifier: Apache-2.0
 *
 * Python's operators on values of expressions.
 */
#ifndef FCSL_EXPRESSION_ARITHMETIC_H
#define FCSL_EXPRESSION_ARITHMETIC_H

#include "step.h"

/* All return null, or what is wrong. `operation` is STEP_ADD to STEP_POWER. */
const char *fcsl_expression_operate(operation_t operation, const fcsl_expression_value_t *a,
                                    const fcsl_expression_value_t *b, fcsl_expression_value_t *result);
const char *fcsl_expression_negative(const fcsl_expression_value_t *a, fcsl_expression_value_t *result);
const char *fcsl_expression_sqrt(const fcsl_expression_value_t *a, fcsl_expression_value_t *result);

int fcsl_expression_compare(comparison_t comparison, const fcsl_expression_value_t *a,
                            const fcsl_expression_value_t *b);
double fcsl_expression_as_double(const fcsl_expression_value_t *value);

#endif /* FCSL_EXPRESSION_ARITHMETIC_H */
