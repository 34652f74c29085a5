/* SPDX-License-Identifier: Apache-2.0
 *
 * What carries the frames of a link: datagrams, each a frame, or a stream of bytes with COBS frames. Nothing here waits.
 */
#ifndef FCSL_LINE_H
#define FCSL_LINE_H

#include <sys/socket.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_cobs.h"
#include "fcsl/fcsl_wire.h"

typedef struct {
    int fd;       /* -1: nobody is connected */
    int listener; /* of TCP; -1: none */
    int datagrams;
    int serial;        /* its output queue is asked before a frame is written */
    uint64_t frame_ns; /* that the longest frame takes; 0: no time to speak of */
    /* Datagrams of an end that listens: where they go, which is where the last frame came from; length 0: not known yet. */
    int answers;
    struct sockaddr_storage peer;
    socklen_t peer_length;
    fcsl_cobs_decoder_t decoder;
    uint8_t pending[FCSL_COBS_BYTES_MAX]; /* of a frame, not written yet */
    size_t pending_from;
    size_t pending_to;
    uint64_t failures; /* that the system reported: datagrams that were returned, bytes that were not taken */
} line_t;

/* Each opens one end. 0, or -1 with `error` filled; what is connected tries again until `deadline_ns`. */
int line_open_udp(line_t *line, const char *address, fcsl_wire_side_t side, fcsl_error_t *error);
int line_open_tcp(line_t *line, const char *address, fcsl_wire_side_t side, uint64_t deadline_ns, fcsl_error_t *error);
int line_open_uart(line_t *line, const char *device, uint32_t baud, fcsl_error_t *error);
/* Whether a UART can run at this speed. */
int line_has_speed(uint32_t baud);
/* Takes the peer that waits on the listener, in place of the present one. 0, or -1 when there is none now. */
int line_accept(line_t *line);
void line_close(line_t *line);

/* A stream begins: with a zero, so that what was on the line before does not hide the first frame. */
void line_begin(line_t *line, int fd);
/* The peer is gone. */
void line_drop(line_t *line);

/* Whether a frame may be written now. What is left of the last one is written first. */
int line_has_room(line_t *line);
/* Takes a frame, where there is room: a datagram is sent at once, on a stream line_has_room writes it. */
void line_write(line_t *line, const uint8_t *frame, size_t size);

/* Hands what has come, in portions of bounded size, to the link. Returns 0, or -1 when the peer is gone. */
int line_read(line_t *line, fcsl_link_t *link);

/* Without waiting for the other end: a blocking descriptor becomes one that does not. 0, or -1. */
int line_set_nonblocking(int fd);

#endif /* FCSL_LINE_H */
