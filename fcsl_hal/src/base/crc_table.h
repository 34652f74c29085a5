/* SPDX-License-Identifier: Apache-2.0
 *
 * The 256 entries of a CRC's table, made by the compiler of 8 numbers. A CRC is linear: an entry is the sum (^) of the entries
 * of its bits.
 */
#ifndef FCSL_CRC_TABLE_H
#define FCSL_CRC_TABLE_H

/* `v` with every choice of a to h added, in order. */
#define FCSL_CRC_BITS1(v, a)                (v), (v) ^ (a)
#define FCSL_CRC_BITS2(v, a, b)             FCSL_CRC_BITS1(v, a), FCSL_CRC_BITS1((v) ^ (b), a)
#define FCSL_CRC_BITS3(v, a, b, c)          FCSL_CRC_BITS2(v, a, b), FCSL_CRC_BITS2((v) ^ (c), a, b)
#define FCSL_CRC_BITS4(v, a, b, c, d)       FCSL_CRC_BITS3(v, a, b, c), FCSL_CRC_BITS3((v) ^ (d), a, b, c)
#define FCSL_CRC_BITS5(v, a, b, c, d, e)    FCSL_CRC_BITS4(v, a, b, c, d), FCSL_CRC_BITS4((v) ^ (e), a, b, c, d)
#define FCSL_CRC_BITS6(v, a, b, c, d, e, f) FCSL_CRC_BITS5(v, a, b, c, d, e), FCSL_CRC_BITS5((v) ^ (f), a, b, c, d, e)
#define FCSL_CRC_BITS7(v, a, b, c, d, e, f, g)                                                                         \
    FCSL_CRC_BITS6(v, a, b, c, d, e, f), FCSL_CRC_BITS6((v) ^ (g), a, b, c, d, e, f)
/* The entries of a table whose entries 1, 2, 4, … 128 are a to h. */
#define FCSL_CRC_TABLE(a, b, c, d, e, f, g, h)                                                                         \
    FCSL_CRC_BITS7(0u, a, b, c, d, e, f, g), FCSL_CRC_BITS7(0u ^ (h), a, b, c, d, e, f, g)

#endif /* FCSL_CRC_TABLE_H */
