/* SPDX-License-Identifier: Apache-2.0
 *
 * Parameter files, in and out.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_parameters.h"
#include "fcsl/fcsl_scalar.h"
#include "machine/enumerators.h"
#include "machine/machine_struct.h"
#include "machine/scalar_text.h"
#include "names.h"

/* What a directory, a pipe or a device holds is not read. */
static int open_file(const char *path, size_t *size, fcsl_error_t *error)
{
    struct stat status;
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        return fcsl_fail(error, "%.400s: %s", path, strerror(errno));
    }
    int failed = 0;
    if (fstat(fd, &status) != 0) {
        failed = fcsl_fail(error, "%.400s: %s", path, strerror(errno));
    } else if (!S_ISREG(status.st_mode)) {
        failed = fcsl_fail(error, "%.400s: not a regular file", path);
    } else if (status.st_size > (off_t)FCSL_PARAMETERS_BYTES_MAX) {
        failed = fcsl_fail(error, "%.400s: a parameter file has at most %u bytes", path, FCSL_PARAMETERS_BYTES_MAX);
    }
    if (failed != 0) {
        (void)close(fd);
        return -1;
    }
    *size = (size_t)status.st_size;
    return fd;
}

char *fcsl_parameters_read(const char *path, size_t *size, fcsl_error_t *error)
{
    size_t left = 0;
    const int fd = open_file(path, &left, error);
    if (fd < 0) {
        return NULL;
    }
    char *text = malloc(left + 1u);
    ssize_t got = text != NULL ? 1 : -1;
    *size = 0;
    while (got > 0 && left > 0) {
        got = read(fd, text + *size, left);
        *size += got > 0 ? (size_t)got : 0u;
        left -= got > 0 ? (size_t)got : 0u;
    }
    if (got < 0) {
        (void)fcsl_fail(error, "%.400s: %s", path, text == NULL ? "out of memory" : strerror(errno));
        free(text);
        text = NULL;
    }
    (void)close(fd);
    return text;
}

/* ---- out ------------------------------------------------------------------------------------------------------------ */

typedef struct {
    char *text;
    size_t capacity;
    size_t at; /* beyond capacity: it was too small */
} out_t;

__attribute__((format(printf, 2, 3))) static void put(out_t *out, const char *format, ...)
{
    const size_t left = out->at < out->capacity ? out->capacity - out->at : 0u;
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(left > 0u ? out->text + out->at : NULL, left, format, arguments);
    va_end(arguments);
    out->at += length > 0 ? (size_t)length : 0u;
}

/* With a point, without which YAML 1.1 has no float. */
static void put_float(out_t *out, double value, uint8_t type)
{
    if (!isfinite(value)) {
        put(out, "%s", isnan(value) ? ".nan" : value > 0.0 ? ".inf" : "-.inf");
        return;
    }
    char text[SCALAR_TEXT_BYTES];
    fcsl_float_text(value, type, text);
    const int mantissa = (int)strcspn(text, "e");
    put(out, "%.*s%s%s", mantissa, text, strchr(text, '.') == NULL ? ".0" : "", text + mantissa);
}

static void put_scalar(const fcsl_machine_t *machine, uint8_t type, const uint8_t *bytes, out_t *out)
{
    char text[PARAMETER_NAME_BYTES];
    int32_t number = 0;
    switch (type) {
    case FCSL_BOOL:
        put(out, "%s", bytes[0] != 0 ? "true" : "false");
        return;
    case FCSL_U32:
        put(out, "%" PRIu32, fcsl_read_u32(bytes, 0));
        return;
    case FCSL_U64:
        put(out, "%" PRIu64, fcsl_read_u64(bytes, 0));
        return;
    case FCSL_I64:
        put(out, "%" PRId64, (int64_t)fcsl_read_u64(bytes, 0));
        return;
    case FCSL_F32:
    case FCSL_F64:
        put_float(out, fcsl_scalar_as_double(bytes, type), type);
        return;
    default:
        memcpy(&number, bytes, sizeof number);
        if (type == FCSL_I32) {
            put(out, "%" PRId32, number);
        } else {
            put(out, "\"%s\"", fcsl_enumerator_name(machine, type, number, text, sizeof text));
        }
    }
}

static void put_field(const fcsl_machine_t *machine, const fcsl_field_t *field, const uint8_t *bytes, out_t *out)
{
    char name[PARAMETER_NAME_BYTES];
    fcsl_parameter_name(machine, field, name);
    put(out, "    %s: %s", name, field->rank > 0u ? "[" : "");
    for (uint32_t i = 0; i < field->count; i++) {
        put(out, "%s", i > 0u ? ", " : "");
        put_scalar(machine, field->type, bytes + (size_t)i * fcsl_scalar_size(field->type), out);
    }
    put(out, "%s", field->rank > 0u ? "]" : "");
    if (field->unit[0] != '\0') {
        put(out, "  # [%s]", field->unit);
    }
    put(out, "\n");
}

int64_t fcsl_parameters_write(const fcsl_machine_t *machine, const void *data, const void *compiled, char *text,
                              size_t capacity)
{
    out_t out = {.text = text, .capacity = capacity};
    uint32_t written = 0;
    put(&out, "# Parameters of %s that differ from its compiled values.\n/**:\n  ros__parameters:", machine->name);
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        const uint8_t *bytes = (const uint8_t *)data + field->offset;
        if (field->role == FCSL_ROLE_PARAMETER && (field->flags & FCSL_FIELD_FROZEN) == 0u &&
            memcmp(bytes, (const uint8_t *)compiled + field->offset, field->size) != 0) {
            put(&out, "%s", written++ == 0u ? "\n" : "");
            put_field(machine, field, bytes, &out);
        }
    }
    put(&out, "%s", written == 0u ? " {}\n" : "");
    return out.at < capacity ? (int64_t)out.at : -1;
}
