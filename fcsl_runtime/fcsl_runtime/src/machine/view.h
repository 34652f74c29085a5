/* SPDX-License-Identifier: Apache-2.0
 *
 * Parts of an array field: indices and slices as NumPy has them, `P[1]`, `P[-1,0]`, `P[0:3,::2]`, `P[1:][0]`.
 */
#ifndef FCSL_VIEW_H
#define FCSL_VIEW_H

#include <stdint.h>

#include "fcsl/fcsl_machine.h"

enum { RANK_MAX = 8 };

/* Scalar (i, j, ...) of the view lies offset + i * axes[0].stride + j * axes[1].stride + ... bytes behind the beginning of the
 * field; where an axis is one of an array of structs, `fields` says in the same way in which field behind that. */
typedef struct {
    int64_t offset;
    int64_t fields;
    uint32_t rank; /* 0: one scalar */
    struct {
        int64_t stride;
        int64_t fields;
        uint32_t count;
    } axes[RANK_MAX];
} view_t;

/* The whole field. */
view_t fcsl_view_whole(const fcsl_field_t *field);
/* Narrows the view by the brackets in `text` (all of it, "" leaves the view); 0, or -1 when they do not fit. */
int fcsl_view_index(view_t *view, const char *text);
/* Scalars in the view. */
uint32_t fcsl_view_count(const view_t *view);
/* How many bytes behind the beginning of the field scalar `i` of the view lies, counted row by row; and in which field behind
 * it. */
int64_t fcsl_view_byte(const view_t *view, uint32_t i);
int64_t fcsl_view_field(const view_t *view, uint32_t i);
/* Puts the axes of `last` behind those of the view; 0, or -1 when they are too many. */
int fcsl_view_append(view_t *view, const view_t *last);

#endif /* FCSL_VIEW_H */
