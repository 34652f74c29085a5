/* SPDX-License-Identifier: Apache-2.0
 *
 * Base64 (RFC 4648).
 */
#include "base64.h"

static const char DIGITS[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

void fcsl_base64_encode(const uint8_t *bytes, size_t size, char *out)
{
    size_t at = 0;
    for (size_t i = 0; i < size; i += 3) {
        const size_t left = size - i;
        const uint32_t group = (uint32_t)bytes[i] << 16 | (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0u) |
                               (left > 2 ? (uint32_t)bytes[i + 2] : 0u);
        out[at++] = DIGITS[group >> 18];
        out[at++] = DIGITS[group >> 12 & 63u];
        out[at++] = left > 1 ? DIGITS[group >> 6 & 63u] : '=';
        out[at++] = left > 2 ? DIGITS[group & 63u] : '=';
    }
    out[at] = '\0';
}

static int digit(char c)
{
    if (c >= 'A' && c <= 'Z') {
        return c - 'A';
    }
    if (c >= 'a' && c <= 'z') {
        return c - 'a' + 26;
    }
    if (c >= '0' && c <= '9') {
        return c - '0' + 52;
    }
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

ptrdiff_t fcsl_base64_size(const char *text, size_t length)
{
    if (length % 4u != 0) {
        return -1;
    }
    const size_t padding = length == 0 ? 0u : (size_t)(text[length - 1] == '=') + (size_t)(text[length - 2] == '=');
    return (ptrdiff_t)(length / 4u * 3u - padding);
}

int fcsl_base64_decode(const char *text, size_t length, uint8_t *bytes, size_t size)
{
    if (length != BASE64_BYTES(size) - 1u) {
        return -1;
    }
    const size_t digits = (size * 8u + 5u) / 6u;
    uint32_t bits = 0;
    uint32_t held = 0;
    size_t at = 0;
    for (size_t i = 0; i < length; i++) {
        if (i >= digits) {
            if (text[i] != '=') {
                return -1;
            }
            continue;
        }
        const int value = digit(text[i]);
        if (value < 0) {
            return -1;
        }
        bits = bits << 6 | (uint32_t)value;
        held += 6;
        if (held >= 8) {
            held -= 8;
            bytes[at++] = (uint8_t)(bits >> held);
        }
    }
    return at == size ? 0 : -1;
}
