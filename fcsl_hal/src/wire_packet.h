/* SPDX-License-Identifier: Apache-2.0
 *
 * Control packets of the wire, and waiting with a deadline; shared by its two ends.
 *
 *   offset size
 *   0      4   magic "FCSW" (messages of channels begin with an id from 0xff00 on)
 *   4      2   version (1)
 *   6      1   kind
 *   7      1   zero
 *   8      4   channel-table hash    hello only, else zero
 *   12     8   tick_hz               hello only, else zero
 *   20     n   text, not terminated  refusal only, at most FCSL_WIRE_TEXT_MAX bytes
 */
#ifndef FCSL_WIRE_PACKET_H
#define FCSL_WIRE_PACKET_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_codec.h"

enum {
    FCSL_WIRE_HEADER_BYTES = 20,
    FCSL_WIRE_TEXT_MAX = 236,
    FCSL_WIRE_PACKET_MAX = FCSL_WIRE_HEADER_BYTES + FCSL_WIRE_TEXT_MAX,
};

typedef enum {
    FCSL_WIRE_HELLO = 1,
    FCSL_WIRE_REFUSAL = 2,
    FCSL_WIRE_END = 3, /* the run is over; nothing follows */
} fcsl_wire_kind_t;

typedef struct {
    fcsl_wire_kind_t kind;
    uint32_t table_hash;
    uint64_t tick_hz;
    char text[FCSL_WIRE_TEXT_MAX + 1];
} fcsl_wire_packet_t;

/* Returns 0, or -1 when the bytes are not a control packet of this version. */
int fcsl_wire_parse(const uint8_t *bytes, size_t size, fcsl_wire_packet_t *packet);

/* Each sends one packet without waiting; 0, or -1 with errno set. */
int fcsl_wire_send_hello(int fd, const fcsl_channel_table_t *table);
int fcsl_wire_send_refusal(int fd, const char *text);
int fcsl_wire_send_end(int fd);

/* Why the peer's hello does not fit: returns 1 and fills `text`, or 0 when it fits. */
int fcsl_wire_differs(const fcsl_wire_packet_t *hello, const fcsl_channel_table_t *table, char *text, size_t text_size);

/* Monotonic milliseconds. */
uint64_t fcsl_wire_now_ms(void);
/* Waits until `fd` is readable: 1, 0 at the deadline, -1 on a caught signal or an error (errno). */
int fcsl_wire_wait_readable(int fd, uint64_t deadline_ms);

/* Makes room for messages of `bytes` in the socket's send buffer; 0, or -1 when the system does not allow that much. */
int fcsl_wire_size_buffers(int fd, size_t bytes);

#endif /* FCSL_WIRE_PACKET_H */
