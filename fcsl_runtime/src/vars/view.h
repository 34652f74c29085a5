/* SPDX-License-Identifier: Apache-2.0
 *
 * Parts of an array field: indices and slices as NumPy has them, `P[1]`, `P[-1,0]`, `P[0:3,::2]`, `P[1:][0]`.
 */
#ifndef FCSL_VARS_VIEW_H
#define FCSL_VARS_VIEW_H

#include <stdint.h>

#include "fcsl/fcsl_machine.h"

enum { RANK_MAX = 8 };

/* Scalar (i, j, ...) of the view is scalar offset + i * axes[0].stride + j * axes[1].stride + ... of the field. */
typedef struct {
    int64_t offset;
    uint32_t rank; /* 0: one scalar */
    struct {
        int64_t stride;
        uint32_t count;
    } axes[RANK_MAX];
} view_t;

/* The whole field. */
view_t fcsl_view_whole(const fcsl_field_t *field);
/* Narrows the view by the brackets in `text` (all of it, "" leaves the view); 0, or -1 when they do not fit. */
int fcsl_view_index(view_t *view, const char *text);
/* Scalars in the view. */
uint32_t fcsl_view_count(const view_t *view);
/* Where scalar `i` of the view, counted row by row, lies in the field. */
uint32_t fcsl_view_scalar(const view_t *view, uint32_t i);

#endif /* FCSL_VARS_VIEW_H */
