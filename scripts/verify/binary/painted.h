/* SPDX-License-Identifier: Apache-2.0
 *
 * A stack of our own, painted, on which a function is called: what it wrote tells how deep it went. x86-64, System V ABI.
 */
#ifndef FCSL_VERIFY_PAINTED_H
#define FCSL_VERIFY_PAINTED_H

#include <stddef.h>
#include <stdint.h>

/* Paints the stack anew. */
void painted_begin(void);

/* Calls `function` with its integer and pointer arguments in `integers` and its floating arguments in `reals` (for floats:
 * in the low bits); returns what it returns as an integer. Arguments that it does not take do no harm. */
uint64_t painted_call(const void *function, const uint64_t integers[4], const double reals[3]);

/* Bytes between the top of the stack and the deepest one written since painted_begin, return address included; SIZE_MAX
 * where all of it was written. */
size_t painted_used(void);

#endif /* FCSL_VERIFY_PAINTED_H */
