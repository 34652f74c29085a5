/* SPDX-License-Identifier: Apache-2.0
 *
 * What compiled code takes from a C library on a Cortex-M7 that has none. Every function of numbers here is exact, or rounds
 * once: nothing in it is a matter of taste, so the bits are those of any other target. (fma, sqrt, floor, round and their
 * like are instructions of this processor.)
 */
#include <fenv.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

/* ---- memory; volatile: of plain loops a compiler makes calls of the functions they define --------------------------------- */

static void copy(volatile uint8_t *to, const uint8_t *from, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        to[i] = from[i];
    }
}

static void copy_down(volatile uint8_t *to, const uint8_t *from, size_t size)
{
    for (size_t i = size; i > 0; i--) {
        to[i - 1u] = from[i - 1u];
    }
}

static void fill(volatile uint8_t *to, int value, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        to[i] = (uint8_t)value;
    }
}

void *memcpy(void *restrict to, const void *restrict from, size_t size)
{
    copy(to, from, size);
    return to;
}

static void move(void *to, const void *from, size_t size)
{
    ((uintptr_t)to < (uintptr_t)from ? copy : copy_down)(to, from, size);
}

void *memmove(void *to, const void *from, size_t size)
{
    move(to, from, size);
    return to;
}

void *memset(void *to, int value, size_t size)
{
    fill(to, value, size);
    return to;
}

/* The same for memory of some alignment: every name that the ARM run-time ABI has for it, since which of them a loop becomes
 * is the compiler's choice. None calls memcpy, memmove or memset: of such a call a compiler makes one of these. */
#define MEMORY(bytes)                                                                                                  \
    void __aeabi_memcpy##bytes(void *to, const void *from, size_t size);                                               \
    void __aeabi_memcpy##bytes(void *to, const void *from, size_t size)                                                \
    {                                                                                                                  \
        copy(to, from, size);                                                                                          \
    }                                                                                                                  \
    void __aeabi_memmove##bytes(void *to, const void *from, size_t size);                                              \
    void __aeabi_memmove##bytes(void *to, const void *from, size_t size)                                               \
    {                                                                                                                  \
        move(to, from, size);                                                                                          \
    }                                                                                                                  \
    void __aeabi_memset##bytes(void *to, size_t size, int value);                                                      \
    void __aeabi_memset##bytes(void *to, size_t size, int value)                                                       \
    {                                                                                                                  \
        fill(to, value, size);                                                                                         \
    }                                                                                                                  \
    void __aeabi_memclr##bytes(void *to, size_t size);                                                                 \
    void __aeabi_memclr##bytes(void *to, size_t size)                                                                  \
    {                                                                                                                  \
        fill(to, 0, size);                                                                                             \
    }

MEMORY()
MEMORY(4)
MEMORY(8)

void *memchr(const void *bytes, int value, size_t size)
{
    const uint8_t *in = bytes;
    for (size_t i = 0; i < size; i++) {
        if (in[i] == (uint8_t)value) {
            return (void *)(uintptr_t)(in + i);
        }
    }
    return NULL;
}

int memcmp(const void *one, const void *other, size_t size)
{
    const uint8_t *a = one;
    const uint8_t *b = other;
    for (size_t i = 0; i < size; i++) {
        if (a[i] != b[i]) {
            return a[i] < b[i] ? -1 : 1;
        }
    }
    return 0;
}

/* ---- integers of 64 bits (names of the ARM run-time ABI) --------------------------------------------------------------- */

/* Shift and subtract; `divisor` is not 0. */
uint64_t divide(uint64_t value, uint64_t divisor, uint64_t *rest);
uint64_t divide(uint64_t value, uint64_t divisor, uint64_t *rest)
{
    if ((value | divisor) >> 32 == 0u) { /* one instruction */
        *rest = (uint32_t)value % (uint32_t)divisor;
        return (uint32_t)value / (uint32_t)divisor;
    }
    uint64_t quotient = 0;
    uint64_t left = 0;
    for (int bit = 63; bit >= 0; bit--) {
        const uint64_t carry = left >> 63;
        left = left << 1 | ((value >> bit) & 1u);
        if (carry != 0u || left >= divisor) {
            left -= divisor;
            quotient |= UINT64_C(1) << bit;
        }
    }
    *rest = left;
    return quotient;
}

/* Towards zero; the rest has the sign of `value`. */
int64_t divide_signed(int64_t value, int64_t divisor, int64_t *rest);
int64_t divide_signed(int64_t value, int64_t divisor, int64_t *rest)
{
    uint64_t left = 0;
    const uint64_t quotient = divide(value < 0 ? 0u - (uint64_t)value : (uint64_t)value,
                                     divisor < 0 ? 0u - (uint64_t)divisor : (uint64_t)divisor, &left);
    *rest = (int64_t)(value < 0 ? 0u - left : left);
    return (int64_t)((value < 0) != (divisor < 0) ? 0u - quotient : quotient);
}

/* Quotient in r0, r1 and rest in r2, r3: no C function returns that. */
#define DIVISION(name, function)                                                                                       \
    void name(void);                                                                                                   \
    __attribute__((naked)) void name(void)                                                                             \
    {                                                                                                                  \
        __asm__("push {r6, lr}\n sub sp, #16\n add r6, sp, #8\n str r6, [sp]\n bl " #function                          \
                "\n ldr r2, [sp, #8]\n ldr r3, [sp, #12]\n add sp, #16\n pop {r6, pc}");                               \
    }

DIVISION(__aeabi_uldivmod, divide)
DIVISION(__aeabi_ldivmod, divide_signed)

