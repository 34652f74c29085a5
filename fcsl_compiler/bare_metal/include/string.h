/* SPDX-License-Identifier: Apache-2.0
 *
 * Of the C standard's <string.h>, what generated code and CORE-MATH use; see ../runtime.c.
 */
#ifndef FCSL_BARE_METAL_STRING_H
#define FCSL_BARE_METAL_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t size);
void *memmove(void *to, const void *from, size_t size);
void *memset(void *to, int value, size_t size);
void *memchr(const void *bytes, int value, size_t size);
int memcmp(const void *one, const void *other, size_t size);

#endif
