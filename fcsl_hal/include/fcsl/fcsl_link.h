/* SPDX-License-Identifier: Apache-2.0
 *
 * The link layer: ports with a delivery policy each over one wire that may lose, repeat, reorder and damage frames.
 * docs/reference/transports.md defines the frames and the rules.
 *
 * One end is one struct of fixed size. It has no threads, timers or clock and does no I/O: a host ticks it, carries its
 * frames and hands it those of the peer. The struct belongs to one thread at a time.
 */
#ifndef FCSL_LINK_H
#define FCSL_LINK_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef FCSL_LINK_PORTS
#define FCSL_LINK_PORTS 16
#endif
#ifndef FCSL_LINK_PAYLOAD_MAX
#define FCSL_LINK_PAYLOAD_MAX 240
#endif
#ifndef FCSL_LINK_WINDOW
#define FCSL_LINK_WINDOW 16
#endif
#ifndef FCSL_LINK_QUEUE
#define FCSL_LINK_QUEUE 128
#endif
#ifndef FCSL_LINK_BUFFER
#define FCSL_LINK_BUFFER 16384
#endif
/* Link ticks between hellos, and hellos to one candidate. */
#ifndef FCSL_LINK_HELLO_TICKS
#define FCSL_LINK_HELLO_TICKS 8
#endif
#ifndef FCSL_LINK_HELLO_TRIES
#define FCSL_LINK_HELLO_TRIES 8
#endif

enum {
    FCSL_LINK_VERSION = 1,
    FCSL_LINK_HEADER_MAX = 10,
    FCSL_LINK_CRC_BYTES = 2,
    /* The longest frame. */
    FCSL_LINK_FRAME_MAX = FCSL_LINK_HEADER_MAX + FCSL_LINK_PAYLOAD_MAX + FCSL_LINK_CRC_BYTES,
    /* Of a message in memory: its size. */
    FCSL_LINK_SIZE_BYTES = 4,
    /* A latest or sequenced frame less than this far behind the newest one is late, any other is new. */
    FCSL_LINK_LATE = 64
};

typedef enum {
    FCSL_LINK_CLOSED = 0, /* the port is not used */
    FCSL_LINK_LATEST = 1,
    FCSL_LINK_SEQUENCED = 2,
    FCSL_LINK_RELIABLE = 3
} fcsl_link_policy_t;

typedef enum {
    FCSL_LINK_OK = 0,
    FCSL_LINK_EMPTY = 1,     /* receive: no message waits */
    FCSL_LINK_FULL = 2,      /* send: the port's queue has no room for this message now */
    FCSL_LINK_TOO_LARGE = 3, /* send: it never has; receive: the message does not fit into `capacity`, and stays */
    FCSL_LINK_NO_PORT = 4    /* the port is closed, or its number too large */
} fcsl_link_status_t;

/* Of one port, since the link was opened. */
typedef struct {
    uint64_t sent;            /* messages that the host handed over */
    uint64_t received;        /* messages that arrived whole */
    uint64_t frames_sent;     /* data frames, repeated ones included */
    uint64_t frames_repeated; /* reliable: sent once more */
    uint64_t lost;            /* latest and sequenced: numbers that were skipped */
    uint64_t late;            /* latest and sequenced: late or repeated; reliable: frames out of order */
    uint64_t replaced;        /* latest: a newer message came before this one was read, or sent */
    uint64_t no_room;         /* sequenced: dropped, reliable: not yet taken, because the host does not read */
    uint64_t too_large;       /* reliable: messages that can never fit */
} fcsl_link_port_counters_t;

/* Of the whole link. */
typedef struct {
    uint64_t frames_taken;   /* of the peer, in order of any kind */
    uint64_t malformed;      /* too short, too long, of no kind, with wrong flags, or on a port of another policy */
    uint64_t wrong_crc;
    uint64_t other_version;
    uint64_t other_session;  /* reliable frames of, or for, a session that is not (any more) connected */
    uint64_t peer_restarts;
} fcsl_link_counters_t;

/* Messages, or what there is of one, in a ring of bytes. */
typedef struct {
    uint8_t bytes[FCSL_LINK_BUFFER];
    uint32_t first;
    uint32_t size;
} fcsl_link_bytes_t;

