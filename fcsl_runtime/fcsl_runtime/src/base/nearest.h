/* SPDX-License-Identifier: Apache-2.0
 *
 * The name that was probably meant, among those that there are.
 */
#ifndef FCSL_NEAREST_H
#define FCSL_NEAREST_H

#include <stdint.h>

/* Bytes of a name that are compared. */
enum { NEAREST_BYTES_MAX = 256 };

typedef struct {
    const char *name;
    uint32_t edits;
} nearest_t;

nearest_t fcsl_nearest_begin(void);
void fcsl_nearest_consider(nearest_t *nearest, const char *candidate, const char *name);
/* The nearest of those that were considered; "" where none is like `name`. */
const char *fcsl_nearest_if_like(const nearest_t *nearest, const char *name);

#endif /* FCSL_NEAREST_H */
