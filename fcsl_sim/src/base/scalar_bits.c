/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars of fields from bits and to numbers.
 */
#include "scalar_bits.h"

#include <string.h>

#include "fcsl/fcsl_machine.h"

void fcsl_write_bits(uint8_t *to, uint32_t size, uint64_t bits)
{
    const uint32_t low = (uint32_t)bits;
    if (size == 8) {
        memcpy(to, &bits, 8);
    } else if (size == 4) {
        memcpy(to, &low, 4);
    } else {
        *to = (uint8_t)low;
    }
}

double fcsl_as_double(uint64_t bits, uint8_t type)
{
    const uint32_t low = (uint32_t)bits;
    float f32;
    double f64;
    switch (type) {
    case FCSL_I32:
        return (double)(int32_t)low;
    case FCSL_I64:
        return (double)(int64_t)bits;
    case FCSL_F32:
        memcpy(&f32, &low, sizeof f32);
        return (double)f32;
    case FCSL_F64:
        memcpy(&f64, &bits, sizeof f64);
        return f64;
    default:
        return (double)bits;
    }
}
