/* SPDX-License-Identifier: Apache-2.0
 *
 * What parsed JSON holds: members of objects, text of strings.
 */
#include "json.h"

#include <string.h>

uint32_t fcsl_json_member(const json_t *json, uint32_t object, const char *key)
{
    const json_token_t *container = &json->tokens[object];
    uint32_t index = object + 1;
    for (uint32_t i = 0; container->type == JSON_OBJECT && i < container->count; i++) {
        const json_token_t *name = &json->tokens[index];
        const size_t length = name->end - name->start;
        if (strlen(key) == length && memcmp(json->text + name->start, key, length) == 0) {
            return index + 1;
        }
        index = json->tokens[index + 1].next;
    }
    return 0;
}

static unsigned hex_value(const char *text)
{
    unsigned value = 0;
    for (int i = 0; i < 4; i++) {
        const char c = text[i];
        value = value * 16u + (unsigned)(c <= '9' ? c - '0' : (c | 0x20) - 'a' + 10);
    }
    return value;
}

static size_t put_utf8(unsigned code, char *out)
{
    if (code < 0x80) {
        out[0] = (char)code;
        return 1;
    }
    if (code < 0x800) {
        out[0] = (char)(0xc0 | code >> 6);
        out[1] = (char)(0x80 | (code & 0x3f));
        return 2;
    }
    out[0] = (char)(0xe0 | code >> 12);
    out[1] = (char)(0x80 | (code >> 6 & 0x3f));
    out[2] = (char)(0x80 | (code & 0x3f));
    return 3;
}

int fcsl_json_string(const json_t *json, uint32_t token, char *out, size_t capacity)
{
    const json_token_t *string = &json->tokens[token];
    if (string->type != JSON_STRING) {
        return -1;
    }
    size_t length = string->end - string->start;
    if (length < capacity && memchr(json->text + string->start, '\\', length) == NULL) {
        memcpy(out, json->text + string->start, length);
        out[length] = '\0';
        return 0;
    }
    length = 0;
    for (uint32_t at = string->start; at < string->end; at++) {
        char piece[4] = {json->text[at]};
        size_t bytes = 1;
        const char c = *piece == '\\' ? json->text[++at] : '\0';
        if (c == 'u') {
            const unsigned code = hex_value(json->text + at + 1);
            at += 4;
            /* Names here are plain: a surrogate pair is not worth a decoder. */
            if (code == 0 || (code >= 0xd800 && code <= 0xdfff)) {
                return -1;
            }
            bytes = put_utf8(code, piece);
        } else if (c != '\0') {
            static const char from[] = "bfnrt";
            static const char to[] = "\b\f\n\r\t";
            const char *found = strchr(from, c);
            *piece = found != NULL ? to[found - from] : c;
        }
        if (length + bytes >= capacity) {
            return -1;
        }
        memcpy(out + length, piece, bytes);
        length += bytes;
    }
    out[length] = '\0';
    return 0;
}
