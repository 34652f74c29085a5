/* SPDX-License-Identifier: Apache-2.0
 *
 * The hash of an interface is the SHA-256 of its description as JSON, field by field, and of all that it refers to, in
 * the order of their names. The JSON goes straight into the hash.
 */
#include "type_hash.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/sha256.h"

enum { NAME_BYTES = 256, SECTIONS_MAX = 64, SEPARATOR_BYTES = 80 };

/* One interface's part of the text. */
typedef struct {
    char name[NAME_BYTES]; /* "pkg/msg/Name" */
    const char *text;
    const char *end;
} section_t;

typedef struct {
    section_t sections[SECTIONS_MAX];
    size_t count;
    fcsl_sha256_t hash;
} description_t;

static void put(description_t *description, const char *text)
{
    fcsl_sha256_add(&description->hash, text, strlen(text));
}

/* "pkg/Name" and "pkg/msg/Name" become the latter; a bare name belongs to the package of `home`. */
static int full_name(const char *name, const char *home, char full[NAME_BYTES])
{
    const char *slash = strchr(name, '/');
    int length = 0;
    if (slash == NULL) {
        const int package = (int)strcspn(home, "/");
        length = strcmp(name, "Header") == 0 ? snprintf(full, NAME_BYTES, "std_msgs/msg/Header")
                                             : snprintf(full, NAME_BYTES, "%.*s/msg/%s", package, home, name);
    } else if (strchr(slash + 1, '/') == NULL) {
        length = snprintf(full, NAME_BYTES, "%.*s/msg/%s", (int)(slash - name), name, slash + 1);
    } else {
        length = snprintf(full, NAME_BYTES, "%s", name);
    }
    return length > 0 && length < NAME_BYTES ? 0 : -1;
}

static const char *line_end(const char *line, const char *end)
{
    const char *newline = memchr(line, '\n', (size_t)(end - line));
    return newline != NULL ? newline : end;
}

static int is_separator(const char *line, const char *end)
{
    return (size_t)(end - line) >= SEPARATOR_BYTES && strspn(line, "=") >= SEPARATOR_BYTES;
}

/* Cuts the text at its separators; behind each stands a line "MSG: pkg/Name". */
static int split(description_t *description, const char *type, const char *schema)
{
    const char *end = schema + strlen(schema);
    const char *line = schema;
    section_t *section = &description->sections[0];
    if (full_name(type, "", section->name) != 0) {
        return -1;
    }
    section->text = schema;
    description->count = 1;
    while (line < end) {
        const char *stop = line_end(line, end);
        if (is_separator(line, stop)) {
            char name[NAME_BYTES];
            section->end = line;
            if (description->count == SECTIONS_MAX || stop == end || sscanf(stop + 1, "MSG: %255s", name) != 1) {
                return -1;
            }
            section = &description->sections[description->count++];
            if (full_name(name, type, section->name) != 0) {
                return -1;
            }
            stop = line_end(stop + 1, end);
            section->text = stop < end ? stop + 1 : end;
        }
        line = stop < end ? stop + 1 : end;
    }
    section->end = end;
    return 0;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(((const section_t *)a)->name, ((const section_t *)b)->name);
}

static unsigned base_type(const char *type)
{
    static const struct {
        const char *name;
        unsigned id;
    } types[] = {{"int8", 2},   {"uint8", 3}, {"int16", 4},  {"uint16", 5},   {"int32", 6},
                 {"uint32", 7}, {"int64", 8}, {"uint64", 9}, {"float32", 10}, {"float64", 11},
                 {"char", 13},  {"bool", 15}, {"byte", 16},  {"string", 17}};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        if (strcmp(types[i].name, type) == 0) {
            return types[i].id;
        }
    }
    return 0;
}

/* Takes "[...]" off a type: the id's offset, and the capacity of a fixed or bounded array. */
static int take_array(char *type, unsigned *offset, unsigned long *capacity)
{
    char *bracket = strchr(type, '[');
    *offset = 0;
    *capacity = 0;
    if (bracket == NULL) {
        return 0;
    }
    *bracket = '\0';
    const char *at = bracket + 1;
    const int bounded = strncmp(at, "<=", 2) == 0;
    at += bounded ? 2 : 0;
    if (*at == ']' && !bounded) {
        *offset = 144;
        return at[1] == '\0' ? 0 : -1;
    }
    char *stop = NULL;
    *capacity = strtoul(at, &stop, 10);
    *offset = bounded ? 96 : 48;
    return stop != at && strcmp(stop, "]") == 0 ? 0 : -1;
}

