/* SPDX-License-Identifier: Apache-2.0
 *
 * Control packets: with them two peers of a wire meet, refuse each other and part (docs/reference/transports.md).
 *
 *   offset size
 *   0      4   magic "FCSW" (messages of channels begin with an id from 0xff00 on)
 *   4      2   version (1)
 *   6      1   kind
 *   7      1   hello: 1 when the sender is a simulator that sends the time, or a controller that runs free; end: 1 when another run
 *              follows; else zero
 *   8      4   hello: channel-table hash; end: 1 when the sender is a controller; else zero
 *   12     8   tick_hz               hello only, else zero
 *   20     n   text, not terminated  refusal only, at most HANDSHAKE_TEXT_MAX bytes
 */
#ifndef FCSL_HANDSHAKE_H
#define FCSL_HANDSHAKE_H

#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_wire.h"

enum {
    HANDSHAKE_HEADER_BYTES = 20,
    HANDSHAKE_TEXT_MAX = 236,
    HANDSHAKE_PACKET_MAX = HANDSHAKE_HEADER_BYTES + HANDSHAKE_TEXT_MAX,
    HANDSHAKE_LEAVES = 1, /* in place of the hash, in an end: it is a controller that ends its run */
};

/* How often a party that pauses says that it is alive. */
#define HANDSHAKE_KEEP_ALIVE_NS 500000000u

typedef enum {
    HANDSHAKE_HELLO = 1,
    HANDSHAKE_REFUSAL = 2,
    HANDSHAKE_END = 3,   /* the run is over */
    HANDSHAKE_KEEP_ALIVE = 4, /* the sender pauses: whoever waits for it shall wait on */
} handshake_kind_t;

typedef struct {
    handshake_kind_t kind;
    int flag; /* the byte at offset 7 */
    uint32_t table_hash;
    uint64_t tick_hz;
    char text[HANDSHAKE_TEXT_MAX + 1];
} handshake_packet_t;

/* Whether the bytes are a control packet of this version: of an input of the bus, which gives it no `what`. */
int handshake_fits(uint64_t what, const uint8_t *bytes, size_t size);

/* Returns 0, or -1 when the bytes are not a control packet of this version. */
int handshake_parse(const uint8_t *bytes, size_t size, handshake_packet_t *packet);

/* Each sends one packet without waiting. */
fcsl_wire_status_t handshake_send_hello(const fcsl_wire_t *wire, const fcsl_channel_table_t *table, int flag);
fcsl_wire_status_t handshake_send_refusal(const fcsl_wire_t *wire, const char *text);
/* A simulator's, and a controller's: on the bus they share a key with other controllers, who pass over the latter. */
fcsl_wire_status_t handshake_send_end(const fcsl_wire_t *wire, int another_follows);
fcsl_wire_status_t handshake_send_leave(const fcsl_wire_t *wire);
fcsl_wire_status_t handshake_send_keep_alive(const fcsl_wire_t *wire);

static inline int handshake_is_leave(const handshake_packet_t *packet)
{
    return packet->kind == HANDSHAKE_END && packet->table_hash == HANDSHAKE_LEAVES;
}

/* Why the peer's hello does not fit: returns 1 and fills `text`, or 0 when it fits. */
int handshake_differs(const handshake_packet_t *hello, const fcsl_channel_table_t *table, char *text, size_t text_size);

#endif /* FCSL_HANDSHAKE_H */
