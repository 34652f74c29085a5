/* SPDX-License-Identifier: Apache-2.0
 *
 * Generated messages: their layout from the message text, and their bytes each tick.
 */
#define _GNU_SOURCE
#include "message.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_cdr.h"
#include "fcsl/fcsl_scalar.h"
#include "schema.h"

/* What stands in front of the name of a struct's message. */
#define SECTION FCSL_SCHEMA_SEPARATOR "MSG: "

enum {
    WORD_BYTES = 256,
    DEPTH_MAX = 16,
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

/* Takes the next declaration off the text, skipping comments and constants: 1, 0 at the end (of the message or of a struct
 * behind it), -1 on anything else. */
static int next_declaration(const char **text, declaration_t *declaration)
{
    while (**text != '\0' && strncmp(*text, "====", 4) != 0) {
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

void fcsl_ros_type(const fcsl_field_t *field, char *text, size_t size)
{
    static const char *const names[] = {"bool",    "int32",   "int64", "uint32", "uint64",
                                        "float32", "float64", "int32", "uint8",  "int32"};
    if (field->rank == 0) {
        (void)snprintf(text, size, "%s", names[field->type]);
    } else {
        (void)snprintf(text, size, "%s[%u]", names[field->type], field->count);
    }
}

int fcsl_layout_open(fcsl_layout_t *layout, uint32_t count)
{
    *layout = (fcsl_layout_t){.copies = calloc(count + 1u, sizeof(fcsl_copy_t)), .size = FIRST_OUTPUT_AT};
    return layout->copies != NULL ? 0 : -1;
}

int fcsl_layout_append(fcsl_layout_t *layout, const fcsl_field_t *field)
{
    const uint64_t scalar = field->type == FCSL_HEALTH ? 1u : fcsl_scalar_size(field->type);
    const uint64_t behind = (layout->size - (uint64_t)FCSL_CDR_ENCAPSULATION_BYTES) % scalar;
    const uint64_t target = layout->size + (behind == 0 ? 0 : scalar - behind);
    const uint64_t size = target + scalar * field->count;
    if (size > FCSL_MESSAGE_BYTES_MAX) {
        return -1;
    }
    layout->size = (uint32_t)size;
    /* Fields that lie behind one another here and there are copied as one. */
    fcsl_copy_t *last = layout->copy_count > 0 ? &layout->copies[layout->copy_count - 1u] : NULL;
    if (last != NULL && last->type == field->type && last->target + scalar * last->count == target &&
        last->source + (uint64_t)fcsl_scalar_size(field->type) * last->count == field->offset) {
        last->count += field->count;
        return 0;
    }
    layout->copies[layout->copy_count++] =
        (fcsl_copy_t){.source = field->offset, .target = (uint32_t)target, .count = field->count, .type = field->type};
    return 0;
}

/* A message being laid out along the leaves of an instance, which stand in the order of the message. */
typedef struct {
    const fcsl_machine_t *machine;
    const fcsl_instance_t *instance;
    fcsl_layout_t *layout;
    fcsl_error_t *error;
    uint32_t next; /* leaf of the instance that the next scalar or array must be */
} builder_t;

static int refuse(const builder_t *b, const char *what, const char *which)
{
    return fcsl_fail(b->error, "message %s of instance '%s': %s%s", b->instance->message_type, b->instance->name, what,
                     which);
}

static const fcsl_field_t *leaf(const builder_t *b)
{
    return b->next < b->instance->field_count ? &b->machine->fields[b->instance->first_field + b->next] : NULL;
}

/* Whether the first `length` letters of a path are these of a message, whose fields have no capitals. */
static int is_named(const char *path, const char *name, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        const char letter = path[i];
        const char small = letter >= 'A' && letter <= 'Z' ? (char)(letter - 'A' + 'a') : letter;
        if (letter != name[i] && small != name[i]) {
            return 0;
        }
    }
    return 1;
}

/* Whether the next leaf lies in the output whose path is `path`: it is the output, a member, or a member of an element. */
static int is_inside(const builder_t *b, const char *path)
{
    const fcsl_field_t *field = leaf(b);
    const size_t length = strlen(path);
    return field != NULL && field->role == FCSL_ROLE_OUTPUT && is_named(field->path, path, length) &&
           (field->path[length] == '\0' || field->path[length] == '.' || field->path[length] == '[');
}

/* Appends the next leaf, a declaration of type `type`, behind layout->size. */
static int append_leaf(builder_t *b, const declaration_t *declaration, const char *output)
{
    const fcsl_field_t *field = leaf(b);
    if (!is_inside(b, output)) {
        return refuse(b, "no such output: ", declaration->name);
    }
    const char *last = strrchr(field->path, '.');
    char expected[WORD_BYTES];
    fcsl_ros_type(field, expected, sizeof expected);
    if (last == NULL || strlen(last + 1) != strlen(declaration->name) ||
        !is_named(last + 1, declaration->name, strlen(declaration->name)) || strcmp(expected, declaration->type) != 0) {
        return refuse(b, "an output of another type: ", declaration->name);
    }
    fcsl_layout_t *layout = b->layout;
    if (layout->copy_count == b->instance->field_count) {
        return refuse(b, "more fields than outputs", "");
    }
    if (fcsl_layout_append(layout, field) != 0) {
        return refuse(b, "larger than 1 MiB", "");
    }
    b->next++;
    return 0;
}

/* The text of the struct `type` (a bare name), behind the separator and "MSG: pkg/Name"; null when there is none. */
static const char *find_struct(const builder_t *b, const char *type)
{
    const char *text = strstr(b->instance->message_text, SECTION);
    while (text != NULL) {
        const char *name = text + sizeof SECTION - 1u;
        const size_t length = strcspn(name, "\n");
        const char *slash = memchr(name, '/', length);
        const size_t package = slash != NULL ? (size_t)(slash - name) + 1u : 0u;
        if (length - package == strlen(type) && strncmp(name + package, type, length - package) == 0) {
            return name + length;
        }
        text = strstr(name, SECTION);
    }
    return NULL;
}

static int append_declaration(builder_t *b, const declaration_t *declaration, const char *output, int depth);

/* Appends every member of the struct whose text this is. */
static int append_members(builder_t *b, const char *text, const char *output, int depth)
{
    declaration_t member;
    const uint32_t first = b->next;
    int more = 0;
    while ((more = next_declaration(&text, &member)) == 1) {
        if (append_declaration(b, &member, output, depth) != 0) {
            return -1;
        }
    }
    return more == 0 && b->next > first ? 0
                                        : refuse(b, "a struct that is not lines of 'type name', in output ", output);
}

/* Appends a scalar, an array, a struct or an array of structs of the output `output`. */
static int append_declaration(builder_t *b, const declaration_t *declaration, const char *output, int depth)
{
    char type[WORD_BYTES];
    (void)snprintf(type, sizeof type, "%s", declaration->type);
    char *bracket = strchr(type, '[');
    unsigned long count = 1;
    if (bracket != NULL) {
        *bracket = '\0';
        count = strtoul(bracket + 1, NULL, 10);
    }
    const char *text = find_struct(b, type);
    if (text == NULL) {
        return append_leaf(b, declaration, output);
    }
    if (depth == DEPTH_MAX) {
        return refuse(b, "structs nested too deeply in output ", output);
    }
    for (unsigned long i = 0; i < count; i++) { /* every turn takes a leaf, or fails */
        if (append_members(b, text, output, depth + 1) != 0) {
            return -1;
        }
    }
    return 0;
}

/* Appends one output, all of it. */
static int append_output(builder_t *b, const declaration_t *declaration)
{
    char path[2 * WORD_BYTES + 16];
    (void)snprintf(path, sizeof path, "%.255s.outputs.%s", b->instance->name, declaration->name);
    for (b->next = 0; b->next < b->instance->field_count && !is_inside(b, path);) {
        b->next++;
    }
    if (append_declaration(b, declaration, path, 0) != 0) {
        return -1;
    }
    return is_inside(b, path) ? refuse(b, "not all of output ", declaration->name) : 0;
}

int fcsl_layout_build(const fcsl_machine_t *machine, const fcsl_instance_t *instance, fcsl_layout_t *layout,
                      fcsl_error_t *error)
{
    static const declaration_t first[] = {{"std_msgs/Header", "header"}, {"uint64", "tick"}};
    builder_t b = {.machine = machine, .instance = instance, .layout = layout, .error = error};
    if (fcsl_layout_open(layout, instance->field_count) != 0) {
        return fcsl_fail(error, "out of memory for messages");
    }
    const char *text = instance->message_text;
    declaration_t declaration;
    for (size_t i = 0; i < sizeof first / sizeof first[0]; i++) {
        if (next_declaration(&text, &declaration) != 1 || strcmp(declaration.type, first[i].type) != 0 ||
            strcmp(declaration.name, first[i].name) != 0) {
            return refuse(&b, "does not begin with 'std_msgs/Header header' and 'uint64 tick'", "");
        }
    }
    int more = 0;
    while ((more = next_declaration(&text, &declaration)) == 1) {
        if (append_output(&b, &declaration) != 0) {
            return -1;
        }
    }
    return more == 0 ? 0 : refuse(&b, "a line that is not 'type name'", "");
}

char *fcsl_interface_schema(const fcsl_instance_t *instance)
{
    char *schema = NULL;
    const size_t length = strlen(instance->message_text);
    const char *newline = length > 0 && instance->message_text[length - 1] == '\n' ? "" : "\n";
    return asprintf(&schema, "%s%s" FCSL_SCHEMA_HEADER, instance->message_text, newline) < 0 ? NULL : schema;
}

char *fcsl_interface_topic(const fcsl_instance_t *instance)
{
    char *topic = strdup(instance->name);
    for (char *dot = topic; dot != NULL && (dot = strchr(dot, '.')) != NULL;) {
        *dot = '/';
    }
    return topic;
}

void fcsl_layout_free(fcsl_layout_t *layout)
{
    free(layout->copies);
    layout->copies = NULL;
}

void fcsl_layout_begin(const fcsl_layout_t *layout, uint8_t *cdr)
{
    memset(cdr, 0, layout->size);
    fcsl_cdr_t header;
    fcsl_cdr_begin(&header, cdr, FIRST_OUTPUT_AT);
    fcsl_cdr_header(&header, 0);
}

static void export_healths(uint8_t *out, const uint8_t *in, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        int32_t health = 0;
        memcpy(&health, in + 4u * (size_t)i, sizeof health);
        out[i] = (uint8_t)health;
    }
}

void fcsl_layout_fill(const fcsl_layout_t *layout, const void *data, uint64_t tick, uint64_t time_ns, uint8_t *cdr)
{
    const uint8_t *base = data;
    fcsl_cdr_t stamp = {.bytes = cdr, .capacity = FIRST_OUTPUT_AT, .at = FCSL_CDR_ENCAPSULATION_BYTES};
    fcsl_cdr_time(&stamp, time_ns);
    fcsl_put_u64(cdr + TICK_AT, tick);
    for (const fcsl_copy_t *copy = layout->copies, *end = copy + layout->copy_count; copy != end; copy++) {
        if (copy->type == FCSL_HEALTH) {
            export_healths(cdr + copy->target, base + copy->source, copy->count);
        } else {
            fcsl_scalars_export(cdr + copy->target, base + copy->source, copy->type, copy->count);
        }
    }
}

void fcsl_layout_write(const fcsl_layout_t *layout, const void *data, uint64_t tick, uint64_t time_ns, uint8_t *cdr)
{
    fcsl_layout_begin(layout, cdr);
    fcsl_layout_fill(layout, data, tick, time_ns, cdr);
}
