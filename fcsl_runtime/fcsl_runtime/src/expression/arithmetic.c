/* SPDX-License-Identifier: Apache-2.0
 *
 * Python's operators on values of expressions.
 */
#include "arithmetic.h"

#include <math.h>

static const char OVERFLOW[] = "the result does not fit 64 bits";
static const char ZERO[] = "division by zero";
/* Integers up to here are doubles, too. */
static const int64_t EXACT_MAX = INT64_C(1) << 53;

double fcsl_expression_as_double(const fcsl_expression_value_t *value)
{
    return value->kind == FCSL_EXPRESSION_FLOAT ? value->real : (double)value->integer;
}

static const char *integer_divide(int64_t a, int64_t b, operation_t op, int64_t *result)
{
    if (b == 0) {
        return ZERO;
    }
    if (b == -1) { /* the one divisor whose quotient may not fit */
        *result = 0;
        return op == STEP_FLOOR_DIVIDE && __builtin_sub_overflow((int64_t)0, a, result) ? OVERFLOW : NULL;
    }
    const int64_t quotient = a / b;
    const int64_t rest = a % b;
    const int below = rest != 0 && (rest ^ b) < 0;
    *result = op == STEP_FLOOR_DIVIDE ? quotient - below : rest + (below ? b : 0);
    return NULL;
}

/* CPython's float floor division and modulo: the quotient is not floor(a / b), which may round up. */
static void float_divide(double a, double b, double *quotient, double *rest)
{
    double mod = fmod(a, b);
    double div = (a - mod) / b;
    if (mod != 0.0) {
        if ((b < 0.0) != (mod < 0.0)) {
            mod += b;
            div -= 1.0;
        }
    } else {
        mod = copysign(0.0, b);
    }
    double whole = 0.0;
    if (div != 0.0) {
        whole = floor(div);
        whole += div - whole > 0.5 ? 1.0 : 0.0;
    } else {
        whole = copysign(0.0, a / b);
    }
    *quotient = whole;
    *rest = mod;
}

static const char *operate_integers(operation_t op, int64_t a, int64_t b, fcsl_expression_value_t *result)
{
    result->kind = FCSL_EXPRESSION_INTEGER;
    switch (op) {
    case STEP_ADD:
        return __builtin_add_overflow(a, b, &result->integer) ? OVERFLOW : NULL;
    case STEP_SUBTRACT:
        return __builtin_sub_overflow(a, b, &result->integer) ? OVERFLOW : NULL;
    case STEP_MULTIPLY:
        return __builtin_mul_overflow(a, b, &result->integer) ? OVERFLOW : NULL;
    case STEP_DIVIDE:
        if (b == 0) {
            return ZERO;
        }
        if (a > EXACT_MAX || a < -EXACT_MAX || b > EXACT_MAX || b < -EXACT_MAX) {
            return "integers beyond 2^53 cannot be divided by /";
        }
        result->kind = FCSL_EXPRESSION_FLOAT;
        result->real = (double)a / (double)b;
        return NULL;
    default:
        return integer_divide(a, b, op, &result->integer);
    }
}

static const char *operate_floats(operation_t op, double a, double b, fcsl_expression_value_t *result)
{
    double quotient = 0.0;
    double rest = 0.0;
    result->kind = FCSL_EXPRESSION_FLOAT;
    switch (op) {
    case STEP_ADD:
        result->real = a + b;
        return NULL;
    case STEP_SUBTRACT:
        result->real = a - b;
        return NULL;
    case STEP_MULTIPLY:
        result->real = a * b;
        return NULL;
    default:
        break;
    }
    if (b == 0.0) {
        return ZERO;
    }
    float_divide(a, b, &quotient, &rest);
    result->real = op == STEP_DIVIDE ? a / b : op == STEP_FLOOR_DIVIDE ? quotient : rest;
    return NULL;
}

/* As Python's math.pow. */
static const char *power(double a, double b, fcsl_expression_value_t *result)
{
    *result = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_FLOAT, .real = pow(a, b)};
    return isfinite(a) && isfinite(b) && !isfinite(result->real) ? "this power is no number, or too large" : NULL;
}

const char *fcsl_expression_operate(operation_t op, const fcsl_expression_value_t *a, const fcsl_expression_value_t *b,
                                    fcsl_expression_value_t *result)
{
    if (op == STEP_POWER) {
        return power(fcsl_expression_as_double(a), fcsl_expression_as_double(b), result);
    }
    return a->kind != FCSL_EXPRESSION_FLOAT && b->kind != FCSL_EXPRESSION_FLOAT
               ? operate_integers(op, a->integer, b->integer, result)
               : operate_floats(op, fcsl_expression_as_double(a), fcsl_expression_as_double(b), result);
}

const char *fcsl_expression_negative(const fcsl_expression_value_t *a, fcsl_expression_value_t *result)
{
    if (a->kind == FCSL_EXPRESSION_FLOAT) {
        *result = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_FLOAT, .real = -a->real};
        return NULL;
    }
    result->kind = FCSL_EXPRESSION_INTEGER;
    return __builtin_sub_overflow((int64_t)0, a->integer, &result->integer) ? OVERFLOW : NULL;
}

const char *fcsl_expression_sqrt(const fcsl_expression_value_t *a, fcsl_expression_value_t *result)
{
    const double x = fcsl_expression_as_double(a);
    *result = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_FLOAT, .real = sqrt(x)};
    return x < 0.0 ? "the square root of a negative number" : NULL;
}

/* Every 64-bit integer and every double is a long double where it has 64 bits of mantissa or more: compared exactly. */
static long double exact(const fcsl_expression_value_t *value)
{
    return value->kind == FCSL_EXPRESSION_FLOAT ? (long double)value->real : (long double)value->integer;
}

static int holds_between(comparison_t op, long double a, long double b)
{
    switch (op) {
    case COMPARE_LESS:
        return a < b;
    case COMPARE_LESS_EQUAL:
        return a <= b;
    case COMPARE_GREATER:
        return a > b;
    case COMPARE_GREATER_EQUAL:
        return a >= b;
    case COMPARE_EQUAL:
        return a == b;
    default:
        return a != b;
    }
}

int fcsl_expression_compare(comparison_t op, const fcsl_expression_value_t *a, const fcsl_expression_value_t *b)
{
    return a->kind != FCSL_EXPRESSION_FLOAT && b->kind != FCSL_EXPRESSION_FLOAT
               ? holds_between(op, a->integer < b->integer ? -1 : a->integer > b->integer, 0)
               : holds_between(op, exact(a), exact(b));
}
