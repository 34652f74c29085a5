/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_VARS_BASE64_H
#define FCSL_VARS_BASE64_H

#include <stddef.h>
#include <stdint.h>

#define BASE64_BYTES(size) (((size) + 2u) / 3u * 4u + 1u)

/* Writes the padded, zero-terminated text; `out` has BASE64_BYTES(size) bytes. */
void fcsl_base64_encode(const uint8_t *bytes, size_t size, char *out);
/* Bytes that padded text of this length holds, or -1 when it cannot be base64. */
ptrdiff_t fcsl_base64_size(const char *text, size_t length);
/* Decodes exactly `size` bytes; returns 0, or -1 when the text is malformed or holds another number of bytes. */
int fcsl_base64_decode(const char *text, size_t length, uint8_t *bytes, size_t size);

#endif /* FCSL_VARS_BASE64_H */
