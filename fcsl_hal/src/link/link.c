/* SPDX-License-Identifier: Apache-2.0
 *
 * One end of a link: ticks, sessions, and what goes to which port.
 */
#include "link_bytes.h"
#include "link_port.h"

_Static_assert(FCSL_LINK_PORTS >= 1 && FCSL_LINK_PORTS <= 16, "a frame has four bits for its port");
_Static_assert(FCSL_LINK_WINDOW >= 1 && FCSL_LINK_WINDOW <= FCSL_LINK_QUEUE, "frames under way wait in the queue");
_Static_assert(FCSL_LINK_HELLO_TICKS >= 1 && FCSL_LINK_HELLO_TRIES < UINT8_MAX, "these are counted in a byte");

/* fcsl_link_session_t.due */
enum { TO_PEER = 1, TO_CANDIDATE = 2 };

int fcsl_link_open(fcsl_link_t *link, const fcsl_link_policy_t policies[FCSL_LINK_PORTS], uint16_t session,
                   uint32_t retransmit_ticks)
{
    memset(link, 0, sizeof *link);
    if (session == 0 || retransmit_ticks == 0) {
        return -1;
    }
    for (uint32_t i = 0; i < FCSL_LINK_PORTS; i++) {
        if ((unsigned)policies[i] > FCSL_LINK_RELIABLE) {
            return -1;
        }
        link->ports[i].policy = policies[i];
        link->port_count = policies[i] != FCSL_LINK_CLOSED ? i + 1u : link->port_count;
    }
    link->session.session = session;
    link->session.challenge = 1;
    link->retransmit_ticks = retransmit_ticks;
    return 0;
}

static fcsl_link_port_t *open_port(fcsl_link_t *link, uint32_t port)
{
    return port < FCSL_LINK_PORTS && link->ports[port].policy != FCSL_LINK_CLOSED ? &link->ports[port] : NULL;
}

fcsl_link_status_t fcsl_link_send(fcsl_link_t *link, uint32_t port, const void *message, size_t size)
{
    fcsl_link_port_t *to = open_port(link, port);
    return to != NULL ? fcsl_link_outgoing_put(to, message, size) : FCSL_LINK_NO_PORT;
}

fcsl_link_status_t fcsl_link_receive(fcsl_link_t *link, uint32_t port, void *message, size_t capacity, size_t *size)
{
    fcsl_link_port_t *from = open_port(link, port);
    *size = 0;
    return from != NULL ? fcsl_link_incoming_get(from, message, capacity, size) : FCSL_LINK_NO_PORT;
}

/* ---- what is sent ------------------------------------------------------------------------------------------------- */

static void tick_session(fcsl_link_session_t *session)
{
    session->due = session->answer ? TO_PEER : 0;
    session->answer = 0;
    if (session->peer != 0 && session->candidate == 0) {
        return;
    }
    if (session->ticks > 0) {
        session->ticks--;
        return;
    }
    session->ticks = FCSL_LINK_HELLO_TICKS - 1;
    if (session->candidate == 0) {
        session->due |= TO_PEER;
        return;
    }
    session->due |= TO_CANDIDATE;
    session->tries++;
    if (session->tries > FCSL_LINK_HELLO_TRIES) {
        session->due &= (uint8_t)~TO_CANDIDATE;
        session->candidate = 0;
    }
}

void fcsl_link_tick(fcsl_link_t *link)
{
    tick_session(&link->session);
    for (uint32_t i = 0; i < link->port_count; i++) {
        fcsl_link_port_t *port = &link->ports[i];
        fcsl_link_outgoing_tick(port, link->retransmit_ticks);
        if (port->in.answer == FCSL_LINK_ANSWER_SOON) {
            port->in.answer = FCSL_LINK_ANSWER_NOW;
        }
    }
}

static size_t hello(fcsl_link_session_t *session, uint8_t frame[FCSL_LINK_FRAME_MAX])
{
    const int to_peer = (session->due & TO_PEER) != 0;
    const fcsl_link_header_t header = {
        .kind = FCSL_LINK_HELLO,
        .flags = to_peer && session->peer != 0 ? FCSL_LINK_CONNECTED : 0,
        .session = session->session,
        .sequence = session->challenge,
        .to = to_peer ? session->peer : session->candidate,
        .acknowledge = to_peer ? session->peer_challenge : session->candidate_challenge,
    };
    session->due &= (uint8_t)~(to_peer ? TO_PEER : TO_CANDIDATE);
    return fcsl_link_frame_end(frame, &header, 0);
}

/* The next frame of a port, or 0. */
static size_t port_frame(fcsl_link_t *link, uint32_t number, uint8_t frame[FCSL_LINK_FRAME_MAX])
{
    fcsl_link_port_t *port = &link->ports[number];
    const int reliable = port->policy == FCSL_LINK_RELIABLE;
    if (port->policy == FCSL_LINK_CLOSED || (reliable && link->session.peer == 0)) {
        return 0;
    }
    fcsl_link_header_t header = {
        .kind = FCSL_LINK_ACKNOWLEDGEMENT,
        .port = (uint8_t)number,
        .session = link->session.session,
        .to = link->session.peer,
        .acknowledge = port->in.sequence,
    };
    size_t size = 0;
    if (fcsl_link_outgoing_due(port)) {
        size = fcsl_link_outgoing_take(port, &header, frame);
    } else if (!reliable || port->in.answer != FCSL_LINK_ANSWER_NOW) {
        return 0;
    }
    port->in.answer = FCSL_LINK_ANSWER_NONE;
    return fcsl_link_frame_end(frame, &header, size);
}

