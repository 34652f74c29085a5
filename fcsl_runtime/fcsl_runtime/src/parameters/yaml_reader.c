/* SPDX-License-Identifier: Apache-2.0
 *
 * Mappings of parameter files, in lines or in braces: which values they have under which names.
 */
#include "yaml.h"

#include <string.h>

#include "yaml_items.h"

#define SECTION "ros__parameters"

enum { NONE = -1 };

typedef struct {
    yaml_cursor_t cursor;
    int64_t indent; /* of the line whose content the cursor is at; NONE at the end */
    char node[YAML_NAME_BYTES];
    char name[YAML_NAME_BYTES];
    uint32_t section; /* 0: none yet */
    int is_inside;    /* one */
    uint32_t depth;
    yaml_take_t take;
    void *ctx;
    fcsl_error_t *error;
} reader_t;

/* What a key changed. */
typedef struct {
    size_t node_length;
    size_t name_length;
    int was_inside;
} mark_t;

static int refuse(const reader_t *r, const char *why)
{
    return yaml_fail(r->cursor.file, r->cursor.line, r->error, "%s", why);
}

static int append(const reader_t *r, char *path, char separator, const yaml_item_t *key)
{
    const size_t length = strlen(path);
    const int joined = length > 0 && key->text[0] != separator;
    if (length + key->size + 2u > YAML_NAME_BYTES) {
        return refuse(r, "a name is too long");
    }
    if (joined) {
        path[length] = separator;
    }
    memcpy(path + length + (joined ? 1 : 0), key->text, key->size);
    path[length + key->size + (joined ? 1u : 0u)] = '\0';
    return 0;
}

/* Goes below a key. */
static int enter(reader_t *r, const yaml_item_t *key, mark_t *mark)
{
    *mark = (mark_t){strlen(r->node), strlen(r->name), r->is_inside};
    if (key->size == 0u) {
        return refuse(r, "a name is missing before `:`");
    }
    if (++r->depth > YAML_DEPTH_MAX) {
        return refuse(r, "lists and mappings lie too deep inside each other");
    }
    if (r->is_inside) {
        return append(r, r->name, '.', key);
    }
    if (key->size == strlen(SECTION) && memcmp(key->text, SECTION, key->size) == 0) {
        r->is_inside = 1;
        r->section++;
        return 0;
    }
    return append(r, r->node, '/', key);
}

static void leave(reader_t *r, const mark_t *mark)
{
    r->node[mark->node_length] = '\0';
    r->name[mark->name_length] = '\0';
    r->is_inside = mark->was_inside;
    r->depth--;
}

/* `[rad/s]` at the beginning of a comment. */
static void find_unit(const yaml_cursor_t *comment, yaml_entry_t *entry)
{
    const char *text = comment->text + comment->at + 1;
    size_t left = comment->size - comment->at - 1u;
    while (left > 0 && yaml_is_blank((unsigned char)*text)) {
        text++;
        left--;
    }
    if (left > 0 && *text == '[') {
        for (size_t i = 1; i < left && text[i] != '\n'; i++) {
            if (text[i] == ']') {
                entry->unit = text + 1;
                entry->unit_size = i - 1u;
                return;
            }
        }
    }
}

/* The rest of a line behind a value: nothing, or a comment. */
static int end_line(reader_t *r, yaml_entry_t *entry)
{
    yaml_cursor_t *cursor = &r->cursor;
    while (yaml_is_blank(yaml_peek(cursor))) {
        cursor->at++;
    }
    if (yaml_peek(cursor) == '#') {
        find_unit(cursor, entry);
        yaml_skip_comment(cursor);
    }
    return yaml_is_break(yaml_peek(cursor)) ? 0 : refuse(r, "expected the end of the line behind a value");
}

static int braces(reader_t *r);

/* A scalar or a list, and in a block what follows it on its line. */
static int plain_value(reader_t *r, int in_flow)
{
    yaml_cursor_t *cursor = &r->cursor;
    const size_t begin = cursor->at;
    yaml_entry_t entry = {.section = r->section, .node = r->node, .name = r->name, .unit = "", .line = cursor->line};
    yaml_item_t item;
    if ((yaml_peek(cursor) == '[' ? yaml_skip_list(cursor, r->depth, r->error)
                                  : yaml_scalar(cursor, in_flow, &item, r->error)) != 0) {
        return -1;
    }
    entry.value = (yaml_cursor_t){
        .text = cursor->text + begin, .size = cursor->at - begin, .line = entry.line, .file = cursor->file};
    if (!in_flow && end_line(r, &entry) != 0) {
        return -1;
    }
    if (!r->is_inside) {
        return yaml_fail(cursor->file, entry.line, r->error,
                         "`%.200s` has a value outside of `" SECTION ":`; a file begins with `/**:`, below it `" SECTION
                         ":`, and below it the parameters",
                         r->node);
    }
    return r->take(r->ctx, &entry, r->error);
}

