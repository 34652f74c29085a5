/* SPDX-License-Identifier: Apache-2.0
 *
 * Between values of fields and JSON.
 */
#ifndef FCSL_VARS_VALUE_H
#define FCSL_VARS_VALUE_H

#include "catalog.h"
#include "json.h"

enum { FINITE_ONLY = 0, ANY_FLOAT = 1 };

/* Writes the target's value: a scalar, or arrays nested as its shape. `field` holds the whole field in native order. */
void fcsl_value_write(const target_t *target, const uint8_t *field, json_out_t *out);

/* Reads a JSON value into the target's scalars, row by row, native. Returns null, or what is wrong. */
const char *fcsl_value_read(const target_t *target, const json_t *json, uint32_t token, int floats, uint8_t *bytes);

/* The type as users write it, "f64[2][2]": of the field, or of the target's part of it. */
void fcsl_value_type(const fcsl_field_t *field, const view_t *view, char *text, size_t size);

/* What one of these fields is connected from: the path of another, "the machine", or "". */
const char *fcsl_value_source(const fcsl_field_t *fields, const fcsl_field_t *field);

#endif /* FCSL_VARS_VALUE_H */
