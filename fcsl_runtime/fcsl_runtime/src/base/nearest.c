/* SPDX-License-Identifier: Apache-2.0
 *
 * The name that was probably meant.
 */
#define _GNU_SOURCE
#include "nearest.h"

#include <stddef.h>
#include <string.h>

/* Edits (insert, delete, replace) between two names, or `limit` when there are at least as many. */
static uint32_t distance(const char *a, const char *b, uint32_t limit)
{
    uint32_t row[NEAREST_BYTES_MAX + 1];
    const size_t width = strnlen(b, NEAREST_BYTES_MAX);
    for (size_t j = 0; j <= width; j++) {
        row[j] = (uint32_t)j;
    }
    for (size_t i = 0; a[i] != '\0' && i < NEAREST_BYTES_MAX; i++) {
        uint32_t diagonal = row[0];
        uint32_t best = row[0] = (uint32_t)i + 1;
        for (size_t j = 1; j <= width; j++) {
            const uint32_t replaced = diagonal + (a[i] != b[j - 1]);
            const uint32_t inserted = row[j - 1] + 1;
            const uint32_t deleted = row[j] + 1;
            diagonal = row[j];
            row[j] = replaced < inserted ? replaced : inserted;
            row[j] = row[j] < deleted ? row[j] : deleted;
            best = row[j] < best ? row[j] : best;
        }
        if (best >= limit) {
            return limit;
        }
    }
    return row[width] < limit ? row[width] : limit;
}

nearest_t fcsl_nearest_begin(void)
{
    return (nearest_t){.name = "", .edits = NEAREST_BYTES_MAX};
}

void fcsl_nearest_consider(nearest_t *nearest, const char *candidate, const char *name)
{
    const uint32_t edits = distance(name, candidate, nearest->edits);
    if (edits < nearest->edits) {
        *nearest = (nearest_t){.name = candidate, .edits = edits};
    }
}

/* There is always a nearest, and nobody may have meant it. */
const char *fcsl_nearest_if_like(const nearest_t *nearest, const char *name)
{
    const size_t longest = strlen(name) > strlen(nearest->name) ? strlen(name) : strlen(nearest->name);
    return 4u * nearest->edits <= 3u * longest ? nearest->name : "";
}
