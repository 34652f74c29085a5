/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_VALIDATE_H
#define FCSL_VALIDATE_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_machine.h"

/* Checks everything in a descriptor that a host relies on: indices and offsets in range, sizes that add up, names that are
 * there. Returns 0, or -1 naming what is wrong. */
int fcsl_validate(const fcsl_machine_t *machine, fcsl_error_t *error);

#endif /* FCSL_VALIDATE_H */