static int put_field(description_t *description, const char *home, char *type, const char *name)
{
    char nested[NAME_BYTES] = "";
    char json[3 * NAME_BYTES];
    unsigned offset = 0;
    unsigned long capacity = 0;
    unsigned long characters = 0;
    if (take_array(type, &offset, &capacity) != 0) {
        return -1;
    }
    unsigned id = base_type(type);
    if (strncmp(type, "string<=", 8) == 0) {
        id = 21;
        characters = strtoul(type + 8, NULL, 10);
    } else if (id == 0) {
        id = 1;
        if (strncmp(type, "wstring", 7) == 0 || full_name(type, home, nested) != 0) {
            return -1;
        }
    }
    const int length = snprintf(json, sizeof json,
                                "{\"name\": \"%s\", \"type\": {\"type_id\": %u, \"capacity\": %lu, "
                                "\"string_capacity\": %lu, \"nested_type_name\": \"%s\"}}",
                                name, offset + id, capacity, characters, nested);
    if (length < 0 || length >= (int)sizeof json) {
        return -1;
    }
    put(description, json);
    return 0;
}

/* True for "type NAME=value", whose '=' is not the one of a bound "<=". */
static int is_constant(const char *line, const char *end)
{
    for (const char *at = line; at < end; at++) {
        if (*at == '=' && (at == line || at[-1] != '<')) {
            return 1;
        }
    }
    return 0;
}

static int put_section(description_t *description, const section_t *section)
{
    int fields = 0;
    put(description, "{\"type_name\": \"");
    put(description, section->name);
    put(description, "\", \"fields\": [");
    for (const char *line = section->text; line < section->end;) {
        const char *stop = line_end(line, section->end);
        char copy[3 * NAME_BYTES];
        char type[NAME_BYTES];
        char name[NAME_BYTES];
        const char *comment = memchr(line, '#', (size_t)(stop - line));
        const size_t length = (size_t)((comment != NULL ? comment : stop) - line);
        if (length >= sizeof copy) {
            return -1;
        }
        memcpy(copy, line, length);
        copy[length] = '\0';
        line = stop < section->end ? stop + 1 : section->end;
        const int words = sscanf(copy, "%255s %255s", type, name);
        if (words < 1 || is_constant(copy, copy + length)) {
            continue;
        }
        put(description, fields > 0 ? ", " : "");
        if (words != 2 || put_field(description, section->name, type, name) != 0) {
            return -1;
        }
        fields++;
    }
    if (fields == 0) {
        /* What IDL generators put into an empty interface. */
        char type[] = "uint8";
        (void)put_field(description, section->name, type, "structure_needs_at_least_one_member");
    }
    put(description, "]}");
    return 0;
}

static int describe(description_t *description, const char *type, const char *schema)
{
    if (split(description, type, schema) != 0) {
        return -1;
    }
    fcsl_sha256_begin(&description->hash);
    put(description, "{\"type_description\": ");
    if (put_section(description, &description->sections[0]) != 0) {
        return -1;
    }
    put(description, ", \"referenced_type_descriptions\": [");
    qsort(description->sections + 1, description->count - 1, sizeof description->sections[0], by_name);
    for (size_t i = 1; i < description->count; i++) {
        put(description, i > 1 ? ", " : "");
        if (put_section(description, &description->sections[i]) != 0) {
            return -1;
        }
    }
    put(description, "]}");
    return 0;
}

int fcsl_type_hash(const char *type, const char *schema, char hash[FCSL_TYPE_HASH_BYTES])
{
    description_t *description = malloc(sizeof *description);
    hash[0] = '\0';
    if (description == NULL) {
        return -1;
    }
    const int status = describe(description, type, schema);
    if (status == 0) {
        memcpy(hash, "RIHS01_", 8);
        fcsl_sha256_end(&description->hash, hash + 7);
    }
    free(description);
    return status;
}
