/* SPDX-License-Identifier: Apache-2.0
 *
 * Meeting the other end of a wire over the bus, and noticing that it is gone.
 */
#define _GNU_SOURCE
#include "bus_peer.h"

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"

int bus_peer_lives(const bus_peer_t *peer)
{
    return fcsl_bus_token_count(peer->bus, peer->side == FCSL_WIRE_LISTEN ? BUS_CONTROLLERS : BUS_SIMULATORS) > 0;
}

/* What is sent now reaches the peer. */
static int listens(const bus_peer_t *peer)
{
    int matched = bus_peer_lives(peer);
    for (uint32_t i = 0; i < peer->output_count; i++) {
        matched = matched && fcsl_bus_matched(peer->bus, i);
    }
    return matched;
}

int bus_peer_meet(bus_peer_t *peer)
{
    peer->met = peer->met || listens(peer);
    return peer->met;
}

fcsl_wire_status_t bus_peer_disconnected(bus_peer_t *peer)
{
    if (!peer->met) {
        return FCSL_WIRE_NONE;
    }
    peer->met = peer->side == FCSL_WIRE_CONNECT; /* who listens waits for the next one */
    return FCSL_WIRE_CLOSED;
}

fcsl_wire_status_t bus_peer_receive(const bus_peer_t *peer, bus_take_t take, void *ctx, uint64_t deadline_ns,
                                    uint8_t *message, size_t capacity, size_t *size)
{
    for (;;) { /* ends at the deadline, whatever arrives */
        const fcsl_wire_status_t status = take(ctx, message, capacity, size);
        if (status != FCSL_WIRE_NONE || fcsl_monotonic_ns() >= deadline_ns) {
            return status;
        }
        if (!fcsl_bus_wait(peer->bus, deadline_ns) && fcsl_monotonic_ns() < deadline_ns) {
            return FCSL_WIRE_NONE; /* a signal */
        }
    }
}

int bus_peer_wait(bus_peer_t *peer, const char *endpoint, uint64_t deadline_ns, fcsl_error_t *error)
{
    while (fcsl_monotonic_ns() < deadline_ns) {
        if (listens(peer) && fcsl_bus_token_count(peer->bus, BUS_CONTROLLERS) == 0) {
            peer->met = 1;
            return 0;
        }
        (void)fcsl_bus_wait(peer->bus, deadline_ns);
    }
    if (bus_peer_lives(peer) && fcsl_bus_token_count(peer->bus, BUS_CONTROLLERS) > 0) {
        (void)fcsl_fail(error, "the simulator on %s has another controller", endpoint);
    } else {
        (void)fcsl_fail(error, "no simulator of this machine is on %s", endpoint);
    }
    return -1;
}
