/* SPDX-License-Identifier: Apache-2.0
 *
 * The other end of a wire over the bus: a simulator has at most one controller, and each knows by the other's token whether it
 * lives.
 */
#ifndef FCSL_BUS_PEER_H
#define FCSL_BUS_PEER_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_wire.h"

/* What an end watches, in this order. A controller looks for others before it looks for the simulator. */
enum { BUS_CONTROLLERS = 0, BUS_SIMULATORS = 1 };

typedef struct {
    fcsl_bus_t *bus;
    fcsl_wire_side_t side;
    uint32_t output_count; /* of the session's first outputs, as many as the peer must hear */
    int met; /* the peer has been there */
} bus_peer_t;

/* How many of those that this side watches there are. */
static inline uint32_t bus_peer_watched(fcsl_wire_side_t side)
{
    return side == FCSL_WIRE_LISTEN ? 1u : 2u;
}

int bus_peer_lives(const bus_peer_t *peer);

/* Looks for the peer. A message counts only from a peer that was met. */
int bus_peer_meet(bus_peer_t *peer);

/* What to say when nothing came, and the peer did not live before that was looked at: CLOSED once, to who listens. */
fcsl_wire_status_t bus_peer_disconnected(bus_peer_t *peer);

/* Takes the next message, if there is one, as a wire's receive does. */
typedef fcsl_wire_status_t (*bus_take_t)(void *ctx, uint8_t *message, size_t capacity, size_t *size);

/* A wire's receive: takes until there is something to say, the deadline, or a signal. */
fcsl_wire_status_t bus_peer_receive(const bus_peer_t *peer, bus_take_t take, void *ctx, uint64_t deadline_ns,
                                    uint8_t *message, size_t capacity, size_t *size);

/* The session connects to whoever listens there: is it a simulator, and has it no other controller? Returns 0, or -1 with `error`
 * filled. */
int bus_peer_wait(bus_peer_t *peer, const char *endpoint, uint64_t deadline_ns, fcsl_error_t *error);

#endif /* FCSL_BUS_PEER_H */
