/* SPDX-License-Identifier: Apache-2.0
 *
 * Words of plans.
 */
#include "fcsl/fcsl_plan_text.h"

#include <string.h>

#define NAME_CHARACTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_"

enum { NAME_MAX_BYTES = 64, PATH_MAX_BYTES = 200, BITS_DIGITS = 16, DELETE = 0x7f };

const char *fcsl_plan_cut_lines(char *text, size_t size, size_t line_max, uint32_t *lines)
{
    size_t length = 0;
    *lines = 1;
    for (size_t i = 0; i < size; i++) {
        const uint8_t c = (uint8_t)text[i];
        if (c == '\n') {
            text[i] = '\0';
            *lines += i + 1u < size;
            length = 0;
        } else if (c < ' ' || c == DELETE) {
            return "a control character";
        } else if (++length > line_max) {
            return "the line is too long";
        }
    }
    return NULL;
}

const char *fcsl_plan_split(char *line, char **words, uint32_t count, int rest)
{
    uint32_t found = 0;
    char *at = line;
    while (at != NULL && found < count) {
        words[found++] = at;
        char *space = rest && found == count ? NULL : strchr(at, ' ');
        if (space != NULL) {
            *space++ = '\0';
        }
        at = space;
    }
    if (found != count || at != NULL) {
        return "wrong number of words for this statement";
    }
    for (uint32_t i = 0; i < count; i++) {
        if (words[i][0] == '\0') {
            return "an empty word (two spaces, or one at the end)";
        }
    }
    return NULL;
}

int fcsl_plan_number(const char *word, uint64_t limit, uint64_t *value)
{
    uint64_t number = 0;
    if (word[0] == '\0' || (word[0] == '0' && word[1] != '\0')) {
        return -1;
    }
    for (const char *c = word; *c != '\0'; c++) {
        const uint64_t digit = (uint64_t)(uint8_t)*c - '0';
        if (*c < '0' || *c > '9' || number > (UINT64_MAX - digit) / 10u) {
            return -1;
        }
        number = number * 10u + digit;
    }
    *value = number <= limit ? number : *value;
    return number <= limit ? 0 : -1;
}

int fcsl_plan_bits(const char *word, uint64_t *bits)
{
    uint64_t value = 0;
    if (strlen(word) != BITS_DIGITS) {
        return -1;
    }
    for (const char *c = word; *c != '\0'; c++) {
        const int is_digit = *c >= '0' && *c <= '9';
        if (!is_digit && (*c < 'a' || *c > 'f')) {
            return -1;
        }
        value = value << 4 | (uint64_t)(is_digit ? *c - '0' : *c - 'a' + 10);
    }
    *bits = value;
    return 0;
}

int fcsl_plan_is_name(const char *word)
{
    const size_t length = strlen(word);
    return length > 0u && length <= NAME_MAX_BYTES && (word[0] < '0' || word[0] > '9') &&
           strspn(word, NAME_CHARACTERS) == length;
}

int fcsl_plan_is_path(const char *word)
{
    const size_t length = strlen(word);
    return length > 0u && length <= PATH_MAX_BYTES && strspn(word, NAME_CHARACTERS ".") == length;
}
