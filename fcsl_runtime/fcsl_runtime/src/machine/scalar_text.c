/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars as text.
 */
#include "scalar_text.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "enumerators.h"
#include "fcsl/fcsl_scalar.h"

const char *fcsl_float_from_text(const char *text, uint8_t type, uint8_t *bytes)
{
    if (type == FCSL_F32) {
        const float value = strtof(text, NULL);
        memcpy(bytes, &value, sizeof value);
        return isinf(value) ? "out of the range of f32" : NULL;
    }
    const double value = strtod(text, NULL);
    memcpy(bytes, &value, sizeof value);
    return isinf(value) ? "out of the range of f64" : NULL;
}

const char *fcsl_integer_from_text(const char *text, uint8_t type, uint8_t *bytes)
{
    if (strpbrk(text, ".eE") != NULL) {
        return "expected an integer, without point or exponent";
    }
    errno = 0;
    if (type == FCSL_U64 || type == FCSL_U32) {
        const unsigned long long value = text[0] == '-' ? 0 : strtoull(text, NULL, 10);
        if (text[0] == '-' || errno != 0 || (type == FCSL_U32 && value > UINT32_MAX)) {
            return type == FCSL_U32 ? "out of the range of u32" : "out of the range of u64";
        }
        const uint32_t narrow = (uint32_t)value;
        memcpy(bytes, type == FCSL_U32 ? (const void *)&narrow : (const void *)&value, fcsl_scalar_size(type));
        return NULL;
    }
    const long long value = strtoll(text, NULL, 10);
    if (errno != 0 || (type == FCSL_I32 && (value < INT32_MIN || value > INT32_MAX))) {
        return type == FCSL_I32 ? "out of the range of i32" : "out of the range of i64";
    }
    const int32_t narrow = (int32_t)value;
    memcpy(bytes, type == FCSL_I32 ? (const void *)&narrow : (const void *)&value, fcsl_scalar_size(type));
    return NULL;
}

static int32_t request_of(const fcsl_machine_t *machine, const char *text)
{
    int32_t plain = FCSL_NONE;
    for (uint32_t i = 0; i < machine->request_count; i++) {
        if (strncmp(text, "tr_", 3) == 0 && strcmp(text + 3, machine->requests[i]) == 0) {
            return (int32_t)i + 1;
        }
        if (strcmp(text, machine->requests[i]) == 0) {
            plain = (int32_t)i + 1;
        }
    }
    return text[0] == '\0' ? 0 : plain;
}

const char *fcsl_enumerator_from_text(const fcsl_machine_t *machine, const char *text, uint8_t type, uint8_t *bytes)
{
    const int32_t value =
        type == FCSL_HEALTH ? fcsl_enumerator_find(machine, type, text, strlen(text)) : request_of(machine, text);
    memcpy(bytes, &value, sizeof value);
    return value == FCSL_NONE ? "no such enumerator" : NULL;
}

void fcsl_float_text(double value, uint8_t type, char text[SCALAR_TEXT_BYTES])
{
    double back = NAN;
    for (int digits = 6; digits <= 17 && back != value; digits++) {
        (void)snprintf(text, SCALAR_TEXT_BYTES, "%.*g", digits, value);
        back = type == FCSL_F32 ? (double)strtof(text, NULL) : strtod(text, NULL);
    }
}
