/* SPDX-License-Identifier: Apache-2.0
 *
 * What a step of an expression does.
 */
#ifndef FCSL_EXPRESSION_STEP_H
#define FCSL_EXPRESSION_STEP_H

#include "fcsl/fcsl_expression.h"

/* Values at a time: a level of an expression leaves four at most. */
enum { STACK_MAX = 4 * FCSL_EXPRESSION_DEPTH_MAX + 4 };

typedef enum {
    STEP_BOOL, /* pushes a constant */
    STEP_INTEGER,
    STEP_FLOAT,
    STEP_NAME,
    STEP_LOAD, /* pushes a field */
    STEP_ADD, /* the two uppermost values, the second last pushed */
    STEP_SUBTRACT,
    STEP_MULTIPLY,
    STEP_DIVIDE,
    STEP_FLOOR_DIVIDE,
    STEP_MODULO,
    STEP_POWER,
    STEP_MINIMUM,
    STEP_MAXIMUM,
    STEP_COMPARE,
    STEP_NEGATIVE, /* the uppermost value */
    STEP_POSITIVE,
    STEP_NOT,
    STEP_ABS,
    STEP_SQRT,
    STEP_DEGREES,
    STEP_ISNAN,
    STEP_ISFINITE,
    STEP_SQUARE,
    STEP_CHAIN, /* compares two and keeps the second; where it does not hold, false takes its place: jump */
    STEP_IF_FALSE, /* pops a true one; from a false one, which stays: jump */
    STEP_IF_TRUE,
    STEP_MEMBER, /* x, found, item: pops the item, and notes whether it is x */
    STEP_MEMBERS /* x, found: the second alone stays */
} operation_t;

typedef enum {
    COMPARE_LESS,
    COMPARE_LESS_EQUAL,
    COMPARE_GREATER,
    COMPARE_GREATER_EQUAL,
    COMPARE_EQUAL,
    COMPARE_NOT_EQUAL
} comparison_t;

#endif /* FCSL_EXPRESSION_STEP_H */
