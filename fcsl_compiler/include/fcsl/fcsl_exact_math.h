/* SPDX-License-Identifier: Apache-2.0
 *
 * Refuses compilers that are told to change results: machines and models have the same bits everywhere.
 */
#ifndef FCSL_EXACT_MATH_H
#define FCSL_EXACT_MATH_H

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ != 0) ||                          \
    defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "the options of this compiler change results (-ffast-math or a part of it, -Ofast): remove them"
#endif
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0
#error                                                                                                                 \
    "this compiler computes in another precision than that of the type (-mfpmath=387, -m32): choose SSE2 or another target"
#endif

#endif /* FCSL_EXACT_MATH_H */
