/* SPDX-License-Identifier: Apache-2.0 */
#include "fcsl/fcsl_codec.h"

/* Half-byte table of the reflected polynomial 0xedb88320: 64 bytes of cache instead of a kilobyte, and short enough to
 * be checked by eye. */
static const uint32_t NIBBLE_TABLE[16] = {
    0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u, 0x4db26158u, 0x5005713cu,
    0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu, 0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu,
};

uint32_t fcsl_crc32(uint32_t crc, const void *bytes, size_t size)
{
    const uint8_t *in = (const uint8_t *)bytes;
    uint32_t value = ~crc;
    for (size_t i = 0; i < size; i++) {
        value ^= in[i];
        value = (value >> 4) ^ NIBBLE_TABLE[value & 15u];
        value = (value >> 4) ^ NIBBLE_TABLE[value & 15u];
    }
    return ~value;
}
