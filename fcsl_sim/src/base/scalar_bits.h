/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars of fields as zero-extended bits.
 */
#ifndef FCSL_SIM_SCALAR_BITS_H
#define FCSL_SIM_SCALAR_BITS_H

#include <stdint.h>

/* Writes a scalar of `size` bytes given as zero-extended bits. */
void fcsl_write_bits(uint8_t *to, uint32_t size, uint64_t bits);
/* A scalar from its zero-extended bits; integers beyond 2^53 are rounded. */
double fcsl_as_double(uint64_t bits, uint8_t type);

#endif /* FCSL_SIM_SCALAR_BITS_H */
