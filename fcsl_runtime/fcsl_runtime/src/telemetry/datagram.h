/* SPDX-License-Identifier: Apache-2.0
 *
 * Packets cut into datagrams (docs/guide/monitoring.md, "A datagram").
 */
#ifndef FCSL_TELEMETRY_DATAGRAM_H
#define FCSL_TELEMETRY_DATAGRAM_H

#include <stddef.h>
#include <stdint.h>

enum {
    HEADER_BYTES = 40,
    STRIDE_BYTES =
        1360, /* with all headers of IPv6 below the 1500 bytes of an Ethernet frame, and room for a tunnel's */
    DATAGRAM_BYTES = HEADER_BYTES + STRIDE_BYTES,
    BODY_BYTES_MAX = 16 << 20
};

typedef enum { PACKET_CONFIGURATION = 1, PACKET_DATA = 2 } packet_kind_t;

typedef struct {
    packet_kind_t kind;
    uint32_t configuration; /* CRC-32 of the configuration's body */
    uint64_t session;
    uint64_t sequence;
    const uint8_t *body;
    uint32_t total; /* bytes of the body */
} packet_t;

/* Writes the datagram with the bytes of the body from `offset`, a multiple of STRIDE_BYTES, on. Returns its bytes. */
size_t fcsl_datagram_write(const packet_t *packet, uint32_t offset, uint8_t datagram[DATAGRAM_BYTES]);

#endif /* FCSL_TELEMETRY_DATAGRAM_H */
