/* SPDX-License-Identifier: Apache-2.0
 *
 * Included before each CORE-MATH source. Where the proof of a rounding test would be wrong, pow prints a report and ends
 * the process. A flight program does neither: there the function returns NaN, which shows and can be handled.
 */
#include <stdio.h>
#include <stdlib.h>

#define printf(...) ((void)0)
#define exit(code)  return __builtin_nan("")
