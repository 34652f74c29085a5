/* SPDX-License-Identifier: Apache-2.0
 *
 * Ranges of parameters. Bounds are doubles for every type; a value is compared in its own type, where no digit is lost.
 */
#ifndef FCSL_RANGE_H
#define FCSL_RANGE_H

#include "fcsl/fcsl_machine.h"

/* Whether a finite bound is a value of the type; an infinite one bounds nothing. NaN is no bound. */
int fcsl_bound_fits(double bound, uint8_t type);
/* Whether `count` scalars of the field, little-endian, lie in its range. A NaN lies in no range, but in a field without. */
int fcsl_scalars_within(const uint8_t *bytes, const fcsl_field_t *field, uint32_t count);

#endif /* FCSL_RANGE_H */
