/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire of named values: each channel has a key of its own on the bus, so that other programs read and write them, too
 * (docs/reference/transports.md). What is sent as a message of channels goes as values, and a commit behind them; at the other end it is the same
 * message again.
 */
#ifndef FCSL_WIRE_NAMED_H
#define FCSL_WIRE_NAMED_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_wire.h"

extern const fcsl_wire_counters_t fcsl_wire_named_counters;

/* 0 when `address` has the form of zenoh:tcp:HOST:PORT, zenoh-client: or zenoh-peer:, or of one of these with ,free-running behind
 * it; or -1 with `error` filled. */
int fcsl_wire_check_named(const char *address, fcsl_error_t *error);

/* Whether such an address says ,free-running. Such a wire opens at once, and `receive` never waits: it makes one message of what
 * came since the last one. CLOSED says that the peer is gone; it may return. */
int fcsl_wire_runs_free(const char *address);

/* `address` is that of fcsl_hal_bus; it and `table` must outlive the wire. The simulator listens, trying nothing again; others try until
 * `deadline_ns`. Returns 0, or -1 with `error` filled. */
int fcsl_wire_open_named(const char *address, const char *name_space, const fcsl_channel_table_t *table,
                         fcsl_wire_side_t side, uint64_t deadline_ns, fcsl_wire_t *wire, fcsl_error_t *error);

#endif /* FCSL_WIRE_NAMED_H */
