/* SPDX-License-Identifier: Apache-2.0
 *
 * Who is at the other end of a free-running one: both send hellos twice a second, and each says in its log when the other one
 * comes, goes or does not fit (docs/reference/transports.md).
 */
#ifndef FCSL_PRESENCE_H
#define FCSL_PRESENCE_H

#include "fcsl/fcsl_log.h"
#include "transport/handshake.h"

enum { PRESENCE_TEXT_BYTES = 320 };

typedef struct {
    const char *peer; /* "the simulator" */
    const fcsl_channel_table_t *table;
    fcsl_log_t *log;
    int sends; /* the flag of this end's hellos, and of those of a peer that runs free */
    int expects;
    uint64_t hello_ns; /* when the next one is due */
    int there;
    int returns; /* it has been there */
    char misfit[PRESENCE_TEXT_BYTES]; /* what was said of the peer that does not fit */
} presence_t;

presence_t presence_of(fcsl_wire_side_t peer, const fcsl_channel_table_t *table, fcsl_log_t *log);

/* Sends a hello when one is due. Call it often. */
void presence_send(presence_t *presence, const fcsl_wire_t *wire);

/* Looks at what came: 1 where it is a control packet. */
int presence_receive(presence_t *presence, const uint8_t *bytes, size_t size);

/* The peer is gone. */
void presence_end(presence_t *presence);

#endif /* FCSL_PRESENCE_H */
