/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars and lists of parameter files.
 */
#include "yaml_items.h"

#include <stdarg.h>
#include <string.h>

enum { REASON_BYTES = 384 };

int yaml_fail(const char *file, uint32_t line, fcsl_error_t *error, const char *format, ...)
{
    char reason[REASON_BYTES];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(reason, sizeof reason, format, arguments);
    va_end(arguments);
    for (char *at = reason; *at != '\0'; at++) {
        if ((unsigned char)*at < ' ' || *at == 0x7f) {
            *at = '?'; /* what a hostile file names shall not steer a terminal */
        }
    }
    if (file[0] == '\0') {
        return fcsl_fail(error, "%s", reason);
    }
    return line > 0u ? fcsl_fail(error, "%.120s:%u: %s", file, (unsigned)line, reason)
                     : fcsl_fail(error, "%.120s: %s", file, reason);
}

int yaml_peek(const yaml_cursor_t *cursor)
{
    return cursor->at < cursor->size ? (unsigned char)cursor->text[cursor->at] : -1;
}

int yaml_is_blank(int byte)
{
    return byte == ' ' || byte == '\t' || byte == '\r';
}

int yaml_is_break(int byte)
{
    return byte == '\n' || byte == -1;
}

void yaml_skip_comment(yaml_cursor_t *cursor)
{
    while (!yaml_is_break(yaml_peek(cursor))) {
        cursor->at++;
    }
}

void yaml_skip_space(yaml_cursor_t *cursor)
{
    for (;;) {
        const int byte = yaml_peek(cursor);
        if (byte == '\n') {
            cursor->line++;
        } else if (byte == '#' && (cursor->at == 0 || strchr(" \t\n,[{", cursor->text[cursor->at - 1]) != NULL)) {
            yaml_skip_comment(cursor);
            continue;
        } else if (!yaml_is_blank(byte)) {
            return;
        }
        cursor->at++;
    }
}

static int refuse(const yaml_cursor_t *cursor, fcsl_error_t *error, const char *why)
{
    return yaml_fail(cursor->file, cursor->line, error, "%s", why);
}

static int read_string(yaml_cursor_t *cursor, yaml_item_t *item, fcsl_error_t *error)
{
    const char quote = cursor->text[cursor->at++];
    const size_t begin = cursor->at;
    for (int byte = yaml_peek(cursor); byte != quote; byte = yaml_peek(cursor)) {
        if (yaml_is_break(byte)) {
            return refuse(cursor, error, "a string does not end on its line");
        }
        if (byte == '\\' && quote == '"') {
            return refuse(cursor, error, "a string has a backslash; names need none");
        }
        cursor->at++;
    }
    *item = (yaml_item_t){
        .kind = YAML_STRING, .text = cursor->text + begin, .size = cursor->at - begin, .line = cursor->line};
    cursor->at++;
    return 0;
}

static int ends_word(const yaml_cursor_t *cursor, int in_flow)
{
    const int byte = yaml_peek(cursor);
    if (yaml_is_break(byte) || (in_flow && strchr(",[]{}", byte) != NULL)) {
        return 1;
    }
    const int next = cursor->at + 1 < cursor->size ? (unsigned char)cursor->text[cursor->at + 1] : -1;
    if (byte == ':' && (yaml_is_blank(next) || yaml_is_break(next) || (in_flow && strchr(",[]{}", next) != NULL))) {
        return 1;
    }
    return yaml_is_blank(byte) && next == '#';
}

static int read_word(yaml_cursor_t *cursor, int in_flow, yaml_item_t *item, fcsl_error_t *error)
{
    const int first = yaml_peek(cursor);
    if (first >= 0 && strchr("&*!|>%@`?,]}", first) != NULL) {
        return yaml_fail(cursor->file, cursor->line, error,
                         "a value or name begins with `%c`; parameter files have plain scalars, lists and mappings, "
                         "without anchors, aliases, tags and blocks of text",
                         first);
    }
    const size_t begin = cursor->at;
    while (!ends_word(cursor, in_flow)) {
        if (yaml_peek(cursor) == '\0') {
            return refuse(cursor, error, "there is a zero byte");
        }
        cursor->at++;
    }
    size_t end = cursor->at;
    while (end > begin && yaml_is_blank((unsigned char)cursor->text[end - 1])) {
        end--;
    }
    *item = (yaml_item_t){.kind = YAML_WORD, .text = cursor->text + begin, .size = end - begin, .line = cursor->line};
    return 0;
}

int yaml_scalar(yaml_cursor_t *cursor, int in_flow, yaml_item_t *item, fcsl_error_t *error)
{
    const int first = yaml_peek(cursor);
    return first == '"' || first == '\'' ? read_string(cursor, item, error) : read_word(cursor, in_flow, item, error);
}

int yaml_next(yaml_cursor_t *cursor, yaml_item_t *item, fcsl_error_t *error)
{
    yaml_skip_space(cursor);
    while (yaml_peek(cursor) == ',') { /* a list that was checked has them where they belong */
        cursor->at++;
        yaml_skip_space(cursor);
    }
    const int first = yaml_peek(cursor);
    *item = (yaml_item_t){.kind = YAML_END, .text = "", .line = cursor->line};
    if (first == -1) {
        return 0;
    }
    if (first == '[' || first == ']') {
        item->kind = first == '[' ? YAML_OPEN : YAML_CLOSE;
        cursor->at++;
        return 0;
    }
    return yaml_scalar(cursor, cursor->text[0] == '[', item, error);
}

int yaml_skip_list(yaml_cursor_t *cursor, uint32_t depth, fcsl_error_t *error)
{
    if (depth >= YAML_DEPTH_MAX) {
        return refuse(cursor, error, "lists and mappings lie too deep inside each other");
    }
    cursor->at++;
    yaml_skip_space(cursor);
    while (yaml_peek(cursor) != ']') {
        yaml_item_t item;
        const int byte = yaml_peek(cursor);
        if (byte == '{') {
            return refuse(cursor, error,
                          "a mapping in a list; structs of an array are named by their index: `name.0.field: 1.0`");
        }
        if ((byte == '[' ? yaml_skip_list(cursor, depth + 1u, error) : yaml_scalar(cursor, 1, &item, error)) != 0) {
            return -1;
        }
        yaml_skip_space(cursor);
        if (yaml_peek(cursor) == ',') {
            cursor->at++;
            yaml_skip_space(cursor);
        } else if (yaml_peek(cursor) != ']') {
            return refuse(cursor, error, "expected `,` or `]` in a list");
        }
    }
    cursor->at++;
    return 0;
}