/* The outgoing half of a port. Frames count from the first one of the oldest message that still waits. */
typedef struct {
    fcsl_link_bytes_t bytes;
    struct {
        uint16_t size;
        uint16_t flags;
    } frames[FCSL_LINK_QUEUE];
    uint32_t first; /* place of frame 0 in `frames` */
    uint32_t count;
    uint32_t confirmed; /* reliable: frames that the peer has */
    uint32_t sent;      /* reliable: the next one to send */
    uint32_t sent_max;  /* reliable: frames that were sent at least once in this session of the peer */
    uint32_t due;       /* frames that this tick may send */
    uint32_t ticks;     /* reliable: since the last progress */
    uint16_t sequence;  /* of frame 0 */
} fcsl_link_outgoing_t;

/* The incoming half of a port. */
typedef struct {
    fcsl_link_bytes_t bytes;
    uint32_t whole;    /* bytes of whole messages; behind them lies what there is of the next one */
    uint16_t sequence; /* reliable: expected next; otherwise the newest */
    uint16_t session;  /* latest and sequenced: of the newest frame; 0 before the first one */
    uint8_t skipping;  /* reliable: the message does not fit */
    uint8_t answer;    /* reliable: FCSL_LINK_ANSWER_*: the peer waits for an acknowledgement */
} fcsl_link_incoming_t;

typedef struct {
    fcsl_link_policy_t policy;
    fcsl_link_outgoing_t out;
    fcsl_link_incoming_t in;
    fcsl_link_port_counters_t counters;
} fcsl_link_port_t;

/* Who the peer is: docs/reference/transports.md#sessions. */
typedef struct {
    uint16_t session;
    uint16_t challenge; /* that a peer must repeat */
    uint16_t peer;      /* 0: none yet */
    uint16_t peer_challenge;
    uint16_t candidate; /* 0: none */
    uint16_t candidate_challenge;
    uint8_t answer; /* the peer waits for a hello */
    uint8_t tries;  /* hellos to the candidate so far */
    uint8_t due;    /* FCSL_LINK_TO_*: hellos of this tick */
    uint32_t ticks; /* until the next hello to the candidate, or to anybody */
} fcsl_link_session_t;

typedef struct {
    fcsl_link_port_t ports[FCSL_LINK_PORTS];
    fcsl_link_session_t session;
    uint32_t retransmit_ticks;
    uint32_t port_count; /* behind the last one that is open */
    uint32_t next_port;  /* that fcsl_link_next_frame looks at */
    fcsl_link_counters_t counters;
} fcsl_link_t;

/* `policies`: of ports 0 to FCSL_LINK_PORTS - 1. `session`: 1 to 65535, another one at every start. `retransmit_ticks`: at
 * least 1; more than a round trip takes. Returns 0, or -1 for values outside these. */
int fcsl_link_open(fcsl_link_t *link, const fcsl_link_policy_t policies[FCSL_LINK_PORTS], uint16_t session,
                   uint32_t retransmit_ticks);

/* Takes a copy of a message, to be sent from the next tick on. */
fcsl_link_status_t fcsl_link_send(fcsl_link_t *link, uint32_t port, const void *message, size_t size);
/* Copies out the oldest message of a port; *size is its size, also with FCSL_LINK_TOO_LARGE. */
fcsl_link_status_t fcsl_link_receive(fcsl_link_t *link, uint32_t port, void *message, size_t capacity, size_t *size);

/* One link tick passes: decides what is due. Frames of the tick before that were not taken are not lost. */
void fcsl_link_tick(fcsl_link_t *link);
/* The next frame of this tick, at most FCSL_LINK_FRAME_MAX bytes; 0 when there is none. */
size_t fcsl_link_next_frame(fcsl_link_t *link, uint8_t frame[FCSL_LINK_FRAME_MAX]);
/* A frame that came over the wire, or anything else. */
void fcsl_link_take_frame(fcsl_link_t *link, const uint8_t *frame, size_t size);

/* Whether the peer's session is known, so that reliable ports work. */
static inline int fcsl_link_connected(const fcsl_link_t *link)
{
    return link->session.peer != 0;
}

/* CRC-16/CCITT-FALSE of `size` bytes, continued from `crc`; 0xFFFF begins. */
uint16_t fcsl_crc16(uint16_t crc, const void *bytes, size_t size);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_LINK_H */
