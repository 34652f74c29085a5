/* SPDX-License-Identifier: Apache-2.0
 *
 * What the two halves of the parser share: operators (parser.c), atoms (parser_atom.c). Both check kinds and emit steps.
 */
#ifndef FCSL_EXPRESSION_PARSER_H
#define FCSL_EXPRESSION_PARSER_H

#include "step.h"

typedef struct {
    const char *text;
    size_t at;
    int depth;
    int values;
    int element; /* of vectors, within `norm`; else -1 */
    uint32_t height; /* values on the stack */
    fcsl_expression_find_t *find;
    const void *context;
    fcsl_expression_t *expression;
    fcsl_expression_error_t *error;
} parser_t;

/* What a part of an expression is. */
typedef struct {
    fcsl_expression_kind_t kind;
    uint32_t count;                /* of a vector; 0: a scalar */
    uint8_t type;                  /* of a name that a field has */
    const fcsl_machine_t *machine; /* the same */
    const char *literal;           /* a name in quotes: where it stands in the text; else null */
    size_t length;                 /* of the literal */
    uint32_t step;                 /* of the literal: which pushes its number, once it is known */
    int is_resolved;               /* the number is known: that of `type` and `machine` */
} part_t;

/* Notes what is wrong, at this place; always -1. */
int fcsl_parser_fail(parser_t *p, const char *text);
void fcsl_parser_skip_blanks(parser_t *p);
/* Take the symbol, or the word, when it stands here. */
int fcsl_parser_take(parser_t *p, const char *symbol);
int fcsl_parser_take_word(parser_t *p, const char *word);
/* A step that leaves `pushed` values more on the stack, or fewer. 0, or -1. */
int fcsl_parser_emit(parser_t *p, operation_t operation, int pushed);
/* The last step. */
fcsl_expression_step_t *fcsl_parser_last(parser_t *p);
int fcsl_parser_need_number(parser_t *p, const part_t *part);
int fcsl_parser_need_bool(parser_t *p, const part_t *part);
int fcsl_parser_need_scalar(parser_t *p, const part_t *part);
/* Elements of both: one of them, or the same; 0, or -1. */
int fcsl_parser_same_count(parser_t *p, part_t *part, const part_t *other);

/* Reads a part and emits it; 0, or -1. */
typedef int part_reader_t(parser_t *p, part_t *part);
part_reader_t fcsl_parser_atom;
part_reader_t fcsl_parser_expression;
/* What stands in a parenthesis or list, or behind a sign, `not` or `**`. Nothing else makes the parser call itself. */
int fcsl_parser_deeper(parser_t *p, part_t *part, part_reader_t *read);

#endif /* FCSL_EXPRESSION_PARSER_H */
