/* SPDX-License-Identifier: Apache-2.0
 *
 * One port of a link: what waits to be sent (link_outgoing.c) and what arrived (link_incoming.c).
 */
#ifndef FCSL_LINK_PORT_H
#define FCSL_LINK_PORT_H

#include "link_frame.h"

/* fcsl_link_incoming_t.answer: the next link tick makes SOON to NOW. */
enum { FCSL_LINK_ANSWER_NONE = 0, FCSL_LINK_ANSWER_SOON = 1, FCSL_LINK_ANSWER_NOW = 2 };

fcsl_link_status_t fcsl_link_outgoing_put(fcsl_link_port_t *port, const uint8_t *message, size_t size);
/* A link tick: what may be sent now, and whether it is time to repeat. */
void fcsl_link_outgoing_tick(fcsl_link_port_t *port, uint32_t retransmit_ticks);
/* Whether a frame is due. */
int fcsl_link_outgoing_due(const fcsl_link_port_t *port);
/* Fills in kind, flags and sequence of the frame that is due, and copies its payload to where that kind has it. Returns the
 * payload's size. */
size_t fcsl_link_outgoing_take(fcsl_link_port_t *port, fcsl_link_header_t *header, uint8_t frame[FCSL_LINK_FRAME_MAX]);
/* Reliable: the peer expects frame `acknowledge` next. */
void fcsl_link_outgoing_confirm(fcsl_link_port_t *port, uint16_t acknowledge);
/* Reliable: the peer is a new one. */
void fcsl_link_outgoing_restart(fcsl_link_port_t *port);

fcsl_link_status_t fcsl_link_incoming_get(fcsl_link_port_t *port, uint8_t *message, size_t capacity, size_t *size);
/* A frame of a latest or sequenced port. */
void fcsl_link_incoming_message(fcsl_link_port_t *port, const fcsl_link_header_t *header, const uint8_t *payload,
                                uint32_t size);
/* A data frame of a reliable port. Returns 0, or -1 for a fragment that follows none. */
int fcsl_link_incoming_data(fcsl_link_port_t *port, const fcsl_link_header_t *header, const uint8_t *payload,
                            uint32_t size);
void fcsl_link_incoming_restart(fcsl_link_port_t *port);

#endif /* FCSL_LINK_PORT_H */
