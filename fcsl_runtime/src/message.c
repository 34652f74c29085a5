/* SPDX-License-Identifier: Apache-2.0 */
#include "message.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cdr.h"
#include "fcsl/fcsl_scalar.h"

enum {
    WORD_BYTES = 256,
    TICK_AT = FCSL_CDR_ENCAPSULATION_BYTES + 16, /* behind the header with its empty frame_id */
    FIRST_OUTPUT_AT = TICK_AT + 8,
};

/* One declaration "type name" of a .msg text. */
typedef struct {
    char type[WORD_BYTES];
    char name[WORD_BYTES];
} declaration_t;

static int is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/* Copies the next word of [*at, end) into `word`; returns its length, 0 at the end, -1 when it is too long. */
static int next_word(const char **at, const char *end, char *word)
{
    const char *from = *at;
    while (from < end && is_blank(*from)) {
        from++;
    }
    const char *to = from;
    while (to < end && !is_blank(*to)) {
        to++;
    }
    const size_t length = (size_t)(to - from);
    if (length >= WORD_BYTES) {
        return -1;
    }
    memcpy(word, from, length);
    word[length] = '\0';
    *at = to;
    return (int)length;
}

/* Takes the next declaration off the text, skipping comments and constants: 1, 0 at the end, -1 on anything else. */
static int next_declaration(const char **text, declaration_t *declaration)
{
    while (**text != '\0') {
        const char *line = *text;
        const size_t length = strcspn(line, "\n");
        *text = line + length + (line[length] == '\n' ? 1 : 0);
        const char *end = line + strcspn(line, "#\n");
        if (memchr(line, '=', (size_t)(end - line)) != NULL) {
            continue;
        }
        char rest[WORD_BYTES];
        const char *at = line;
        const int type = next_word(&at, end, declaration->type);
        if (type == 0) {
            continue;
        }
        if (type < 0 || next_word(&at, end, declaration->name) <= 0 || next_word(&at, end, rest) != 0) {
            return -1;
        }
        return 1;
    }
    return 0;
}

/* The ROS 2 name of a field's type: "float64" or "float64[9]". */
static void type_text(const fcsl_field_t *field, char *text, size_t size)
{
    static const char *const names[] = {"bool",    "int32",   "int64", "uint32", "uint64",
                                        "float32", "float64", "int32", "uint8",  "int32"};
    if (field->rank == 0) {
        (void)snprintf(text, size, "%s", names[field->type]);
    } else {
        (void)snprintf(text, size, "%s[%u]", names[field->type], field->count);
    }
}

static const fcsl_field_t *find_output(const fcsl_machine_t *machine, const fcsl_instance_t *instance, const char *name)
{
    char path[2 * WORD_BYTES + 16];
    (void)snprintf(path, sizeof path, "%.255s.outputs.%s", instance->name, name);
    for (uint32_t i = 0; i < instance->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[instance->first_field + i];
        if (field->role == FCSL_ROLE_OUTPUT && strcmp(field->path, path) == 0) {
            return field;
        }
    }
    return NULL;
}

static int refuse(const fcsl_instance_t *instance, const char *what, const char *which, fcsl_error_t *error)
{
    return fcsl_fail(error, "message %s of instance '%s': %s%s", instance->message_type, instance->name, what, which);
}

/* Appends one output behind *size. */
static int append_output(const fcsl_machine_t *machine, const fcsl_instance_t *instance,
                         const declaration_t *declaration, fcsl_layout_t *layout, fcsl_error_t *error)
{
    const fcsl_field_t *field = find_output(machine, instance, declaration->name);
    if (field == NULL) {
        return refuse(instance, "no such output: ", declaration->name, error);
    }
    char expected[WORD_BYTES];
    type_text(field, expected, sizeof expected);
    if (strcmp(expected, declaration->type) != 0) {
        return refuse(instance, "an output of another type: ", declaration->name, error);
    }
    if (layout->copy_count == instance->field_count) {
        return refuse(instance, "more fields than outputs", "", error);
    }
    const uint64_t scalar = field->type == FCSL_HEALTH ? 1u : fcsl_scalar_size(field->type);
    const uint64_t behind = (layout->size - (uint64_t)FCSL_CDR_ENCAPSULATION_BYTES) % scalar;
    const uint64_t target = layout->size + (behind == 0 ? 0 : scalar - behind);
    const uint64_t size = target + scalar * field->count;
    if (size > FCSL_MESSAGE_BYTES_MAX) {
        return refuse(instance, "larger than 1 MiB", "", error);
    }
    layout->copies[layout->copy_count++] =
        (fcsl_copy_t){.source = field->offset, .target = (uint32_t)target, .count = field->count, .type = field->type};
    layout->size = (uint32_t)size;
    return 0;
}

int fcsl_layout_build(const fcsl_machine_t *machine, const fcsl_instance_t *instance, fcsl_layout_t *layout,
                      fcsl_error_t *error)
{
    static const declaration_t first[] = {{"std_msgs/Header", "header"}, {"uint64", "tick"}};
    *layout =
        (fcsl_layout_t){.copies = calloc(instance->field_count + 1u, sizeof(fcsl_copy_t)), .size = FIRST_OUTPUT_AT};
    if (layout->copies == NULL) {
        return fcsl_fail(error, "out of memory for messages");
    }
    const char *text = instance->message_text;
    declaration_t declaration;
    for (size_t i = 0; i < sizeof first / sizeof first[0]; i++) {
        if (next_declaration(&text, &declaration) != 1 || strcmp(declaration.type, first[i].type) != 0 ||
            strcmp(declaration.name, first[i].name) != 0) {
            return refuse(instance, "does not begin with 'std_msgs/Header header' and 'uint64 tick'", "", error);
        }
    }
    int more = 0;
    while ((more = next_declaration(&text, &declaration)) == 1) {
        if (append_output(machine, instance, &declaration, layout, error) != 0) {
            return -1;
        }
    }
    return more == 0 ? 0 : refuse(instance, "a line that is not 'type name'", "", error);
}

void fcsl_layout_free(fcsl_layout_t *layout)
{
    free(layout->copies);
    layout->copies = NULL;
}

void fcsl_layout_write(const fcsl_layout_t *layout, const void *data, uint64_t tick, uint64_t time_ns, uint8_t *cdr)
{
    const uint8_t *base = data;
    memset(cdr, 0, layout->size);
    fcsl_cdr_t header;
    fcsl_cdr_begin(&header, cdr, FIRST_OUTPUT_AT);
    fcsl_cdr_header(&header, time_ns);
    fcsl_cdr_u64(&header, tick);
    for (uint32_t i = 0; i < layout->copy_count; i++) {
        const fcsl_copy_t *copy = &layout->copies[i];
        if (copy->type == FCSL_HEALTH) {
            for (uint32_t j = 0; j < copy->count; j++) {
                int32_t health = 0;
                memcpy(&health, base + copy->source + 4u * (size_t)j, sizeof health);
                cdr[copy->target + j] = (uint8_t)health;
            }
        } else {
            fcsl_scalars_export(cdr + copy->target, base + copy->source, copy->type, copy->count);
        }
    }
}
