/* SPDX-License-Identifier: Apache-2.0
 *
 * What expressions have as values, and what they fail with.
 */
#ifndef FCSL_VARS_EXPRESSION_VALUE_H
#define FCSL_VARS_EXPRESSION_VALUE_H

#include "catalog.h"

typedef enum { VALUE_BOOL, VALUE_INTEGER, VALUE_FLOAT, VALUE_NAME } value_kind_t;

typedef struct {
    value_kind_t kind;
    int64_t integer; /* a bool's, too */
    double real;
    char name[PATH_BYTES_MAX];
} expression_value_t;

typedef struct {
    const char *code; /* bad_expression, unknown_path or bad_index */
    const char *hint;
    char text[128];
    size_t at; /* byte of the expression */
} expression_error_t;

#endif /* FCSL_VARS_EXPRESSION_VALUE_H */
