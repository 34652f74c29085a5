/* SPDX-License-Identifier: Apache-2.0
 *
 * Runs the steps of an expression. The parser has checked kinds and the height of the stack.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "arithmetic.h"
#include "fcsl/fcsl_scalar.h"

static const double DEGREES_PER_RADIAN = 180.0 / 3.14159265358979323846;

static const char *load(const fcsl_expression_step_t *step, fcsl_expression_value_t *value)
{
    uint64_t bits = 0;
    float f32 = 0.0f;
    int32_t i32 = 0;
    const size_t size = fcsl_scalar_size(step->type);
    memcpy(&bits, step->with.data, size); /* for types of 8 bytes; `i32` for those of 4 */
    memcpy(&i32, step->with.data, size < sizeof i32 ? 0 : sizeof i32);
    *value = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_INTEGER, .integer = (int64_t)bits};
    switch (step->type) {
    case FCSL_BOOL:
        *value = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_BOOL, .integer = step->with.data[0] != 0};
        return NULL;
    case FCSL_I32:
        value->integer = i32;
        return NULL;
    case FCSL_U32:
        value->integer = (int64_t)(uint32_t)i32;
        return NULL;
    case FCSL_I64:
        return NULL;
    case FCSL_U64:
        return bits <= INT64_MAX ? NULL : "this value does not fit 64 bits with a sign";
    case FCSL_F32:
        memcpy(&f32, step->with.data, sizeof f32);
        *value = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_FLOAT, .real = (double)f32};
        return NULL;
    case FCSL_F64:
        value->kind = FCSL_EXPRESSION_FLOAT;
        memcpy(&value->real, step->with.data, sizeof value->real);
        return NULL;
    default:
        *value = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_NAME, .integer = i32};
        return NULL;
    }
}

static fcsl_expression_value_t of_bool(int holds)
{
    return (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_BOOL, .integer = holds};
}

/* A bool counts as 1 or 0. */
static fcsl_expression_value_t as_number(const fcsl_expression_value_t *value)
{
    fcsl_expression_value_t number = *value;
    number.kind = value->kind == FCSL_EXPRESSION_FLOAT ? FCSL_EXPRESSION_FLOAT : FCSL_EXPRESSION_INTEGER;
    return number;
}

/* As Python's min and max: the first stays where the second is not better, as NaN is not. */
static fcsl_expression_value_t better(operation_t operation, const fcsl_expression_value_t *a,
                                      const fcsl_expression_value_t *b)
{
    const comparison_t comparison = operation == STEP_MINIMUM ? COMPARE_LESS : COMPARE_GREATER;
    return as_number(fcsl_expression_compare(comparison, b, a) ? b : a);
}

/* The uppermost value becomes another. */
static const char *change(const fcsl_expression_step_t *step, fcsl_expression_value_t *value)
{
    const fcsl_expression_value_t before = *value;
    const double x = fcsl_expression_as_double(value);
    switch (step->operation) {
    case STEP_NEGATIVE:
        return fcsl_expression_negative(&before, value);
    case STEP_POSITIVE:
        *value = as_number(&before);
        return NULL;
    case STEP_NOT:
        *value = of_bool(!before.integer);
        return NULL;
    case STEP_ABS:
        *value = as_number(&before);
        value->real = fabs(value->real);
        return before.kind != FCSL_EXPRESSION_FLOAT && before.integer < 0 ? fcsl_expression_negative(&before, value)
                                                                          : NULL;
    case STEP_SQRT:
        return fcsl_expression_sqrt(&before, value);
    case STEP_DEGREES:
        *value = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_FLOAT, .real = x * DEGREES_PER_RADIAN};
        return NULL;
    case STEP_ISNAN:
        *value = of_bool(isnan(x) != 0);
        return NULL;
    case STEP_ISFINITE:
        *value = of_bool(isfinite(x) != 0);
        return NULL;
    default: /* STEP_SQUARE */
        *value = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_FLOAT, .real = x * x};
        return NULL;
    }
}

/* The two uppermost values become one. */
static const char *join(const fcsl_expression_step_t *step, fcsl_expression_value_t *left,
                        const fcsl_expression_value_t *right)
{
    const fcsl_expression_value_t before = *left;
    switch (step->operation) {
    case STEP_COMPARE:
        *left = of_bool(fcsl_expression_compare((comparison_t)step->type, &before, right));
        return NULL;
    case STEP_MINIMUM:
    case STEP_MAXIMUM:
        *left = better((operation_t)step->operation, &before, right);
        return NULL;
    default:
        return fcsl_expression_operate((operation_t)step->operation, &before, right, left);
    }
}

/* The next step: whether the jump is taken. */
static uint32_t jump(const fcsl_expression_step_t *step, uint32_t next, fcsl_expression_value_t *stack,
                     uint32_t *height)
{
    fcsl_expression_value_t *top = &stack[*height - 1u];
    if (step->operation == STEP_CHAIN) {
        const int holds = fcsl_expression_compare((comparison_t)step->type, top - 1, top);
        top[-1] = holds ? *top : of_bool(0);
        *height -= 1u;
        return holds ? next : step->target;
    }
    if ((top->integer != 0) == (step->operation == STEP_IF_TRUE)) {
        return step->target;
    }
    *height -= 1u;
    return next;
}

int fcsl_expression_run(const fcsl_expression_t *expression, fcsl_expression_value_t *value,
                        fcsl_expression_error_t *error)
{
    fcsl_expression_value_t stack[STACK_MAX];
    uint32_t height = 0;
    uint32_t at = 0;
    memset(stack, 0, sizeof stack[0]);
    while (at < expression->count) { /* every jump leads forward */
        const fcsl_expression_step_t *step = &expression->steps[at++];
        const char *problem = NULL;
        switch (step->operation) {
        case STEP_BOOL:
            stack[height++] = of_bool((int)step->with.integer);
            break;
        case STEP_INTEGER:
            stack[height++] = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_INTEGER, .integer = step->with.integer};
            break;
        case STEP_FLOAT:
            stack[height++] = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_FLOAT, .real = step->with.real};
            break;
        case STEP_NAME:
            stack[height++] = (fcsl_expression_value_t){.kind = FCSL_EXPRESSION_NAME, .integer = step->with.integer};
            break;
        case STEP_LOAD:
            problem = load(step, &stack[height++]);
            break;
        case STEP_CHAIN:
        case STEP_IF_FALSE:
        case STEP_IF_TRUE:
            at = jump(step, at, stack, &height);
            break;
        case STEP_MEMBER:
            height--;
            stack[height - 1u].integer |= fcsl_expression_compare(COMPARE_EQUAL, &stack[height - 2u], &stack[height]);
            break;
        case STEP_MEMBERS:
            height--;
            stack[height - 1u] = of_bool(stack[height].integer != step->type);
            break;
        default:
            if (step->operation >= STEP_NEGATIVE) {
                problem = change(step, &stack[height - 1u]);
                break;
            }
            height--;
            problem = join(step, &stack[height - 1u], &stack[height]);
        }
        if (problem != NULL) {
            *error = (fcsl_expression_error_t){.code = "bad_expression", .hint = "", .at = step->at};
            (void)snprintf(error->text, sizeof error->text, "%s", problem);
            return -1;
        }
    }
    *value = stack[0];
    return 0;
}
