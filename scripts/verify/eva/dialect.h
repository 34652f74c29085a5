/* SPDX-License-Identifier: Apache-2.0
 *
 * What Frama-C does not know of C11 and gcc, in words that it does. Every file that it analyses includes this first.
 */
#ifndef EVA_DIALECT_H
#define EVA_DIALECT_H

#include <stdint.h>

#define _Alignof(type)      __alignof__(type)
#define _Static_assert(...) struct eva_asserted /* the C compiler has checked it */

/* Constants, which may stand in a table. */
#define __builtin_inf()     (1.0 / 0.0)
#define __builtin_inff()    (1.0f / 0.0f)
#define __builtin_nan(tag)  (0.0 / 0.0)
#define __builtin_nanf(tag) (0.0f / 0.0f)

/* The overflow builtins: where they say that nothing overflowed, the result is exact; where they say that it did, it may be
 * anything. For unsigned types it may be anything in both cases. Written so that the two cases stay apart in an `if`. */
extern volatile uint8_t eva_any_u8;
/*@ assigns ((char *)result)[0 .. size - 1] \from size;
    ensures \initialized((char *)result + (0 .. size - 1)); */
void eva_store_any(void *result, unsigned long size);
/*@ assigns ((char *)result)[0 .. size - 1] \from a, b, size, is_signed;
    ensures \initialized((char *)result + (0 .. size - 1));
    ensures is_signed == 1 && size == 4 ==> *(int32_t *)result == a + b;
    ensures is_signed == 1 && size == 8 ==> *(int64_t *)result == a + b; */
void eva_store_add(void *result, unsigned long size, int is_signed, int64_t a, int64_t b);
/*@ assigns ((char *)result)[0 .. size - 1] \from a, b, size, is_signed;
    ensures \initialized((char *)result + (0 .. size - 1));
    ensures is_signed == 1 && size == 4 ==> *(int32_t *)result == a - b;
    ensures is_signed == 1 && size == 8 ==> *(int64_t *)result == a - b; */
void eva_store_sub(void *result, unsigned long size, int is_signed, int64_t a, int64_t b);
/*@ assigns ((char *)result)[0 .. size - 1] \from a, b, size, is_signed;
    ensures \initialized((char *)result + (0 .. size - 1));
    ensures is_signed == 1 && size == 4 ==> *(int32_t *)result == a * b;
    ensures is_signed == 1 && size == 8 ==> *(int64_t *)result == a * b; */
void eva_store_mul(void *result, unsigned long size, int is_signed, int64_t a, int64_t b);

/* Of 32 bits it is known exactly: where 64 show that the result fits, nothing overflows. */
#define EVA_FITS_32(a, op, b, result)                                                                                  \
    (sizeof *(result) == 4u && (__typeof__(*(result)))-1 < 0 && (int64_t)(a)op(int64_t)(b) >= INT32_MIN &&             \
     (int64_t)(a)op(int64_t)(b) <= INT32_MAX)
#define EVA_OVERFLOW(store, a, op, b, result)                                                                          \
    ((eva_any_u8 != 0u && !EVA_FITS_32(a, op, b, result) && (eva_store_any((result), sizeof *(result)), 1)) ||         \
     (store((result), sizeof *(result), (__typeof__(*(result)))-1 < 0, (int64_t)(a), (int64_t)(b)), 0))
#define __builtin_add_overflow(a, b, result) EVA_OVERFLOW(eva_store_add, a, +, b, result)
#define __builtin_sub_overflow(a, b, result) EVA_OVERFLOW(eva_store_sub, a, -, b, result)
#define __builtin_mul_overflow(a, b, result) EVA_OVERFLOW(eva_store_mul, a, *, b, result)

#endif /* EVA_DIALECT_H */
