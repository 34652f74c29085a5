/* SPDX-License-Identifier: Apache-2.0
 *
 * Between field values and JSON, field paths and indices, names and the nearest name.
 */
#ifndef FCSL_VARS_VALUE_H
#define FCSL_VARS_VALUE_H

#include "fcsl/fcsl_machine.h"
#include "json.h"

/* A field, or one scalar of it. */
typedef struct {
    const fcsl_field_t *field;
    uint32_t index;   /* into fields */
    uint32_t element; /* first scalar */
    uint32_t count;   /* scalars */
    int whole;        /* the field as its shape, not one scalar of it */
} target_t;

typedef enum { TARGET_OK, TARGET_UNKNOWN, TARGET_INDEX } target_status_t;

/* Resolves "pilot.outputs.force", "nav.state.p[2,1]" or "nav.state.p[2][1]". */
target_status_t value_resolve(const fcsl_machine_t *machine, const char *path, target_t *target);

/* Writes the target's value: a scalar, or arrays nested as its shape. `bytes` holds its scalars in native order. */
void value_write(const fcsl_machine_t *machine, const target_t *target, const uint8_t *bytes, json_out_t *out);

/* Reads a JSON value into native scalars; `bytes` has room for the target. Returns null, or what is wrong. */
const char *value_read(const fcsl_machine_t *machine, const target_t *target, const json_t *json, uint32_t token,
                       uint8_t *bytes);

/* The type as users write it: "f64[2,2]". */
void value_type(const fcsl_field_t *field, char *text, size_t size);

const char *value_nearest_path(const fcsl_machine_t *machine, const char *path);
const char *value_nearest_state(const fcsl_machine_t *machine, const char *name);
/* The nearest of a null-terminated list. */
const char *value_nearest(const char *const *names, const char *name);

/* Index of a state, or FCSL_NONE. */
int32_t value_state(const fcsl_machine_t *machine, const char *name);

#endif /* FCSL_VARS_VALUE_H */
