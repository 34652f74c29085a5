/* SPDX-License-Identifier: Apache-2.0
 *
 * Included before each CORE-MATH source. Where the proof of a rounding test would be wrong, pow prints a report and ends
 * the process. A flight program does neither: there the function returns NaN, which shows and can be handled.
 *
 * tan of a float's infinity is a NaN that carries a text: libm would read the text at run time, by way of functions that it
 * looks up then and there, on 3 KiB of stack. Ours carries none, and is a constant.
 */
#include <stdio.h>
#include <stdlib.h>

#define printf(...)          ((void)0)
#define exit(code)           return __builtin_nan("")
#define __builtin_nanf(text) __builtin_nanf("")