/* One `key: value` of braces. */
static int pair(reader_t *r)
{
    yaml_cursor_t *cursor = &r->cursor;
    yaml_item_t key;
    mark_t mark;
    if (yaml_scalar(cursor, 1, &key, r->error) != 0) {
        return -1;
    }
    yaml_skip_space(cursor);
    if (yaml_peek(cursor) != ':') {
        return refuse(r, "expected `:` behind a name");
    }
    cursor->at++;
    yaml_skip_space(cursor);
    if (enter(r, &key, &mark) != 0 || (yaml_peek(cursor) == '{' ? braces(r) : plain_value(r, 1)) != 0) {
        return -1;
    }
    leave(r, &mark);
    return 0;
}

static int braces(reader_t *r)
{
    yaml_cursor_t *cursor = &r->cursor;
    cursor->at++;
    yaml_skip_space(cursor);
    while (yaml_peek(cursor) != '}') {
        if (pair(r) != 0) {
            return -1;
        }
        yaml_skip_space(cursor);
        if (yaml_peek(cursor) == ',') {
            cursor->at++;
            yaml_skip_space(cursor);
        } else if (yaml_peek(cursor) != '}') {
            return refuse(r, "expected `,` or `}` in a mapping");
        }
    }
    cursor->at++;
    return 0;
}

/* To the content of the next line that has any. */
static int next_line(reader_t *r)
{
    yaml_cursor_t *cursor = &r->cursor;
    for (;;) {
        if (yaml_peek(cursor) == '\n') {
            cursor->at++;
            cursor->line++;
        }
        const size_t begin = cursor->at;
        while (yaml_peek(cursor) == ' ') {
            cursor->at++;
        }
        r->indent = (int64_t)(cursor->at - begin);
        while (yaml_is_blank(yaml_peek(cursor))) {
            cursor->at++;
        }
        if (yaml_peek(cursor) == '#') {
            yaml_skip_comment(cursor);
        }
        if (yaml_peek(cursor) == -1) {
            r->indent = NONE;
            return 0;
        }
        if (yaml_peek(cursor) != '\n') {
            return cursor->at == begin + (size_t)r->indent ? 0 : refuse(r, "a line is indented by a tab; use spaces");
        }
    }
}

static int lines(reader_t *r, int64_t indent);

/* What stands behind the colon of a line, or below it. */
static int line_value(reader_t *r, int64_t indent)
{
    yaml_cursor_t *cursor = &r->cursor;
    const uint32_t line = cursor->line;
    while (yaml_is_blank(yaml_peek(cursor))) {
        cursor->at++;
    }
    const int first = yaml_peek(cursor);
    if (first == '{') {
        yaml_entry_t nothing;
        return braces(r) != 0 || end_line(r, &nothing) != 0 ? -1 : next_line(r);
    }
    if (first != '#' && !yaml_is_break(first)) {
        return plain_value(r, 0) != 0 ? -1 : next_line(r);
    }
    if (first == '#') {
        yaml_skip_comment(cursor);
    }
    if (next_line(r) != 0) {
        return -1;
    }
    if (r->indent <= indent) {
        return yaml_fail(cursor->file, line, r->error, "`%s` has no value", r->is_inside ? r->name : r->node);
    }
    return lines(r, r->indent);
}

/* The lines of one indentation, and what is below them. */
static int lines(reader_t *r, int64_t indent)
{
    yaml_cursor_t *cursor = &r->cursor;
    while (r->indent == indent) {
        yaml_item_t key;
        mark_t mark;
        if (yaml_peek(cursor) == '-') {
            return refuse(r, "a list is written in brackets, `[1.0, 2.0]`, not in lines that begin with `-`");
        }
        if (yaml_scalar(cursor, 0, &key, r->error) != 0) {
            return -1;
        }
        while (yaml_is_blank(yaml_peek(cursor))) {
            cursor->at++;
        }
        if (yaml_peek(cursor) != ':') {
            return refuse(r, "expected `name: value`");
        }
        cursor->at++;
        if (enter(r, &key, &mark) != 0 || line_value(r, indent) != 0) {
            return -1;
        }
        leave(r, &mark);
    }
    return r->indent > indent ? refuse(r, "the indentation fits no line above") : 0;
}

int64_t yaml_read(const char *text, size_t size, const char *file, yaml_take_t take, void *ctx, fcsl_error_t *error)
{
    reader_t r = {
        .cursor = {.text = text, .size = size, .line = 1, .file = file}, .take = take, .ctx = ctx, .error = error};
    if (size > 0 && memchr(text, '\0', size) != NULL) {
        return refuse(&r, "there is a zero byte: this is no text");
    }
    if (next_line(&r) != 0) {
        return -1;
    }
    if (r.indent == 0 && size - r.cursor.at >= 3u && memcmp(text + r.cursor.at, "---", 3) == 0) {
        yaml_entry_t nothing;
        r.cursor.at += 3u;
        if (end_line(&r, &nothing) != 0 || next_line(&r) != 0) {
            return -1;
        }
    }
    if (r.indent != NONE && yaml_peek(&r.cursor) == '{') {
        yaml_entry_t nothing;
        if (braces(&r) != 0 || end_line(&r, &nothing) != 0 || next_line(&r) != 0) {
            return -1;
        }
        return r.indent == NONE ? (int64_t)r.section : refuse(&r, "expected the end of the file behind `}`");
    }
    return r.indent == NONE || lines(&r, r.indent) == 0 ? (int64_t)r.section : -1;
}