size_t fcsl_link_next_frame(fcsl_link_t *link, uint8_t frame[FCSL_LINK_FRAME_MAX])
{
    if (link->session.due != 0) {
        return hello(&link->session, frame);
    }
    /* Ports take turns, so that none of them starves on a slow wire. */
    for (uint32_t i = 0; i < link->port_count; i++) {
        const uint32_t number = link->next_port;
        link->next_port = (number + 1u) % link->port_count;
        const size_t size = port_frame(link, number, frame);
        if (size > 0) {
            return size;
        }
    }
    return 0;
}

/* ---- what arrives ------------------------------------------------------------------------------------------------- */

static void connect(fcsl_link_t *link, const fcsl_link_header_t *header)
{
    fcsl_link_session_t *session = &link->session;
    link->counters.peer_restarts += session->peer != 0;
    session->peer = header->session;
    session->candidate = 0;
    session->due &= (uint8_t)~TO_CANDIDATE;
    session->challenge = session->challenge == UINT16_MAX ? 1u : (uint16_t)(session->challenge + 1u);
    for (uint32_t i = 0; i < FCSL_LINK_PORTS; i++) {
        if (link->ports[i].policy == FCSL_LINK_RELIABLE) {
            fcsl_link_outgoing_restart(&link->ports[i]);
            fcsl_link_incoming_restart(&link->ports[i]);
        }
    }
}

/* A session other than the peer's speaks. */
static void challenge(fcsl_link_session_t *session, uint16_t candidate)
{
    if (session->candidate != candidate) {
        session->candidate = candidate;
        session->candidate_challenge = 0;
        session->tries = 0;
        session->ticks = 0;
    }
}

static void take_hello(fcsl_link_t *link, const fcsl_link_header_t *header)
{
    fcsl_link_session_t *session = &link->session;
    if (header->session == session->session) {
        link->counters.other_session++; /* an echo, or a peer that chose the same number */
        return;
    }
    if (header->session != session->peer && header->to == session->session &&
        header->acknowledge == session->challenge) {
        connect(link, header);
    }
    if (header->session == session->peer) {
        session->peer_challenge = header->sequence;
        if ((header->flags & FCSL_LINK_CONNECTED) == 0 || header->to != session->session) {
            session->answer = 1;
        }
    } else {
        challenge(session, header->session);
        session->candidate_challenge = header->sequence;
    }
}

/* Whether a frame of a reliable port is of the peer and for this session. */
static int is_of_peer(fcsl_link_t *link, const fcsl_link_header_t *header)
{
    fcsl_link_session_t *session = &link->session;
    if (header->session == session->peer && header->to == session->session) {
        return 1;
    }
    link->counters.other_session++;
    if (header->session == session->peer) {
        session->answer = 1;
    } else if (header->session != session->session) {
        challenge(session, header->session);
    }
    return 0;
}

static void take_port_frame(fcsl_link_t *link, const fcsl_link_header_t *header, const uint8_t *payload, uint32_t size)
{
    static const fcsl_link_policy_t policy[FCSL_LINK_KINDS] = {
        [FCSL_LINK_FRAME_LATEST] = FCSL_LINK_LATEST,
        [FCSL_LINK_FRAME_SEQUENCED] = FCSL_LINK_SEQUENCED,
        [FCSL_LINK_DATA] = FCSL_LINK_RELIABLE,
        [FCSL_LINK_ACKNOWLEDGEMENT] = FCSL_LINK_RELIABLE,
    };
    fcsl_link_port_t *port = open_port(link, header->port);
    if (port == NULL || port->policy != policy[header->kind]) {
        link->counters.malformed++;
        return;
    }
    if (port->policy != FCSL_LINK_RELIABLE) {
        link->counters.frames_taken++;
        fcsl_link_incoming_message(port, header, payload, size);
        return;
    }
    if (!is_of_peer(link, header)) {
        return;
    }
    link->counters.frames_taken++;
    fcsl_link_outgoing_confirm(port, header->acknowledge);
    if (header->kind == FCSL_LINK_DATA && fcsl_link_incoming_data(port, header, payload, size) != 0) {
        link->counters.malformed++;
    }
}

void fcsl_link_take_frame(fcsl_link_t *link, const uint8_t *frame, size_t size)
{
    fcsl_link_header_t header;
    const uint8_t *payload = NULL;
    size_t payload_size = 0;
    switch (fcsl_link_frame_read(frame, size, &header, &payload, &payload_size)) {
    case FCSL_LINK_FRAME_OK:
        break;
    case FCSL_LINK_FRAME_WRONG_CRC:
        link->counters.wrong_crc++;
        return;
    case FCSL_LINK_FRAME_OTHER_VERSION:
        link->counters.other_version++;
        return;
    default:
        link->counters.malformed++;
        return;
    }
    if (header.kind == FCSL_LINK_HELLO) {
        link->counters.frames_taken++;
        take_hello(link, &header);
    } else {
        take_port_frame(link, &header, payload, (uint32_t)payload_size);
    }
}
