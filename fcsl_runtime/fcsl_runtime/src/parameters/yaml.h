/* SPDX-License-Identifier: Apache-2.0
 *
 * The part of YAML in which parameter files are written: block and flow mappings, scalars, flow lists, comments. Any bytes are read
 * or refused with the line; depth and lengths are bounded.
 */
#ifndef FCSL_YAML_H
#define FCSL_YAML_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_error.h"

enum {
    YAML_DEPTH_MAX = 32, /* mappings and lists inside each other */
    YAML_NAME_BYTES = 512 /* of all keys down to a value */
};

/* A place in a text. Lines are counted from 1. */
typedef struct {
    const char *text;
    size_t size;
    size_t at;
    uint32_t line;
    const char *file; /* for errors */
} yaml_cursor_t;

typedef enum { YAML_WORD, YAML_STRING, YAML_OPEN, YAML_CLOSE, YAML_END } yaml_kind_t;

/* A scalar (a word, or a string in quotes), or a bracket of a list. */
typedef struct {
    yaml_kind_t kind;
    const char *text; /* without quotes */
    size_t size;
    uint32_t line;
} yaml_item_t;

/* A value and where it stands: a section is the mapping under one `ros__parameters`. */
typedef struct {
    uint32_t section; /* counted from 1 */
    const char *node; /* "/quad/lander": the keys above ros__parameters, joined by slashes */
    const char *name; /* "pilot.gains.kp": the keys below it, joined by dots */
    yaml_cursor_t value; /* its items, to the end of this text */
    const char *unit; /* of a comment `# [rad/s]` behind it */
    size_t unit_size; /* 0: none */
    uint32_t line;
} yaml_entry_t;

/* Called with each value; -1 with `error` ends the reading. */
typedef int (*yaml_take_t)(void *ctx, const yaml_entry_t *entry, fcsl_error_t *error);

/* Reads `text`; returns the number of sections, or -1 with `error`. */
int64_t yaml_read(const char *text, size_t size, const char *file, yaml_take_t take, void *ctx, fcsl_error_t *error);

/* The next item of a value. Returns 0, or -1 with `error`. */
int yaml_next(yaml_cursor_t *cursor, yaml_item_t *item, fcsl_error_t *error);

/* An error of a line, or of the file (0); -1. */
__attribute__((format(printf, 4, 5))) int yaml_fail(const char *file, uint32_t line, fcsl_error_t *error,
                                                    const char *format, ...);

#endif /* FCSL_YAML_H */
