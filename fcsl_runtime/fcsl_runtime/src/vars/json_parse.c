/* SPDX-License-Identifier: Apache-2.0
 *
 * Parses one JSON text into tokens of a fixed number.
 */
#include "json.h"

#include <string.h>

typedef struct {
    const char *text;
    uint32_t size;
    uint32_t at;
    json_token_t *tokens;
    uint32_t capacity;
    uint32_t count;
    const char *problem;
} parser_t;

static int fail(parser_t *p, const char *problem)
{
    if (p->problem == NULL) {
        p->problem = problem;
    }
    return -1;
}

static char peek(const parser_t *p)
{
    return p->at < p->size ? p->text[p->at] : '\0';
}

static void skip_blanks(parser_t *p)
{
    for (char c = peek(p); c == ' ' || c == '\t' || c == '\r' || c == '\n'; c = peek(p)) {
        p->at++;
    }
}

static json_token_t *new_token(parser_t *p, json_type_t type)
{
    if (p->count == p->capacity) {
        (void)fail(p, "too many values");
        return NULL;
    }
    json_token_t *token = &p->tokens[p->count++];
    *token = (json_token_t){.type = type, .start = p->at, .end = p->at};
    return token;
}

static int is_hex(char c)
{
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F');
}

static int parse_string(parser_t *p)
{
    p->at++;
    json_token_t *token = new_token(p, JSON_STRING);
    if (token == NULL) {
        return -1;
    }
    while (p->at < p->size && p->text[p->at] != '"') {
        const unsigned char c = (unsigned char)p->text[p->at++];
        if (c < 0x20) {
            return fail(p, "control character in a string");
        }
        if (c != '\\') {
            continue;
        }
        const char escape = peek(p);
        p->at++;
        if (escape == 'u') {
            for (int i = 0; i < 4; i++, p->at++) {
                if (!is_hex(peek(p))) {
                    return fail(p, "bad \\u escape");
                }
            }
        } else if (escape == '\0' || strchr("\"\\/bfnrt", escape) == NULL) {
            return fail(p, "bad escape in a string");
        }
    }
    if (p->at >= p->size) {
        return fail(p, "string without end");
    }
    token->end = p->at++;
    token->next = p->count;
    return 0;
}

static uint32_t skip_digits(parser_t *p)
{
    const uint32_t from = p->at;
    while (peek(p) >= '0' && peek(p) <= '9') {
        p->at++;
    }
    return p->at - from;
}

static int parse_number(parser_t *p)
{
    json_token_t *token = new_token(p, JSON_NUMBER);
    if (token == NULL) {
        return -1;
    }
    if (peek(p) == '-') {
        p->at++;
    }
    const int zero = peek(p) == '0';
    const uint32_t digits = skip_digits(p);
    if (digits == 0 || (zero && digits > 1)) {
        return fail(p, "malformed number");
    }
    if (peek(p) == '.') {
        p->at++;
        if (skip_digits(p) == 0) {
            return fail(p, "malformed number");
        }
    }
    if (peek(p) == 'e' || peek(p) == 'E') {
        p->at++;
        if (peek(p) == '+' || peek(p) == '-') {
            p->at++;
        }
        if (skip_digits(p) == 0) {
            return fail(p, "malformed number");
        }
    }
    token->end = p->at;
    token->next = p->count;
    return 0;
}

static int parse_word(parser_t *p, const char *word, json_type_t type)
{
    const size_t length = strlen(word);
    json_token_t *token = new_token(p, type);
    if (token == NULL) {
        return -1;
    }
    if (p->size - p->at < length || memcmp(p->text + p->at, word, length) != 0) {
        return fail(p, "not JSON");
    }
    p->at += (uint32_t)length;
    token->end = p->at;
    token->next = p->count;
    return 0;
}

static int parse_value(parser_t *p, int depth);

