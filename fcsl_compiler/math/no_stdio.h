/* SPDX-License-Identifier: Apache-2.0
 *
 * Included before each CORE-MATH source. If the proof of a rounding test is wrong, pow prints a report and ends the
 * process. A flight program must not do this: here the function returns NaN, which can be detected and handled.
 *
 * tanf of an infinity returns a NaN made from a text. libm parses this text at run time with functions that it looks up
 * dynamically, on 3 KiB of stack. The definition below makes the NaN a constant.
 */
#include <stdio.h>
#include <stdlib.h>

#define printf(...)          ((void)0)
#define exit(code)           return __builtin_nan("")
#define __builtin_nanf(text) __builtin_nanf("")
