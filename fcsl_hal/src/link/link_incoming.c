/* SPDX-License-Identifier: Apache-2.0
 *
 * The receiving half of a port: messages that wait for the host, and for reliable ports the receiver of go-back-N.
 */
#include "link_bytes.h"
#include "link_port.h"

_Static_assert(FCSL_LINK_PAYLOAD_MAX + FCSL_LINK_SIZE_BYTES <= FCSL_LINK_BUFFER,
               "a frame's message fits an empty port");

/* The size of a message precedes it in the ring, in the order of this processor's bytes. */
static void put_size(fcsl_link_bytes_t *ring, uint32_t offset, uint32_t size)
{
    uint8_t bytes[FCSL_LINK_SIZE_BYTES];
    memcpy(bytes, &size, sizeof bytes);
    fcsl_link_bytes_write(ring, offset, bytes, sizeof bytes);
}

fcsl_link_status_t fcsl_link_incoming_get(fcsl_link_port_t *port, uint8_t *message, size_t capacity, size_t *size)
{
    fcsl_link_incoming_t *in = &port->in;
    *size = 0;
    if (in->whole == 0) {
        return FCSL_LINK_EMPTY;
    }
    uint8_t bytes[FCSL_LINK_SIZE_BYTES];
    uint32_t held = 0;
    fcsl_link_bytes_read(&in->bytes, 0, bytes, sizeof bytes);
    memcpy(&held, bytes, sizeof held);
    *size = held;
    if (held > capacity) {
        return FCSL_LINK_TOO_LARGE;
    }
    fcsl_link_bytes_read(&in->bytes, FCSL_LINK_SIZE_BYTES, message, held);
    fcsl_link_bytes_pop(&in->bytes, FCSL_LINK_SIZE_BYTES + held);
    in->whole -= FCSL_LINK_SIZE_BYTES + held;
    return FCSL_LINK_OK;
}

/* Whether a latest or sequenced frame is news; counts what it skips. */
static int is_new(fcsl_link_port_t *port, const fcsl_link_header_t *header)
{
    fcsl_link_incoming_t *in = &port->in;
    if (in->session == header->session) {
        const uint16_t ahead = (uint16_t)(header->sequence - in->sequence);
        if (ahead == 0 || ahead > UINT16_MAX - (FCSL_LINK_LATE - 1)) {
            port->counters.late++;
            return 0;
        }
        port->counters.lost += ahead - 1u;
    }
    in->session = header->session;
    in->sequence = header->sequence;
    return 1;
}

void fcsl_link_incoming_message(fcsl_link_port_t *port, const fcsl_link_header_t *header, const uint8_t *payload,
                                uint32_t size)
{
    fcsl_link_incoming_t *in = &port->in;
    if (!is_new(port, header)) {
        return;
    }
    if (port->policy == FCSL_LINK_LATEST && in->whole > 0) {
        port->counters.replaced++;
        in->bytes.size = 0;
        in->whole = 0;
    }
    if (size + FCSL_LINK_SIZE_BYTES > fcsl_link_bytes_room(&in->bytes)) {
        port->counters.no_room++;
        return;
    }
    put_size(&in->bytes, in->bytes.size, size);
    in->bytes.size += FCSL_LINK_SIZE_BYTES;
    fcsl_link_bytes_append(&in->bytes, payload, size);
    in->whole = in->bytes.size;
    port->counters.received++;
}

/* Gives up the message of which there is a part: its other fragments are left out. */
static void skip(fcsl_link_incoming_t *in)
{
    in->bytes.size = in->whole;
    in->skipping = 1;
}

/* Adds the fragment that was expected. Returns 0; 1 when there is no room until the host has read; -1 when it follows none. */
static int add(fcsl_link_port_t *port, uint8_t flags, const uint8_t *payload, uint32_t size)
{
    fcsl_link_incoming_t *in = &port->in;
    const int first = (flags & FCSL_LINK_FIRST) != 0;
    const uint32_t prefix = first ? FCSL_LINK_SIZE_BYTES : 0u;
    const int begun = in->bytes.size > in->whole;
    int status = 0;
    if (first == (begun || in->skipping)) {
        skip(in);
        status = -1;
    }
    if (!in->skipping && size + prefix > fcsl_link_bytes_room(&in->bytes)) {
        if (in->whole > 0) {
            return 1;
        }
        skip(in);
        port->counters.too_large++;
    }
    if (!in->skipping) {
        in->bytes.size += prefix;
        fcsl_link_bytes_append(&in->bytes, payload, size);
    }
    return status;
}

/* The message is complete. */
static void finish(fcsl_link_port_t *port)
{
    fcsl_link_incoming_t *in = &port->in;
    if (!in->skipping) {
        put_size(&in->bytes, in->whole, in->bytes.size - in->whole - FCSL_LINK_SIZE_BYTES);
        in->whole = in->bytes.size;
        port->counters.received++;
    }
    in->skipping = 0;
}

int fcsl_link_incoming_data(fcsl_link_port_t *port, const fcsl_link_header_t *header, const uint8_t *payload,
                            uint32_t size)
{
    fcsl_link_incoming_t *in = &port->in;
    in->answer = in->answer == FCSL_LINK_ANSWER_NONE ? FCSL_LINK_ANSWER_SOON : in->answer;
    if (header->sequence != in->sequence) {
        port->counters.late++;
        return 0;
    }
    const int status = add(port, header->flags, payload, size);
    if (status == 1) {
        port->counters.no_room++;
        return 0;
    }
    if ((header->flags & FCSL_LINK_LAST) != 0) {
        finish(port);
    }
    in->sequence++;
    return status;
}

void fcsl_link_incoming_restart(fcsl_link_port_t *port)
{
    fcsl_link_incoming_t *in = &port->in;
    in->bytes.size = in->whole;
    in->sequence = 0;
    in->skipping = 0;
    in->answer = FCSL_LINK_ANSWER_NONE;
}