/* ---- between integers of 64 bits and floats ---------------------------------------------------------------------------- */

/* The run-time ABI passes floats in core registers even where everything else has them in those of the FPU. */
#define ABI __attribute__((pcs("aapcs")))

ABI double __aeabi_ul2d(uint64_t value);
ABI double __aeabi_ul2d(uint64_t value)
{
    return (double)(uint32_t)(value >> 32) * 0x1p32 + (double)(uint32_t)value; /* only the sum rounds */
}

ABI double __aeabi_l2d(int64_t value);
ABI double __aeabi_l2d(int64_t value)
{
    return (double)(int32_t)(value >> 32) * 0x1p32 + (double)(uint32_t)value;
}

/* By way of binary64, which must not round: bits that binary32 cannot see become one, which says that there were some. */
ABI float __aeabi_ul2f(uint64_t value);
ABI float __aeabi_ul2f(uint64_t value)
{
    if (value >> 53 != 0u) {
        value = (value & ~UINT64_C(0x7ff)) | ((value & 0x7ffu) != 0u ? 0x800u : 0u);
    }
    return (float)__aeabi_ul2d(value);
}

ABI float __aeabi_l2f(int64_t value);
ABI float __aeabi_l2f(int64_t value)
{
    return value < 0 ? -__aeabi_ul2f(0u - (uint64_t)value) : __aeabi_ul2f((uint64_t)value);
}

/* Towards zero; what does not fit has no meaning in C. */
ABI uint64_t __aeabi_d2ulz(double value);
ABI uint64_t __aeabi_d2ulz(double value)
{
    const uint32_t high = (uint32_t)(value * 0x1p-32);
    const uint32_t low = (uint32_t)(value - (double)high * 0x1p32);
    return (uint64_t)high << 32 | low;
}

ABI int64_t __aeabi_d2lz(double value);
ABI int64_t __aeabi_d2lz(double value)
{
    return value < 0.0 ? (int64_t)(0u - __aeabi_d2ulz(-value)) : (int64_t)__aeabi_d2ulz(value);
}

ABI uint64_t __aeabi_f2ulz(float value);
ABI uint64_t __aeabi_f2ulz(float value)
{
    return __aeabi_d2ulz((double)value);
}

ABI int64_t __aeabi_f2lz(float value);
ABI int64_t __aeabi_f2lz(float value)
{
    return __aeabi_d2lz((double)value);
}

/* ---- fmod: exact by definition ------------------------------------------------------------------------------------------ */

enum { MANTISSA = 52, EXPONENT_MAX = 0x7ff };

static uint64_t bits_of(double value)
{
    uint64_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* A positive number as mantissa * 2^(exponent - 1075); subnormals have exponent 1. */
static uint64_t mantissa_of(uint64_t bits, int *exponent)
{
    const int found = (int)(bits >> MANTISSA);
    const uint64_t mantissa = bits & ((UINT64_C(1) << MANTISSA) - 1u);
    *exponent = found == 0 ? 1 : found;
    return found == 0 ? mantissa : mantissa | UINT64_C(1) << MANTISSA;
}

static double rest_of(double x, double y)
{
    const uint64_t sign = bits_of(x) & UINT64_C(1) << 63;
    const uint64_t a = bits_of(x) & ~(UINT64_C(1) << 63);
    const uint64_t b = bits_of(y) & ~(UINT64_C(1) << 63);
    const uint64_t infinity = (uint64_t)EXPONENT_MAX << MANTISSA;
    if (a >= infinity || b > infinity || b == 0u) {
        return (x * y) / (x * y); /* a NaN */
    }
    if (a < b) {
        return x;
    }
    int exponent = 0;
    int last = 0;
    uint64_t rest = mantissa_of(a, &exponent);
    const uint64_t divisor = mantissa_of(b, &last);
    rest %= divisor;
    for (; exponent > last; exponent--) {
        rest <<= 1;
        rest -= rest >= divisor ? divisor : 0u;
    }
    while (rest != 0u && rest < UINT64_C(1) << MANTISSA && last > 1) {
        rest <<= 1;
        last--;
    }
    const int is_normal = rest >> MANTISSA != 0u;
    const uint64_t found = is_normal ? (rest & ((UINT64_C(1) << MANTISSA) - 1u)) | (uint64_t)last << MANTISSA : rest;
    double value = 0.0;
    const uint64_t bits = found | sign;
    memcpy(&value, &bits, sizeof value);
    return value;
}

double fmod(double x, double y)
{
    return rest_of(x, y);
}

float fmodf(float x, float y)
{
    return (float)rest_of((double)x, (double)y); /* the rest of two binary32 numbers is one */
}

/* ---- floating-point environment: rounding is to nearest, flags are not kept --------------------------------------------- */

int fegetround(void)
{
    return FE_TONEAREST;
}

int feraiseexcept(int flags)
{
    (void)flags;
    return 0;
}

int feclearexcept(int flags)
{
    (void)flags;
    return 0;
}

int fetestexcept(int flags)
{
    (void)flags;
    return 0;
}

int fegetexceptflag(fexcept_t *kept, int flags)
{
    *kept = 0;
    (void)flags;
    return 0;
}

int fesetexceptflag(const fexcept_t *kept, int flags)
{
    (void)kept;
    (void)flags;
    return 0;
}

int feholdexcept(fenv_t *kept)
{
    *kept = 0;
    return 0;
}

int feupdateenv(const fenv_t *kept)
{
    (void)kept;
    return 0;
}
