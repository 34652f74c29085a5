/* SPDX-License-Identifier: Apache-2.0
 *
 * CRC-32 by eight bytes at a time ("slicing by 8": Kounavis and Berry, "A systematic approach to building high performance,
 * software-based, CRC generators", 2005). 8 KiB of constants, which the compiler makes of 64 numbers.
 */
#include "fcsl/fcsl_codec.h"

#include "base/crc_table.h"

/* What byte i of eight leaves behind the eighth. The last number is the reflected polynomial; each other one follows from its
 * right neighbour (the last of a row from the first of the row below): n >> 1, ^ 0xedb88320 where n is odd. */
static const uint32_t TABLES[8][256] = {
    {FCSL_CRC_TABLE(0xccaa009eu, 0x4225077du, 0x844a0efau, 0xd3e51bb5u, 0x7cbb312bu, 0xf9766256u, 0x299dc2edu,
                    0x533b85dau)},
    {FCSL_CRC_TABLE(0xa6770bb4u, 0x979f1129u, 0xf44f2413u, 0x33ef4e67u, 0x67de9cceu, 0xcfbd399cu, 0x440b7579u,
                    0x8816eaf2u)},
    {FCSL_CRC_TABLE(0xcb5cd3a5u, 0x4dc8a10bu, 0x9b914216u, 0xec53826du, 0x03d6029bu, 0x07ac0536u, 0x0f580a6cu,
                    0x1eb014d8u)},
    {FCSL_CRC_TABLE(0x3d6029b0u, 0x7ac05360u, 0xf580a6c0u, 0x30704bc1u, 0x60e09782u, 0xc1c12f04u, 0x58f35849u,
                    0xb1e6b092u)},
    {FCSL_CRC_TABLE(0xb8bc6765u, 0xaa09c88bu, 0x8f629757u, 0xc5b428efu, 0x5019579fu, 0xa032af3eu, 0x9b14583du,
                    0xed59b63bu)},
    {FCSL_CRC_TABLE(0x01c26a37u, 0x0384d46eu, 0x0709a8dcu, 0x0e1351b8u, 0x1c26a370u, 0x384d46e0u, 0x709a8dc0u,
                    0xe1351b80u)},
    {FCSL_CRC_TABLE(0x191b3141u, 0x32366282u, 0x646cc504u, 0xc8d98a08u, 0x4ac21251u, 0x958424a2u, 0xf0794f05u,
                    0x3b83984bu)},
    {FCSL_CRC_TABLE(0x77073096u, 0xee0e612cu, 0x076dc419u, 0x0edb8832u, 0x1db71064u, 0x3b6e20c8u, 0x76dc4190u,
                    0xedb88320u)},
};

static uint32_t eight_bytes(uint32_t value, const uint8_t *in)
{
    value ^= (uint32_t)in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
    return TABLES[0][value & 255u] ^ TABLES[1][value >> 8 & 255u] ^ TABLES[2][value >> 16 & 255u] ^
           TABLES[3][value >> 24] ^ TABLES[4][in[4]] ^ TABLES[5][in[5]] ^ TABLES[6][in[6]] ^ TABLES[7][in[7]];
}

uint32_t fcsl_crc32(uint32_t crc, const void *bytes, size_t size)
{
    const uint8_t *in = (const uint8_t *)bytes;
    uint32_t value = ~crc;
    size_t i = 0;
    for (; i + 8u <= size; i += 8u) {
        value = eight_bytes(value, in + i);
    }
    for (; i < size; i++) {
        value = value >> 8 ^ TABLES[7][(value ^ in[i]) & 255u];
    }
    return ~value;
}
