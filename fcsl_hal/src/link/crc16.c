/* SPDX-License-Identifier: Apache-2.0
 *
 * CRC-16/CCITT-FALSE by eight bytes at a time (as crc32.c). 4 KiB of constants, which the compiler makes of 64 numbers.
 */
#include "fcsl/fcsl_link.h"

#include "base/crc_table.h"

/* What byte i of eight leaves behind the eighth. The first number of the last row is the polynomial; each other one follows from
 * its left neighbour (the first of a row from the last of the row below): n << 1, ^ 0x1021 where n has its highest bit. */
static const uint16_t TABLES[8][256] = {
    {FCSL_CRC_TABLE(0x47d3u, 0x8fa6u, 0x0f6du, 0x1edau, 0x3db4u, 0x7b68u, 0xf6d0u, 0xfd81u)},
    {FCSL_CRC_TABLE(0xb861u, 0x60e3u, 0xc1c6u, 0x93adu, 0x377bu, 0x6ef6u, 0xddecu, 0xabf9u)},
    {FCSL_CRC_TABLE(0x45a0u, 0x8b40u, 0x06a1u, 0x0d42u, 0x1a84u, 0x3508u, 0x6a10u, 0xd420u)},
    {FCSL_CRC_TABLE(0xaa51u, 0x4483u, 0x8906u, 0x022du, 0x045au, 0x08b4u, 0x1168u, 0x22d0u)},
    {FCSL_CRC_TABLE(0x76b4u, 0xed68u, 0xcaf1u, 0x85c3u, 0x1ba7u, 0x374eu, 0x6e9cu, 0xdd38u)},
    {FCSL_CRC_TABLE(0x3730u, 0x6e60u, 0xdcc0u, 0xa9a1u, 0x4363u, 0x86c6u, 0x1dadu, 0x3b5au)},
    {FCSL_CRC_TABLE(0x3331u, 0x6662u, 0xccc4u, 0x89a9u, 0x0373u, 0x06e6u, 0x0dccu, 0x1b98u)},
    {FCSL_CRC_TABLE(0x1021u, 0x2042u, 0x4084u, 0x8108u, 0x1231u, 0x2462u, 0x48c4u, 0x9188u)},
};

static uint32_t eight_bytes(uint32_t crc, const uint8_t *in)
{
    return (uint32_t)TABLES[0][crc >> 8 ^ in[0]] ^ TABLES[1][(crc & 255u) ^ in[1]] ^ TABLES[2][in[2]] ^
           TABLES[3][in[3]] ^ TABLES[4][in[4]] ^ TABLES[5][in[5]] ^ TABLES[6][in[6]] ^ TABLES[7][in[7]];
}

uint16_t fcsl_crc16(uint16_t crc, const void *bytes, size_t size)
{
    const uint8_t *in = (const uint8_t *)bytes;
    uint32_t value = crc;
    size_t i = 0;
    for (; i + 8u <= size; i += 8u) {
        value = eight_bytes(value, in + i);
    }
    for (; i < size; i++) {
        value = (value << 8 & 0xff00u) ^ TABLES[7][value >> 8 ^ in[i]];
    }
    return (uint16_t)value;
}
