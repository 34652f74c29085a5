/* SPDX-License-Identifier: Apache-2.0
 *
 * JSON for the variable server: a parser that fills a caller's token array (no allocation, bounded depth and size), and a
 * bounded writer.
 */
#ifndef FCSL_VARS_JSON_H
#define FCSL_VARS_JSON_H

#include <stddef.h>
#include <stdint.h>

#include "limits.h"

typedef enum {
    JSON_OBJECT,
    JSON_ARRAY,
    JSON_STRING, /* start..end without the quotes, escapes not yet resolved */
    JSON_NUMBER,
    JSON_TRUE,
    JSON_FALSE,
    JSON_NULL
} json_type_t;

/* Tokens stand in the order of the text; an object's members are key, value, key, value. */
typedef struct {
    json_type_t type;
    uint32_t start;
    uint32_t end;
    uint32_t count; /* elements of an array, members of an object */
    uint32_t next;  /* index of the token behind this one and all it holds */
} json_token_t;

typedef struct {
    const char *text;
    const json_token_t *tokens;
    uint32_t count;
} json_t;

/* Parses exactly one value of `size` bytes of UTF-8. Returns null, or what is wrong with the text. */
const char *fcsl_json_parse(const char *text, size_t size, json_token_t *tokens, uint32_t capacity, json_t *json);

/* Bytes of the UTF-8 character that begins at `text`, of which `left` bytes are there; 0 when it is malformed, overlong or a
 * surrogate. */
size_t fcsl_json_character(const char *text, size_t left);

/* Index of the value of `key` in an object, or 0 (which is never a member) when there is none. */
uint32_t fcsl_json_member(const json_t *json, uint32_t object, const char *key);
/* Resolves a string's escapes; returns 0, or -1 when it is no string, does not fit, or holds a zero character. */
int fcsl_json_string(const json_t *json, uint32_t token, char *out, size_t capacity);

typedef struct json_out {
    char *text;
    size_t capacity;
    size_t at;
    int overflow;
} json_out_t;

void fcsl_json_begin(json_out_t *out, char *text, size_t capacity);
/* Raw JSON text; and as printf, which takes longer than most of what else a request needs. */
void fcsl_json_bytes(json_out_t *out, const char *text, size_t length);
void fcsl_json_text(json_out_t *out, const char *text);
__attribute__((format(printf, 2, 3))) void fcsl_json_raw(json_out_t *out, const char *format, ...);
/* A quoted string; control characters are escaped, and what is not UTF-8 (a text that was cut, a name of a file) is told as
 * U+FFFD. */
void fcsl_json_quoted(json_out_t *out, const char *text);
void fcsl_json_u64(json_out_t *out, uint64_t value);
void fcsl_json_i64(json_out_t *out, int64_t value);
/* Round-trips; NaN and infinities as the strings "nan", "inf", "-inf". */
void fcsl_json_f64(json_out_t *out, double value);
void fcsl_json_f32(json_out_t *out, float value);

#endif /* FCSL_VARS_JSON_H */
