/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_WIRE_ZENOH_H
#define FCSL_WIRE_ZENOH_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_wire.h"

extern const fcsl_wire_counters_t fcsl_wire_zenoh_counters;

/* Listens on `endpoint` (tcp:HOST:PORT), or connects, trying again until `deadline_ns`. 0, or -1 with `error` filled. */
int fcsl_wire_open_zenoh(const char *endpoint, fcsl_wire_side_t side, size_t message_max, uint64_t deadline_ns,
                         fcsl_wire_t *wire, fcsl_error_t *error);

#endif /* FCSL_WIRE_ZENOH_H */
