/* SPDX-License-Identifier: Apache-2.0
 *
 * Chooses fields by globs over their paths. Recorder and telemetry use it.
 */
#ifndef FCSL_PATH_GLOB_H
#define FCSL_PATH_GLOB_H

#include <stdint.h>

#include "fcsl/fcsl_run.h"

/* The `count` paths to choose from. */
typedef struct {
    const void *table;
    uint32_t count;
    const char *(*path)(const void *table, uint32_t number);
} fcsl_paths_t;

/* Sets chosen[i] to 1 where one of `globs` (with commas between) matches path i: `*` is any text, `?` any character, in all
 * of the path. -1 when a glob matches nothing; not so with `lenient`, for a default that not every machine has all of. */
int fcsl_match_paths(const char *globs, int lenient, const fcsl_paths_t *paths, uint8_t *chosen, fcsl_error_t *error);

#endif /* FCSL_PATH_GLOB_H */
