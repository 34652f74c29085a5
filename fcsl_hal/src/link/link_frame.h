/* SPDX-License-Identifier: Apache-2.0
 *
 * One frame of the link layer: its header, and the bytes that it is written to and read from.
 */
#ifndef FCSL_LINK_FRAME_H
#define FCSL_LINK_FRAME_H

#include "fcsl/fcsl_link.h"

typedef enum {
    FCSL_LINK_HELLO = 0,
    FCSL_LINK_FRAME_LATEST = 1,
    FCSL_LINK_FRAME_SEQUENCED = 2,
    FCSL_LINK_DATA = 3,
    FCSL_LINK_ACKNOWLEDGEMENT = 4,
    FCSL_LINK_KINDS = 5
} fcsl_link_kind_t;

enum { FCSL_LINK_FIRST = 1, FCSL_LINK_LAST = 2, FCSL_LINK_CONNECTED = 4 };

typedef struct {
    fcsl_link_kind_t kind;
    uint8_t flags;
    uint8_t port;
    uint16_t session;
    uint16_t sequence;
    uint16_t to;          /* these two: not in latest and sequenced frames */
    uint16_t acknowledge;
} fcsl_link_header_t;

typedef enum {
    FCSL_LINK_FRAME_OK,
    FCSL_LINK_FRAME_MALFORMED,
    FCSL_LINK_FRAME_WRONG_CRC,
    FCSL_LINK_FRAME_OTHER_VERSION
} fcsl_link_frame_status_t;

/* Bytes of the header of a kind. */
size_t fcsl_link_header_bytes(fcsl_link_kind_t kind);
/* Writes the header, and the CRC behind a payload of `size` bytes that is in its place already; returns the frame's size. */
size_t fcsl_link_frame_end(uint8_t frame[FCSL_LINK_FRAME_MAX], const fcsl_link_header_t *header, size_t size);
/* Checks a frame as far as it needs no state. Sets *payload to its bytes and *payload_size to their number. */
fcsl_link_frame_status_t fcsl_link_frame_read(const uint8_t *frame, size_t size, fcsl_link_header_t *header,
                                              const uint8_t **payload, size_t *payload_size);

#endif /* FCSL_LINK_FRAME_H */
