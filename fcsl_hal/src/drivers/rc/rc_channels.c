/* SPDX-License-Identifier: Apache-2.0
 *
 * The packing of channels in SBUS and CRSF.
 */
#include "rc.h"

void rc_unpack(const uint8_t packed[RC_PACKED_BYTES], float pulse_us[RC_PACKED_CHANNELS])
{
    uint32_t bits = 0;
    uint32_t have = 0;
    uint32_t next = 0;
    for (uint32_t i = 0; i < RC_PACKED_CHANNELS; i++) {
        while (have < 11u) { /* twice at most */
            bits |= (uint32_t)packed[next++] << have;
            have += 8u;
        }
        /* 992 is the middle, and a step 5/8 us: exact in binary. */
        pulse_us[i] = 1500.0f + ((float)(bits & 0x7FFu) - 992.0f) * 0.625f;
        bits >>= 11;
        have -= 11u;
    }
}

int rc_is_empty(const uint8_t packed[RC_PACKED_BYTES])
{
    uint32_t bits = 0;
    for (uint32_t i = 0; i < RC_PACKED_BYTES; i++) {
        bits |= packed[i];
    }
    return bits == 0u;
}
