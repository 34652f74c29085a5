/* SPDX-License-Identifier: Apache-2.0
 *
 * Frames of the link layer as bytes.
 */
#include "link_frame.h"

enum { SHORT_HEADER = 6, LONG_HEADER = FCSL_LINK_HEADER_MAX };

size_t fcsl_link_header_bytes(fcsl_link_kind_t kind)
{
    return kind == FCSL_LINK_FRAME_LATEST || kind == FCSL_LINK_FRAME_SEQUENCED ? SHORT_HEADER : LONG_HEADER;
}

static void put_u16(uint8_t *bytes, uint16_t value)
{
    bytes[0] = (uint8_t)value;
    bytes[1] = (uint8_t)(value >> 8);
}

static uint16_t get_u16(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] | bytes[1] << 8);
}

size_t fcsl_link_frame_end(uint8_t frame[FCSL_LINK_FRAME_MAX], const fcsl_link_header_t *header, size_t size)
{
    const size_t begin = fcsl_link_header_bytes(header->kind);
    frame[0] = (uint8_t)(FCSL_LINK_VERSION << 4 | (unsigned)header->kind);
    frame[1] = (uint8_t)((unsigned)header->flags << 4 | header->port);
    put_u16(frame + 2, header->session);
    put_u16(frame + 4, header->sequence);
    if (begin == LONG_HEADER) {
        put_u16(frame + 6, header->to);
        put_u16(frame + 8, header->acknowledge);
    }
    put_u16(frame + begin + size, fcsl_crc16(0xFFFFu, frame, begin + size));
    return begin + size + FCSL_LINK_CRC_BYTES;
}

static int flags_fit(const fcsl_link_header_t *header)
{
    switch (header->kind) {
    case FCSL_LINK_HELLO:
        return (header->flags & ~FCSL_LINK_CONNECTED) == 0 && header->port == 0;
    case FCSL_LINK_DATA:
        return (header->flags & ~(FCSL_LINK_FIRST | FCSL_LINK_LAST)) == 0;
    default:
        return header->flags == 0;
    }
}

fcsl_link_frame_status_t fcsl_link_frame_read(const uint8_t *frame, size_t size, fcsl_link_header_t *header,
                                              const uint8_t **payload, size_t *payload_size)
{
    if (size < SHORT_HEADER + FCSL_LINK_CRC_BYTES || size > FCSL_LINK_FRAME_MAX) {
        return FCSL_LINK_FRAME_MALFORMED;
    }
    if (fcsl_crc16(0xFFFFu, frame, size - FCSL_LINK_CRC_BYTES) != get_u16(frame + size - FCSL_LINK_CRC_BYTES)) {
        return FCSL_LINK_FRAME_WRONG_CRC;
    }
    if (frame[0] >> 4 != FCSL_LINK_VERSION) {
        return FCSL_LINK_FRAME_OTHER_VERSION;
    }
    const unsigned kind = frame[0] & 15u;
    if (kind >= FCSL_LINK_KINDS) {
        return FCSL_LINK_FRAME_MALFORMED;
    }
    const size_t begin = fcsl_link_header_bytes((fcsl_link_kind_t)kind);
    if (size < begin + FCSL_LINK_CRC_BYTES) {
        return FCSL_LINK_FRAME_MALFORMED;
    }
    *header = (fcsl_link_header_t){
        .kind = (fcsl_link_kind_t)kind,
        .flags = frame[1] >> 4,
        .port = frame[1] & 15u,
        .session = get_u16(frame + 2),
        .sequence = get_u16(frame + 4),
    };
    if (begin == LONG_HEADER) {
        header->to = get_u16(frame + 6);
        header->acknowledge = get_u16(frame + 8);
    }
    *payload = frame + begin;
    *payload_size = size - begin - FCSL_LINK_CRC_BYTES;
    const int has_payload = kind != FCSL_LINK_HELLO && kind != FCSL_LINK_ACKNOWLEDGEMENT;
    return header->session != 0 && *payload_size <= FCSL_LINK_PAYLOAD_MAX && flags_fit(header) &&
                   (has_payload || *payload_size == 0)
               ? FCSL_LINK_FRAME_OK
               : FCSL_LINK_FRAME_MALFORMED;
}
