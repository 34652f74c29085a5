/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_SHA256_H
#define FCSL_SHA256_H

#include <stddef.h>
#include <stdint.h>

enum { FCSL_SHA256_HEX_BYTES = 65 };

typedef struct {
    uint32_t state[8];
    uint64_t size;
    uint8_t block[64];
} fcsl_sha256_t;

void fcsl_sha256_begin(fcsl_sha256_t *hash);
void fcsl_sha256_add(fcsl_sha256_t *hash, const void *bytes, size_t size);
/* Lower-case hexadecimal, zero-terminated. */
void fcsl_sha256_end(fcsl_sha256_t *hash, char hex[FCSL_SHA256_HEX_BYTES]);

#endif /* FCSL_SHA256_H */
