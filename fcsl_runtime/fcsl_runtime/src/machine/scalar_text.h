/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars as text, as users write them. The readers return null, or what is wrong; `bytes` are native.
 */
#ifndef FCSL_SCALAR_TEXT_H
#define FCSL_SCALAR_TEXT_H

#include <stddef.h>

#include "fcsl/fcsl_machine.h"

enum { SCALAR_TEXT_BYTES = 64 };

/* The number in `text` (digits, point, exponent: checked by the caller) as FCSL_F32 or FCSL_F64. */
const char *fcsl_float_from_text(const char *text, uint8_t type, uint8_t *bytes);
/* The same as FCSL_I32 to FCSL_U64. */
const char *fcsl_integer_from_text(const char *text, uint8_t type, uint8_t *bytes);
/* A health by its name; a request as it is read back ("tr_GO"), or else as algorithms write it ("GO"), or "" for none. */
const char *fcsl_enumerator_from_text(const fcsl_machine_t *machine, const char *text, uint8_t type, uint8_t *bytes);

/* The fewest digits that tell a float from all others of its type. */
void fcsl_float_text(double value, uint8_t type, char text[SCALAR_TEXT_BYTES]);

#endif /* FCSL_SCALAR_TEXT_H */
