/* SPDX-License-Identifier: Apache-2.0
 *
 * Expressions over fields: of the variable server's `eval`, and of a simulation's `until`. Python has a second implementation of
 * the same language (fcsl_compiler/expression), which also knows units; a test compares them (simclient/test/test_vars.py).
 *
 *   or-test:    and-test {"or" and-test}          and-test:  not-test {"and" not-test}
 *   not-test:   "not" not-test | comparison       comparison: sum {("<" | "<=" | ">" | ">=" | "==" | "!=") sum}
 *                                                           | sum ["not"] "in" ("(" | "[") or-test {"," or-test} [","] (")" | "]")
 *   sum:        term {("+" | "-") term}           term:      unary {("*" | "/" | "//" | "%") unary}
 *   unary:      ("-" | "+") unary | power         power:     atom ["**" unary]
 *   atom:       number | 'name' | "name" | true | false | path | function "(" or-test {"," or-test} ")" | "(" or-test ")"
 *   functions:  abs(x) sqrt(x) degrees(x) isnan(x) isfinite(x) min(x, y, ...) max(x, y, ...) norm(vector)
 *
 * It means what it means in Python, on 64-bit integers and doubles; a bool counts as 1 or 0. Where Python would raise, or an
 * integer would not fit, it has no value. Vectors occur within `norm`, element by element. Names are compared with fields that
 * have such names, for equality. Text is compiled once, to steps of a stack machine without memory of its own, and run often.
 */
#ifndef FCSL_EXPRESSION_H
#define FCSL_EXPRESSION_H

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FCSL_EXPRESSION_BYTES_MAX = 1024, /* bytes of an expression, with the 0 that ends it */
    FCSL_EXPRESSION_VALUES_MAX = 256, /* values in an expression */
    FCSL_EXPRESSION_DEPTH_MAX = 32, /* levels of an expression: each parenthesis, sign, `not` and `**` is one */
    FCSL_EXPRESSION_ARGUMENTS_MAX = 8, /* arguments of a function in an expression */
    FCSL_EXPRESSION_VECTOR_MAX = 16, /* elements of a vector in an expression */
};
#define FCSL_EXPRESSION_STEPS_MAX 1024u

typedef enum {
    FCSL_EXPRESSION_BOOL,
    FCSL_EXPRESSION_INTEGER,
    FCSL_EXPRESSION_FLOAT,
    FCSL_EXPRESSION_NAME
} fcsl_expression_kind_t;

typedef struct {
    fcsl_expression_kind_t kind;
    int64_t integer; /* a bool's and a name's, too */
    double real;
} fcsl_expression_value_t;

/* What a path is: a scalar, or a vector whose elements are read one by one. The memory stays where it is. */
typedef struct {
    const fcsl_machine_t *machine; /* has the names of states and requests; null where none are */
    uint8_t type;
    uint32_t count; /* of a vector; 0: a scalar */
    const uint8_t *elements[FCSL_EXPRESSION_VECTOR_MAX];
} fcsl_expression_operand_t;

typedef struct {
    const char *code; /* bad_expression, unknown_path or bad_index */
    const char *hint; /* the path that was meant, or "" */
    char text[128];
    size_t at; /* byte of the expression */
} fcsl_expression_error_t;

typedef struct {
    uint8_t operation;
    uint8_t type;   /* of a field; which comparison; of a list whether `in` is negated */
    uint16_t at;    /* byte of the expression */
    uint32_t target; /* of a jump */
    union {
        const uint8_t *data;
        int64_t integer;
        double real;
    } with;
} fcsl_expression_step_t;

typedef struct {
    fcsl_expression_step_t steps[FCSL_EXPRESSION_STEPS_MAX];
    uint32_t count;
    fcsl_expression_kind_t kind;        /* of the value */
    uint8_t type;                  /* of a name */
    const fcsl_machine_t *machine; /* of a name */
} fcsl_expression_t;

/* What `path` is; 0, or -1 with code, hint and text of `error`. */
typedef int fcsl_expression_find_t(const void *context, const char *path, fcsl_expression_operand_t *operand,
                                   fcsl_expression_error_t *error);

/* 0, or -1 with `error`. */
int fcsl_expression_compile(const char *text, fcsl_expression_find_t *find, const void *context,
                            fcsl_expression_t *expression, fcsl_expression_error_t *error);
/* The value now; 0, or -1 with `error` where there is none. */
int fcsl_expression_run(const fcsl_expression_t *expression, fcsl_expression_value_t *value,
                        fcsl_expression_error_t *error);
/* What `path` is among these fields of `data`: for a `find`. "outputs.position[2]" is found as "outputs.position". */
int fcsl_expression_find_field(const fcsl_field_t *fields, uint32_t count, const fcsl_machine_t *machine,
                               const uint8_t *data, const char *path, fcsl_expression_operand_t *operand,
                               fcsl_expression_error_t *error);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_EXPRESSION_H */
