/* SPDX-License-Identifier: Apache-2.0
 *
 * The bounded writer.
 */
#include "json.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void fcsl_json_begin(json_out_t *out, char *text, size_t capacity)
{
    *out = (json_out_t){.text = text, .capacity = capacity};
    if (capacity > 0) {
        text[0] = '\0';
    }
}

void fcsl_json_bytes(json_out_t *out, const char *text, size_t length)
{
    if (out->overflow || length >= out->capacity - out->at) {
        out->overflow = 1;
        return;
    }
    memcpy(out->text + out->at, text, length);
    out->at += length;
    out->text[out->at] = '\0';
}

void fcsl_json_text(json_out_t *out, const char *text)
{
    fcsl_json_bytes(out, text, strlen(text));
}

void fcsl_json_raw(json_out_t *out, const char *format, ...)
{
    if (out->overflow) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(out->text + out->at, out->capacity - out->at, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= out->capacity - out->at) {
        out->overflow = 1;
        return;
    }
    out->at += (size_t)length;
}

/* Bytes of the first character when it may stand as it is; 0 otherwise, and at the end. */
static size_t plain_length(const char *text)
{
    const unsigned char c = (unsigned char)*text;
    const int escaped = c < 0x20 || c == 0x7f || c == '"' || c == '\\';
    return escaped ? 0 : fcsl_json_character(text, SIZE_MAX); /* which does not read beyond the zero at the end */
}

void fcsl_json_quoted(json_out_t *out, const char *text)
{
    fcsl_json_bytes(out, "\"", 1);
    while (*text != '\0') {
        size_t length = 0;
        for (size_t step = plain_length(text); step > 0; step = plain_length(text + length)) {
            length += step;
        }
        fcsl_json_bytes(out, text, length);
        text += length;
        if (*text == '"' || *text == '\\') {
            fcsl_json_raw(out, "\\%c", *text++);
        } else if ((unsigned char)*text >= 0x80) {
            fcsl_json_raw(out, "\\ufffd");
            do {
                text++;
            } while (((unsigned char)*text & 0xc0u) == 0x80);
        } else if (*text != '\0') {
            fcsl_json_raw(out, "\\u%04x", (unsigned)(unsigned char)*text++);
        }
    }
    fcsl_json_bytes(out, "\"", 1);
}

void fcsl_json_u64(json_out_t *out, uint64_t value)
{
    char digits[20];
    size_t first = sizeof digits;
    do {
        digits[--first] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value > 0);
    fcsl_json_bytes(out, digits + first, sizeof digits - first);
}

void fcsl_json_i64(json_out_t *out, int64_t value)
{
    if (value < 0) {
        fcsl_json_bytes(out, "-", 1);
    }
    fcsl_json_u64(out, value < 0 ? 0u - (uint64_t)value : (uint64_t)value);
}

/* A number that reads back as a float, also when it is whole. */
static void put_float(json_out_t *out, double value, int digits)
{
    if (isnan(value) || isinf(value)) {
        fcsl_json_text(out, isnan(value) ? "\"nan\"" : value > 0.0 ? "\"inf\"" : "\"-inf\"");
        return;
    }
    char text[40];
    (void)snprintf(text, sizeof text, "%.*g", digits, value);
    fcsl_json_text(out, text);
    fcsl_json_text(out, strpbrk(text, ".e") == NULL ? ".0" : "");
}

void fcsl_json_f64(json_out_t *out, double value)
{
    put_float(out, value, 17);
}

void fcsl_json_f32(json_out_t *out, float value)
{
    put_float(out, (double)value, 9);
}
