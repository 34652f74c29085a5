/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars of every type: what their bits mean, and where they are written.
 */
#include <stdint.h>
#include <string.h>

#include "base/scalar_bits.h"
#include "check.h"
#include "fcsl/fcsl_machine.h"

static void test_numbers(void)
{
    static const struct {
        uint8_t type;
        uint64_t bits;
        double number;
    } CASES[] = {
        {FCSL_BOOL, 1u, 1.0},
        {FCSL_I32, 0xfffffffdu, -3.0},
        {FCSL_I32, 7u, 7.0},
        {FCSL_U32, 0xfffffffdu, 4294967293.0},
        {FCSL_I64, UINT64_MAX - 2u, -3.0},
        {FCSL_U64, UINT64_C(1) << 63, 9223372036854775808.0},
        {FCSL_F32, 0xbfc00000u, -1.5},
        {FCSL_F64, UINT64_C(0xbff8000000000000), -1.5},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        CHECK(fcsl_as_double(CASES[i].bits, CASES[i].type) == CASES[i].number);
    }
}

static void test_bytes(void)
{
    static const uint32_t SIZES[] = {1, 4, 8};
    for (size_t i = 0; i < sizeof SIZES / sizeof SIZES[0]; i++) {
        const uint64_t bits = UINT64_C(0x0102030405060708);
        const uint32_t low = (uint32_t)bits;
        const uint8_t lowest = (uint8_t)bits;
        uint8_t expected[9];
        uint8_t written[9];
        memset(expected, 0xee, sizeof expected);
        memset(written, 0xee, sizeof written);
        memcpy(expected, SIZES[i] == 8 ? (const void *)&bits : SIZES[i] == 4 ? (const void *)&low : &lowest, SIZES[i]);
        fcsl_write_bits(written, SIZES[i], bits);
        CHECK(memcmp(written, expected, sizeof written) == 0);
    }
}

int main(void)
{
    test_numbers();
    test_bytes();
    return 0;
}