/* One member or element; 1 when another one follows, 0 behind the closing bracket. */
static int parse_item(parser_t *p, json_type_t type, char close, int depth)
{
    skip_blanks(p);
    if (type == JSON_OBJECT) {
        if (peek(p) != '"') {
            return fail(p, "a member of an object begins with its name in quotes");
        }
        if (parse_string(p) != 0) {
            return -1;
        }
        skip_blanks(p);
        if (peek(p) != ':') {
            return fail(p, "':' expected");
        }
        p->at++;
    }
    if (parse_value(p, depth + 1) != 0) {
        return -1;
    }
    skip_blanks(p);
    const char c = peek(p);
    if (c != ',' && c != close) {
        return fail(p, "',' or a closing bracket expected");
    }
    p->at++;
    return c == ',';
}

static int parse_container(parser_t *p, json_type_t type, char close, int depth)
{
    const uint32_t index = p->count;
    if (new_token(p, type) == NULL) {
        return -1;
    }
    p->at++;
    skip_blanks(p);
    uint32_t count = 0;
    if (peek(p) == close) {
        p->at++;
    } else {
        int more = 1;
        while (more == 1) {
            more = parse_item(p, type, close, depth);
            count++;
        }
        if (more < 0) {
            return -1;
        }
    }
    p->tokens[index].end = p->at;
    p->tokens[index].count = count;
    p->tokens[index].next = p->count;
    return 0;
}

static int parse_value(parser_t *p, int depth)
{
    if (depth > JSON_DEPTH_MAX) {
        return fail(p, "nested too deeply");
    }
    skip_blanks(p);
    switch (peek(p)) {
    case '{':
        return parse_container(p, JSON_OBJECT, '}', depth);
    case '[':
        return parse_container(p, JSON_ARRAY, ']', depth);
    case '"':
        return parse_string(p);
    case 't':
        return parse_word(p, "true", JSON_TRUE);
    case 'f':
        return parse_word(p, "false", JSON_FALSE);
    case 'n':
        return parse_word(p, "null", JSON_NULL);
    case '-':
        return parse_number(p);
    default:
        return peek(p) >= '0' && peek(p) <= '9' ? parse_number(p)
                                                : fail(p, p->at < p->size ? "not JSON" : "incomplete");
    }
}

size_t fcsl_json_character(const char *text, size_t left)
{
    const unsigned char *at = (const unsigned char *)text;
    if (at[0] < 0x80) {
        return 1;
    }
    const size_t length = at[0] >= 0xf0 ? 4 : at[0] >= 0xe0 ? 3 : 2;
    if (at[0] < 0xc2 || at[0] > 0xf4 || left < length) {
        return 0;
    }
    for (size_t i = 1; i < length; i++) {
        if ((at[i] & 0xc0) != 0x80) {
            return 0;
        }
    }
    const int outside = (at[0] == 0xe0 && at[1] < 0xa0) || (at[0] == 0xed && at[1] > 0x9f) ||
                        (at[0] == 0xf0 && at[1] < 0x90) || (at[0] == 0xf4 && at[1] > 0x8f);
    return outside ? 0 : length;
}

/* Eight characters of ASCII, most of what there is. */
static int ascii_word(const char *text, size_t left)
{
    uint64_t word = UINT64_MAX;
    if (left >= sizeof word) {
        memcpy(&word, text, sizeof word);
    }
    return (word & UINT64_C(0x8080808080808080)) == 0;
}

const char *fcsl_json_parse(const char *text, size_t size, json_token_t *tokens, uint32_t capacity, json_t *json)
{
    for (size_t i = 0; i < size;) {
        const size_t step = ascii_word(text + i, size - i) ? 8 : fcsl_json_character(text + i, size - i);
        if (step == 0) {
            return "not UTF-8";
        }
        i += step;
    }
    parser_t p = {.text = text, .size = (uint32_t)size, .tokens = tokens, .capacity = capacity};
    if (parse_value(&p, 0) != 0) {
        return p.problem;
    }
    skip_blanks(&p);
    if (p.at != p.size) {
        return "something follows the JSON value";
    }
    *json = (json_t){.text = text, .tokens = tokens, .count = p.count};
    return NULL;
}
