/* SPDX-License-Identifier: Apache-2.0
 *
 * CRC-16/CCITT-FALSE, a byte at a time.
 */
#include "fcsl/fcsl_link.h"

#include "crc_table.h"

/* Entry 1 is the polynomial; each next one is the one before it, shifted left and reduced. */
static const uint16_t TABLE[256] = {
    FCSL_CRC_TABLE(0x1021u, 0x2042u, 0x4084u, 0x8108u, 0x1231u, 0x2462u, 0x48c4u, 0x9188u),
};

uint16_t fcsl_crc16(uint16_t crc, const void *bytes, size_t size)
{
    const uint8_t *in = (const uint8_t *)bytes;
    for (size_t i = 0; i < size; i++) {
        crc = (uint16_t)(crc << 8 ^ TABLE[(crc >> 8 ^ in[i]) & 255u]);
    }
    return crc;
}
