/* SPDX-License-Identifier: Apache-2.0
 *
 * Python's operators on values of expressions.
 */
#include "arithmetic.h"

#include <math.h>
#include <string.h>

static const char OVERFLOW[] = "the result does not fit 64 bits";
static const char ZERO[] = "division by zero";
/* Integers up to here are doubles, too. */
static const int64_t EXACT_MAX = INT64_C(1) << 53;

int fcsl_value_is_number(const expression_value_t *value)
{
    return value->kind == VALUE_INTEGER || value->kind == VALUE_FLOAT;
}

double fcsl_value_as_double(const expression_value_t *value)
{
    return value->kind == VALUE_FLOAT ? value->real : (double)value->integer;
}

static const char *integer_divide(int64_t a, int64_t b, operator_t op, int64_t *result)
{
    if (b == 0) {
        return ZERO;
    }
    if (b == -1) { /* the one divisor whose quotient may not fit */
        *result = 0;
        return op == OP_FLOOR_DIVIDE && __builtin_sub_overflow((int64_t)0, a, result) ? OVERFLOW : NULL;
    }
    const int64_t quotient = a / b;
    const int64_t rest = a % b;
    const int below = rest != 0 && (rest ^ b) < 0;
    *result = op == OP_FLOOR_DIVIDE ? quotient - below : rest + (below ? b : 0);
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

static const char *operate_integers(operator_t op, int64_t a, int64_t b, expression_value_t *result)
{
    result->kind = VALUE_INTEGER;
    switch (op) {
    case OP_ADD:
        return __builtin_add_overflow(a, b, &result->integer) ? OVERFLOW : NULL;
    case OP_SUBTRACT:
        return __builtin_sub_overflow(a, b, &result->integer) ? OVERFLOW : NULL;
    case OP_MULTIPLY:
        return __builtin_mul_overflow(a, b, &result->integer) ? OVERFLOW : NULL;
    case OP_DIVIDE:
        if (b == 0) {
            return ZERO;
        }
        if (a > EXACT_MAX || a < -EXACT_MAX || b > EXACT_MAX || b < -EXACT_MAX) {
            return "integers beyond 2^53 cannot be divided by /";
        }
        result->kind = VALUE_FLOAT;
        result->real = (double)a / (double)b;
        return NULL;
    default:
        return integer_divide(a, b, op, &result->integer);
    }
}

static const char *operate_floats(operator_t op, double a, double b, expression_value_t *result)
{
    double quotient = 0.0;
    double rest = 0.0;
    result->kind = VALUE_FLOAT;
    switch (op) {
    case OP_ADD:
        result->real = a + b;
        return NULL;
    case OP_SUBTRACT:
        result->real = a - b;
        return NULL;
    case OP_MULTIPLY:
        result->real = a * b;
        return NULL;
    default:
        break;
    }
    if (b == 0.0) {
        return ZERO;
    }
    float_divide(a, b, &quotient, &rest);
    result->real = op == OP_DIVIDE ? a / b : op == OP_FLOOR_DIVIDE ? quotient : rest;
    return NULL;
}

const char *fcsl_value_operate(operator_t op, const expression_value_t *a, const expression_value_t *b,
                               expression_value_t *result)
{
    if (!fcsl_value_is_number(a) || !fcsl_value_is_number(b)) {
        return "arithmetic needs numbers on both sides";
    }
    return a->kind == VALUE_INTEGER && b->kind == VALUE_INTEGER
               ? operate_integers(op, a->integer, b->integer, result)
               : operate_floats(op, fcsl_value_as_double(a), fcsl_value_as_double(b), result);
}

const char *fcsl_value_negate(const expression_value_t *a, expression_value_t *result)
{
    if (!fcsl_value_is_number(a)) {
        return "a sign needs a number";
    }
    result->kind = a->kind;
    result->real = -a->real;
    return a->kind == VALUE_INTEGER && __builtin_sub_overflow((int64_t)0, a->integer, &result->integer) ? OVERFLOW
                                                                                                        : NULL;
}

/* Every 64-bit integer and every double is a long double where it has 64 bits of mantissa or more: compared exactly. */
static long double exact(const expression_value_t *value)
{
    return value->kind == VALUE_FLOAT ? (long double)value->real : (long double)value->integer;
}

static int holds_between(comparison_t op, long double a, long double b)
{
    switch (op) {
    case OP_LESS:
        return a < b;
    case OP_LESS_EQUAL:
        return a <= b;
    case OP_GREATER:
        return a > b;
    case OP_GREATER_EQUAL:
        return a >= b;
    case OP_EQUAL:
        return a == b;
    default:
        return a != b;
    }
}

const char *fcsl_value_compare(comparison_t op, const expression_value_t *a, const expression_value_t *b, int *holds)
{
    if (fcsl_value_is_number(a) && fcsl_value_is_number(b)) {
        *holds = a->kind == VALUE_INTEGER && b->kind == VALUE_INTEGER
                     ? holds_between(op, a->integer < b->integer ? -1 : a->integer > b->integer, 0)
                     : holds_between(op, exact(a), exact(b));
        return NULL;
    }
    if (a->kind != b->kind) {
        return "values of different kinds cannot be compared";
    }
    if (op != OP_EQUAL && op != OP_NOT_EQUAL) {
        return "only numbers have an order";
    }
    const int same = a->kind == VALUE_NAME ? strcmp(a->name, b->name) == 0 : a->integer == b->integer;
    *holds = same == (op == OP_EQUAL);
    return NULL;
}
