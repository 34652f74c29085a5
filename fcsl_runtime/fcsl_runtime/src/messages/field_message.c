/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages made at run time from the field table.
 */
#define _GNU_SOURCE
#include "field_message.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "schema.h"

typedef struct {
    const fcsl_machine_t *machine;
    const fcsl_field_t *const *leaves;
    const char *type;
    FILE *structs; /* texts of the messages within the message */
    uint32_t struct_count;
    fcsl_error_t *error;
} builder_t;

/* The name of a member stands at `at` of a path, up to here; then come its element and its own members. */
static size_t name_length(const char *path, size_t at)
{
    return strcspn(path + at, ".[");
}

/* Where the members of the struct whose name stands at `at` begin. */
static size_t members_at(const char *path, size_t at)
{
    return at + strcspn(path + at, ".") + 1u;
}

static int same_up_to(const char *a, const char *b, size_t length)
{
    return strncmp(a, b, length) == 0;
}

static void put_leaf(const fcsl_field_t *field, size_t at, FILE *out)
{
    char type[64];
    fcsl_ros_type(field, type, sizeof type);
    (void)fprintf(out, "%s %s", type, field->path + at);
    if (field->unit[0] != '\0' || field->doc[0] != '\0') {
        (void)fprintf(out, " #");
    }
    if (field->unit[0] != '\0') {
        (void)fprintf(out, " [%s]", field->unit);
    }
    if (field->doc[0] != '\0') {
        (void)fprintf(out, " %s", field->doc);
    }
    (void)fputc('\n', out);
}

/* Elements that the machine has of the array of structs whose name ends at `end` of `path`. */
static uint32_t elements_of(const builder_t *b, const char *path, size_t end)
{
    const char *last = NULL;
    uint32_t count = 0;
    for (uint32_t i = 0; i < b->machine->field_count; i++) {
        const char *other = b->machine->fields[i].path;
        if (same_up_to(other, path, end + 1u)) {
            const size_t element = end + strcspn(other + end, ".");
            count += last == NULL || !same_up_to(other, last, element + 1u);
            last = other;
        }
    }
    return count;
}

/* Whether leaves [first, last) are the elements of an array of structs, `each` leaves of the same kind in every one. */
static int is_whole_array(const builder_t *b, uint32_t first, uint32_t last, uint32_t each, size_t at)
{
    const char *path = b->leaves[first]->path;
    const uint32_t elements = elements_of(b, path, at + name_length(path, at));
    for (uint32_t i = first; i < last; i++) {
        const char *one = b->leaves[i]->path;
        const char *like = b->leaves[first + (i - first) % each]->path;
        if (strcmp(one + members_at(one, at), like + members_at(like, at)) != 0) {
            return 0;
        }
    }
    return elements * each == last - first;
}

static int put_members(builder_t *b, FILE *out, uint32_t first, uint32_t last, size_t at);

/* Puts the struct, or array of structs, that leaves [first, last) lie in. */
static int put_struct(builder_t *b, FILE *out, uint32_t first, uint32_t last, size_t at)
{
    const char *path = b->leaves[first]->path;
    const int length = (int)name_length(path, at);
    const int is_array = path[at + (size_t)length] == '[';
    const size_t inner = members_at(path, at);
    uint32_t each = 1; /* leaves of the first element */
    while (first + each < last && same_up_to(b->leaves[first + each]->path, path, inner)) {
        each++;
    }
    if (is_array && !is_whole_array(b, first, last, each, at)) {
        return fcsl_fail(b->error, "'%.*s' is an array of structs: choose the same members of every element",
                         (int)at + length, path);
    }
    const uint32_t number = ++b->struct_count;
    const char *name = strrchr(b->type, '/') + 1;
    (void)fprintf(out, "%sPart%u", name, number);
    if (is_array) {
        (void)fprintf(out, "[%u]", (last - first) / each);
    }
    (void)fprintf(out, " %.*s\n", length, path + at);

    char *text = NULL;
    size_t size = 0;
    FILE *members = open_memstream(&text, &size);
    if (members == NULL) {
        return fcsl_fail(b->error, "out of memory for messages");
    }
    const int status = put_members(b, members, first, first + each, inner);
    if (fclose(members) == 0 && status == 0) {
        (void)fprintf(b->structs,
                      FCSL_SCHEMA_SEPARATOR "MSG: %.*s/%s"
                                            "Part%u\n%s",
                      (int)strcspn(b->type, "/"), b->type, name, number, text);
    }
    free(text);
    return status;
}

/* Puts one declaration per member: leaves [first, last) whose member names stand at `at` of their paths. */
static int put_members(builder_t *b, FILE *out, uint32_t first, uint32_t last, size_t at)
{
    for (uint32_t i = first; i < last;) {
        const char *path = b->leaves[i]->path;
        const size_t end = at + name_length(path, at);
        if (path[end] == '\0') {
            put_leaf(b->leaves[i++], at, out);
            continue;
        }
        uint32_t behind = i + 1u;
        while (behind < last && same_up_to(b->leaves[behind]->path, path, end + 1u)) {
            behind++;
        }
        if (put_struct(b, out, i, behind, at) != 0) {
            return -1;
        }
        i = behind;
    }
    return 0;
}

/* Where names begin: behind "nav.inputs.", or "channels.". */
static size_t prefix_of(const fcsl_machine_t *machine, const fcsl_field_t *field)
{
    if (field->instance == FCSL_NONE) {
        return strcspn(field->path, ".") + 1u;
    }
    const size_t record = strlen(machine->instances[field->instance].name) + 1u;
    return record + strcspn(field->path + record, ".") + 1u;
}

static int put_texts(builder_t *b, uint32_t count, FILE *out, FILE *structs)
{
    b->structs = structs;
    (void)fputs("std_msgs/Header header\nuint64 tick\n", out);
    return put_members(b, out, 0, count, prefix_of(b->machine, b->leaves[0]));
}

static int build_schema(builder_t *b, uint32_t count, char **schema)
{
    char *texts[2] = {NULL, NULL};
    size_t sizes[2] = {0, 0};
    FILE *out = open_memstream(&texts[0], &sizes[0]);
    FILE *structs = open_memstream(&texts[1], &sizes[1]);
    int status = out != NULL && structs != NULL ? put_texts(b, count, out, structs)
                                                : fcsl_fail(b->error, "out of memory for messages");
    const int closed = (out == NULL || fclose(out) == 0) & (structs == NULL || fclose(structs) == 0);
    if (status == 0 && (!closed || asprintf(schema, "%s%s" FCSL_SCHEMA_HEADER, texts[0], texts[1]) < 0)) {
        *schema = NULL;
        status = fcsl_fail(b->error, "out of memory for messages");
    }
    free(texts[0]);
    free(texts[1]);
    return status;
}

int fcsl_field_message_build(const fcsl_machine_t *machine, const fcsl_field_t *const *leaves, uint32_t count,
                             const char *type, char **schema, fcsl_layout_t *layout, fcsl_error_t *error)
{
    builder_t b = {.machine = machine, .leaves = leaves, .type = type, .error = error};
    if (fcsl_layout_open(layout, count) != 0) {
        return fcsl_fail(error, "out of memory for messages");
    }
    for (uint32_t i = 0; i < count; i++) {
        if (fcsl_layout_append(layout, leaves[i]) != 0) {
            return fcsl_fail(error, "message %s is larger than 1 MiB", type);
        }
    }
    return build_schema(&b, count, schema);
}
