/* SPDX-License-Identifier: Apache-2.0
 *
 * Frames over datagrams and streams.
 */
#define _GNU_SOURCE
#include "line.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { READ_BYTES = 4096, DATAGRAMS_MAX = 32 };

static int is_later(int code)
{
    return code == EAGAIN || code == EWOULDBLOCK || code == EINTR || code == ENOBUFS;
}

int line_set_nonblocking(int fd)
{
    const int flags = fcntl(fd, F_GETFL);
    return flags >= 0 && fcntl(fd, F_SETFL, flags | O_NONBLOCK) == 0 ? 0 : -1;
}

void line_begin(line_t *line, int fd)
{
    line->fd = fd;
    line->pending[0] = 0;
    line->pending_from = 0;
    line->pending_to = 1;
}

void line_drop(line_t *line)
{
    if (line->fd >= 0) {
        (void)close(line->fd);
        line->fd = -1;
    }
    const uint64_t garbage = line->decoder.garbage;
    memset(&line->decoder, 0, sizeof line->decoder);
    line->decoder.garbage = garbage;
    line->pending_from = 0;
    line->pending_to = 0;
}

void line_close(line_t *line)
{
    line_drop(line);
    if (line->listener >= 0) {
        (void)close(line->listener);
        line->listener = -1;
    }
}

/* ---- writing ------------------------------------------------------------------------------------------------------- */

static void flush(line_t *line)
{
    while (line->pending_from < line->pending_to) { /* every turn writes a byte at least, or ends */
        const ssize_t done = write(line->fd, line->pending + line->pending_from, line->pending_to - line->pending_from);
        if (done <= 0) {
            line->failures += done < 0 && !is_later(errno);
            return; /* that the peer is gone is seen where it is read */
        }
        line->pending_from += (size_t)done;
    }
}

int line_has_room(line_t *line)
{
    int queued = 0;
    if (line->fd < 0 || (line->answers && line->peer_length == 0)) {
        return 0;
    }
    flush(line);
    if (line->pending_from < line->pending_to) {
        return 0;
    }
    /* A serial line is kept short of work: what waits in the system cannot be overtaken by anything newer. */
    return !line->serial || ioctl(line->fd, TIOCOUTQ, &queued) != 0 || queued < FCSL_COBS_BYTES_MAX;
}

static void write_datagram(line_t *line, const uint8_t *frame, size_t size)
{
    const struct sockaddr *to = line->answers ? (const struct sockaddr *)&line->peer : NULL;
    const ssize_t done =
        sendto(line->fd, frame, size, MSG_DONTWAIT | MSG_NOSIGNAL, to, line->answers ? line->peer_length : 0);
    line->failures += done < 0; /* lost, as any frame may be */
}

void line_write(line_t *line, const uint8_t *frame, size_t size)
{
    if (line->datagrams) {
        write_datagram(line, frame, size);
        return;
    }
    line->pending_from = 0;
    line->pending_to = fcsl_cobs_encode(frame, size, line->pending);
}

/* ---- reading ------------------------------------------------------------------------------------------------------- */

/* Whoever sends a frame is answered: a controller that was started again has another port. */
static void take_datagram(line_t *line, fcsl_link_t *link, const uint8_t *bytes, size_t size,
                          const struct sockaddr_storage *from, socklen_t length)
{
    const uint64_t taken = link->counters.frames_taken;
    fcsl_link_take_frame(link, bytes, size);
    if (line->answers && link->counters.frames_taken != taken) {
        line->peer = *from;
        line->peer_length = length;
    }
}

static int read_datagrams(line_t *line, fcsl_link_t *link)
{
    for (int i = 0; i < DATAGRAMS_MAX; i++) {
        uint8_t bytes[FCSL_LINK_FRAME_MAX + 1]; /* a longer datagram becomes a frame that is too long */
        struct sockaddr_storage from;
        socklen_t length = sizeof from;
        const ssize_t size = recvfrom(line->fd, bytes, sizeof bytes, MSG_DONTWAIT, (struct sockaddr *)&from, &length);
        if (size < 0 && is_later(errno)) {
            return 0;
        }
        if (size < 0) {
            line->failures++; /* a datagram of ours came back: nobody is there yet */
        } else {
            take_datagram(line, link, bytes, (size_t)size, &from, length);
        }
    }
    return 0;
}

static int read_stream(line_t *line, fcsl_link_t *link)
{
    uint8_t bytes[READ_BYTES];
    const ssize_t got = read(line->fd, bytes, sizeof bytes);
    if (got < 0 && is_later(errno)) {
        return 0;
    }
    if (got <= 0) {
        return -1;
    }
    for (size_t at = 0; at < (size_t)got;) {
        size_t size = 0;
        at += fcsl_cobs_decode(&line->decoder, bytes + at, (size_t)got - at, &size);
        if (size > 0) {
            fcsl_link_take_frame(link, line->decoder.frame, size);
        }
    }
    return 0;
}

int line_read(line_t *line, fcsl_link_t *link)
{
    return line->datagrams ? read_datagrams(line, link) : read_stream(line, link);
}
