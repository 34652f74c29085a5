/* SPDX-License-Identifier: Apache-2.0
 *
 * Where an instance faulted last, as text.
 */
#ifndef FCSL_FAULT_PLACE_H
#define FCSL_FAULT_PLACE_H

#include <stddef.h>

#include "fcsl/fcsl_machine.h"

/* Holds every text: a validated descriptor has files of at most 1023 bytes, and causes of 255. */
enum { FCSL_FAULT_TEXT_MAX = 1536 };

/* Bytes of the longest text of this machine, its end included. */
size_t fcsl_fault_text_bytes(const fcsl_machine_t *machine);

/* Writes "algorithms/pilot.py:18:22: the divisor is zero", the cause alone for a fault without a file, or "" where the instance
 * has not faulted in `data`, a machine struct. Returns `text`. */
const char *fcsl_fault_text(const fcsl_machine_t *machine, const uint8_t *data, uint32_t instance,
                            char text[FCSL_FAULT_TEXT_MAX]);

#endif /* FCSL_FAULT_PLACE_H */
