/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_WIRE_LINK_H
#define FCSL_WIRE_LINK_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_wire.h"
#include "line.h"

extern const fcsl_wire_counters_t fcsl_wire_link_counters;

/* A wire of messages of up to `message_max` bytes over a reliable port of a link on this line, which it owns from here on, also
 * when it fails. 0, or -1 with `error` filled. */
int fcsl_wire_over_link(const line_t *line, fcsl_wire_side_t side, size_t message_max, fcsl_wire_t *wire,
                        fcsl_error_t *error);

#endif /* FCSL_WIRE_LINK_H */
