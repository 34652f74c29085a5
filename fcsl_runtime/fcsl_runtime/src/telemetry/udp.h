/* SPDX-License-Identifier: Apache-2.0
 *
 * The way to the receiver: a connected socket that never waits.
 */
#ifndef FCSL_TELEMETRY_UDP_H
#define FCSL_TELEMETRY_UDP_H

#include <stdatomic.h>
#include <sys/socket.h>

#include "datagram.h"
#include "fcsl/fcsl_run.h"

typedef struct {
    int fd;
    int connected;
    struct sockaddr_storage address;
    socklen_t length;
    uint32_t every; /* of the address: a packet of every so many ticks */
    _Atomic uint64_t datagrams;
    _Atomic uint64_t failures;
} udp_t;

/* Reads udp:HOST:PORT[/EVERY] and connects. A network that is not there yet is none of its failures. 0, or -1. */
int fcsl_udp_open(udp_t *udp, const char *address, fcsl_error_t *error);
void fcsl_udp_close(udp_t *udp);

/* Sends the packet's datagrams from `offset` on, `most` of them at most. What the system does not take is counted and left.
 * Returns where the rest begins; packet->total when there is none. */
uint32_t fcsl_udp_send(udp_t *udp, const packet_t *packet, uint32_t offset, uint32_t most);

#endif /* FCSL_TELEMETRY_UDP_H */
