/* SPDX-License-Identifier: Apache-2.0
 *
 * The sending half of a port: messages as frames that wait, and for reliable ports the sender of go-back-N.
 */
#include "link_bytes.h"
#include "link_port.h"

static uint32_t min_u32(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* The first `count` frames are done with. */
static void pop(fcsl_link_outgoing_t *out, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        fcsl_link_bytes_pop(&out->bytes, out->frames[(out->first + i) % FCSL_LINK_QUEUE].size);
    }
    out->first = (out->first + count) % FCSL_LINK_QUEUE;
    out->count -= count;
    out->due -= min_u32(out->due, count);
    out->sequence = (uint16_t)(out->sequence + count);
}

static void append(fcsl_link_outgoing_t *out, const uint8_t *message, size_t size, uint32_t frames)
{
    for (uint32_t i = 0; i < frames; i++) {
        const size_t at = (size_t)i * FCSL_LINK_PAYLOAD_MAX;
        const uint32_t place = (out->first + out->count) % FCSL_LINK_QUEUE;
        out->frames[place].size = (uint16_t)(size - at < FCSL_LINK_PAYLOAD_MAX ? size - at : FCSL_LINK_PAYLOAD_MAX);
        out->frames[place].flags = (uint16_t)((i == 0 ? FCSL_LINK_FIRST : 0) | (i + 1u == frames ? FCSL_LINK_LAST : 0));
        out->count++;
    }
    fcsl_link_bytes_append(&out->bytes, message, (uint32_t)size);
}

fcsl_link_status_t fcsl_link_outgoing_put(fcsl_link_port_t *port, const uint8_t *message, size_t size)
{
    fcsl_link_outgoing_t *out = &port->out;
    const size_t frames = size == 0 ? 1u : (size - 1u) / FCSL_LINK_PAYLOAD_MAX + 1u;
    if (frames > (port->policy == FCSL_LINK_RELIABLE ? FCSL_LINK_QUEUE : 1) ||
        size > FCSL_LINK_BUFFER - FCSL_LINK_SIZE_BYTES) {
        return FCSL_LINK_TOO_LARGE;
    }
    if (port->policy == FCSL_LINK_LATEST && out->count > 0) {
        /* Its number is not used: the peer did not lose it. */
        out->bytes.size = 0;
        out->count = 0;
        port->counters.replaced++;
    }
    if (frames > FCSL_LINK_QUEUE - out->count || size > fcsl_link_bytes_room(&out->bytes)) {
        return FCSL_LINK_FULL;
    }
    append(out, message, size, (uint32_t)frames);
    port->counters.sent++;
    return FCSL_LINK_OK;
}

void fcsl_link_outgoing_tick(fcsl_link_port_t *port, uint32_t retransmit_ticks)
{
    fcsl_link_outgoing_t *out = &port->out;
    out->due = out->count;
    if (port->policy != FCSL_LINK_RELIABLE) {
        return;
    }
    out->due = min_u32(out->count, out->confirmed + FCSL_LINK_WINDOW);
    out->ticks = out->sent_max > out->confirmed ? out->ticks + 1u : 0u;
    if (out->ticks >= retransmit_ticks) {
        out->ticks = 0;
        out->sent = out->confirmed;
    }
}

int fcsl_link_outgoing_due(const fcsl_link_port_t *port)
{
    const fcsl_link_outgoing_t *out = &port->out;
    return port->policy == FCSL_LINK_RELIABLE ? out->sent < out->due : out->count > 0 && out->due > 0;
}

/* Bytes of the frames before frame `number`. */
static uint32_t offset_of(const fcsl_link_outgoing_t *out, uint32_t number)
{
    uint32_t offset = 0;
    for (uint32_t i = 0; i < number; i++) {
        offset += out->frames[(out->first + i) % FCSL_LINK_QUEUE].size;
    }
    return offset;
}

size_t fcsl_link_outgoing_take(fcsl_link_port_t *port, fcsl_link_header_t *header, uint8_t frame[FCSL_LINK_FRAME_MAX])
{
    fcsl_link_outgoing_t *out = &port->out;
    const int reliable = port->policy == FCSL_LINK_RELIABLE;
    const uint32_t number = reliable ? out->sent : 0u;
    const uint32_t place = (out->first + number) % FCSL_LINK_QUEUE;
    const uint32_t size = out->frames[place].size;
    header->kind = reliable                              ? FCSL_LINK_DATA
                   : port->policy == FCSL_LINK_SEQUENCED ? FCSL_LINK_FRAME_SEQUENCED
                                                         : FCSL_LINK_FRAME_LATEST;
    header->flags = reliable ? (uint8_t)out->frames[place].flags : 0u;
    header->sequence = (uint16_t)(out->sequence + number);
    fcsl_link_bytes_read(&out->bytes, offset_of(out, number), frame + fcsl_link_header_bytes(header->kind), size);
    port->counters.frames_sent++;
    if (!reliable) {
        pop(out, 1);
        return size;
    }
    port->counters.frames_repeated += out->sent < out->sent_max;
    out->sent++;
    out->sent_max = out->sent > out->sent_max ? out->sent : out->sent_max;
    return size;
}

/* Forgets the messages that the peer has as a whole. */
static void release(fcsl_link_outgoing_t *out)
{
    uint32_t done = 0;
    for (uint32_t i = 0; i < out->confirmed; i++) {
        done = (out->frames[(out->first + i) % FCSL_LINK_QUEUE].flags & FCSL_LINK_LAST) != 0 ? i + 1u : done;
    }
    pop(out, done);
    out->confirmed -= done;
    out->sent -= done;
    out->sent_max -= done;
}

void fcsl_link_outgoing_confirm(fcsl_link_port_t *port, uint16_t acknowledge)
{
    fcsl_link_outgoing_t *out = &port->out;
    const uint16_t more = (uint16_t)(acknowledge - out->sequence - out->confirmed);
    if (more == 0 || more > out->sent_max - out->confirmed) {
        return; /* nothing new, or nothing that was sent */
    }
    out->confirmed += more;
    out->sent = out->sent > out->confirmed ? out->sent : out->confirmed;
    out->ticks = 0;
    release(out);
}

void fcsl_link_outgoing_restart(fcsl_link_port_t *port)
{
    fcsl_link_outgoing_t *out = &port->out;
    out->confirmed = 0;
    out->sent = 0;
    out->sent_max = 0;
    out->due = 0;
    out->ticks = 0;
    out->sequence = 0;
}
