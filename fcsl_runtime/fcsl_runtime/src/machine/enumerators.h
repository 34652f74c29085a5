/* SPDX-License-Identifier: Apache-2.0
 *
 * Names of states, healths and requests.
 */
#ifndef FCSL_ENUMERATORS_H
#define FCSL_ENUMERATORS_H

#include <stddef.h>

#include "fcsl/fcsl_machine.h"

/* Name of an enumerator of the type ("tr_GO", "nominal", "IDLE"), in `text` if it has to be made. */
const char *fcsl_enumerator_name(const fcsl_machine_t *machine, uint8_t type, int32_t value, char *text, size_t size);
/* The enumerator whose name is the first `length` bytes of `name`, or FCSL_NONE. */
int32_t fcsl_enumerator_find(const fcsl_machine_t *machine, uint8_t type, const char *name, size_t length);

#endif /* FCSL_ENUMERATORS_H */
