/* SPDX-License-Identifier: Apache-2.0
 *
 * A wire over the link layer: messages travel on port 0, reliable, whatever the line loses. A thread of its own reads the line,
 * ticks the link and writes its frames; who sends and receives meets it in the ports of the link.
 */
#define _GNU_SOURCE
#include "wire_link.h"

#include <inttypes.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "link/link_frame.h"

enum {
    PORT = 0,
    RETRANSMIT_TICKS = 10,
    RETRANSMIT_TICKS_TCP = 250, /* it loses nothing by itself */
    WAITING_MAX = 4,            /* messages; in lock-step there are two. Commands that wait longer are of no use */
    TICK_NS = 2 * FCSL_NS_PER_MS,   /* without anything to send */
    TICK_MIN_NS = FCSL_NS_PER_MS /
        5, /* a burst of messages makes no faster ticks: they count the time to retransmission */
    CLOSE_NS = 300 * FCSL_NS_PER_MS, /* for the peer to take what was sent last */
    POLL_NS = FCSL_NS_PER_MS,
    TEXT_BYTES = 128
};

/* What the thread and its user share is `lock`ed; the rest belongs to the thread, but for `text`. */
typedef struct {
    pthread_t thread;
    int wake; /* eventfd: the thread has something to do */
    int news; /* eventfd: a message came, or the peer went */
    line_t line;
    uint8_t dropped[FCSL_LINK_BUFFER]; /* a message that is too long for who receives */
    char text[TEXT_BYTES];
    uint64_t tick_ns; /* longest time between two link ticks */

    pthread_mutex_t lock;
    fcsl_link_t link;
    int has_peer; /* the line is connected */
    int spoken; /* the user has sent something to this peer: until then a newer connection replaces it */
    int disconnected; /* the peer went, which the user does not know yet */
    int stop;
    uint64_t garbage;
    uint64_t failures;
    uint64_t too_large;
} wire_t;

typedef struct {
    uint64_t connected;
    fcsl_link_counters_t link;
    fcsl_link_port_counters_t port;
    uint64_t garbage;
    uint64_t failures;
    uint64_t too_large;
} counters_t;

#define COUNTER(path, member, doc) FCSL_WIRE_COUNTER(counters_t, path, member, doc)

static const fcsl_field_t FIELDS[] = {
    COUNTER("link.connected", connected, "1 while the session of the peer is known"),
    COUNTER("link.frames_taken", link.frames_taken, "frames of the peer"),
    COUNTER("link.malformed", link.malformed, "frames that are none"),
    COUNTER("link.wrong_crc", link.wrong_crc, "frames that were damaged"),
    COUNTER("link.other_version", link.other_version, "frames of another version of the link"),
    COUNTER("link.other_session", link.other_session, "frames of a session that has ended"),
    COUNTER("link.peer_restarts", link.peer_restarts, "sessions of the peer after the first one"),
    COUNTER("link.garbage", garbage, "what stood between two zeros of a byte stream and was no frame"),
    COUNTER("link.line_failures", failures, "frames that the system did not take or sent back"),
    COUNTER("link.port0.sent", port.sent, "messages that were sent"),
    COUNTER("link.port0.received", port.received, "messages that arrived whole"),
    COUNTER("link.port0.frames_sent", port.frames_sent, "data frames, repeated ones included"),
    COUNTER("link.port0.frames_repeated", port.frames_repeated, "data frames that were sent once more"),
    COUNTER("link.port0.late", port.late, "data frames out of order"),
    COUNTER("link.port0.no_room", port.no_room, "data frames that were not taken, because messages were not read"),
    COUNTER("link.port0.too_large", too_large, "messages dropped because they were too long"),
};

const fcsl_wire_counters_t fcsl_wire_link_counters = {
    .fields = FIELDS, .field_count = sizeof FIELDS / sizeof FIELDS[0], .bytes = sizeof(counters_t)};

static void notify(int event)
{
    const uint64_t one = 1;
    const ssize_t done = write(event, &one, sizeof one);
    (void)done; /* fails only when the count is full, and then it has been noticed */
}

static void clear(int event)
{
    uint64_t count = 0;
    const ssize_t done = read(event, &count, sizeof count);
    (void)done; /* nothing to read is as good */
}

/* ---- the thread ---------------------------------------------------------------------------------------------------- */

typedef struct {
    uint64_t ticked_ns; /* when the last link tick was */
    int received; /* something came since */
    int is_used; /* the user has sent something since */
    int sending; /* frames of the last tick are left */
} pump_t;

/* When the next link tick is due. On a slow line the frames of the last one come first. */
static uint64_t next_tick_ns(const wire_t *wire, const pump_t *pump)
{
    if (!pump->is_used) {
        return pump->ticked_ns + wire->tick_ns;
    }
    return pump->received ? 0u : pump->ticked_ns + TICK_MIN_NS;
}

static void tick(wire_t *wire, pump_t *pump, uint64_t now_ns)
{
    (void)pthread_mutex_lock(&wire->lock);
    fcsl_link_tick(&wire->link);
    (void)pthread_mutex_unlock(&wire->lock);
    *pump = (pump_t){.ticked_ns = now_ns, .sending = 1};
}

/* Writes frames of this tick while the line takes them. A tick has a bounded number of frames. */
static void write_frames(wire_t *wire, pump_t *pump)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    while (pump->sending && line_has_room(&wire->line)) {
        (void)pthread_mutex_lock(&wire->lock);
        const size_t size = fcsl_link_next_frame(&wire->link, frame);
        (void)pthread_mutex_unlock(&wire->lock);
        if (size == 0) {
            pump->sending = 0;
        } else {
            line_write(&wire->line, frame, size);
        }
    }
    /* Nobody is there: what is due counts as lost. */
    pump->sending = pump->sending && wire->line.fd >= 0 && (!wire->line.answers || wire->line.peer_length != 0);
}

static void read_line(wire_t *wire, pump_t *pump)
{
    (void)pthread_mutex_lock(&wire->lock);
    const uint64_t messages = wire->link.ports[PORT].counters.received;
    const uint64_t frames = wire->link.counters.frames_taken;
    const int disconnected = line_read(&wire->line, &wire->link) != 0;
    pump->received = pump->received || wire->link.counters.frames_taken != frames;
    const int news = disconnected || wire->link.ports[PORT].counters.received != messages;
    wire->garbage = wire->line.decoder.garbage;
    wire->failures = wire->line.failures;
    wire->disconnected = wire->disconnected || disconnected;
    wire->has_peer = !disconnected;
    (void)pthread_mutex_unlock(&wire->lock);
    if (disconnected) {
        line_drop(&wire->line);
    }
    if (news) {
        notify(wire->news);
    }
}

/* One that only holds a connection keeps nobody out. */
static void accept_peer(wire_t *wire)
{
    if (line_accept(&wire->line) != 0) {
        const struct timespec poll = {.tv_nsec = POLL_NS};
        (void)nanosleep(&poll, NULL); /* it is still there to be accepted, perhaps when a descriptor is free */
        return;
    }
    (void)pthread_mutex_lock(&wire->lock);
    wire->has_peer = 1;
    wire->spoken = 0;
    (void)pthread_mutex_unlock(&wire->lock);
}

static int has_spoken(wire_t *wire)
{
    (void)pthread_mutex_lock(&wire->lock);
    const int spoken = wire->spoken;
    (void)pthread_mutex_unlock(&wire->lock);
    return spoken;
}

/* Waits for the line, for the user, or for the time of the next tick. */
static void serve(wire_t *wire, pump_t *pump)
{
    const line_t *line = &wire->line;
    const int listens = line->listener >= 0 && (line->fd < 0 || !has_spoken(wire));
    const int blocked = pump->sending && !line->serial; /* a serial line tells nothing of room: it is looked at again */
    struct pollfd entries[3] = {
        {.fd = wire->wake, .events = POLLIN},
        {.fd = line->fd, .events = (short)(POLLIN | (blocked ? POLLOUT : 0))},
        {.fd = listens ? line->listener : -1, .events = POLLIN}, /* -1 is passed over */
    };
    /* Where the line has no room, no tick is due. */
    const uint64_t wait_ns = line->serial ? POLL_NS : wire->tick_ns;
    const struct timespec left = pump->sending ? fcsl_timespec_of(wait_ns) : fcsl_time_left(next_tick_ns(wire, pump));
    if (ppoll(entries, 3, &left, NULL) <= 0) {
        return;
    }
    if (entries[0].revents != 0) {
        clear(wire->wake);
        pump->is_used = 1;
    }
    if ((entries[1].revents & (POLLIN | POLLHUP | POLLERR)) != 0) {
        read_line(wire, pump);
    }
    if (entries[2].revents != 0) {
        accept_peer(wire);
    }
}

static int stopped(wire_t *wire)
{
    (void)pthread_mutex_lock(&wire->lock);
    const int stop = wire->stop;
    (void)pthread_mutex_unlock(&wire->lock);
    return stop;
}

static void *run(void *argument)
{
    wire_t *wire = argument;
    pump_t pump = {.is_used = 1, .received = 1};
    while (!stopped(wire)) {
        const uint64_t now_ns = fcsl_monotonic_ns();
        if (!pump.sending && now_ns >= next_tick_ns(wire, &pump)) {
            tick(wire, &pump, now_ns);
        }
        write_frames(wire, &pump);
        serve(wire, &pump);
    }
    /* The last acknowledgements. */
    tick(wire, &pump, fcsl_monotonic_ns());
    write_frames(wire, &pump);
    return NULL;
}

/* ---- the user ------------------------------------------------------------------------------------------------------ */

/* Messages that the peer has not acknowledged as a whole. */
static uint32_t waiting(const fcsl_link_t *link)
{
    const fcsl_link_outgoing_t *out = &link->ports[PORT].out;
    uint32_t messages = 0;
    for (uint32_t i = 0; i < out->count; i++) {
        messages += (out->frames[(out->first + i) % FCSL_LINK_QUEUE].flags & FCSL_LINK_LAST) != 0u;
    }
    return messages;
}

static fcsl_wire_status_t link_send(void *ctx, const uint8_t *message, size_t size)
{
    wire_t *wire = ctx;
    (void)pthread_mutex_lock(&wire->lock);
    const int closed = wire->disconnected || (!wire->has_peer && wire->line.listener < 0);
    const fcsl_link_status_t status = closed ? FCSL_LINK_EMPTY
                                      : waiting(&wire->link) >= WAITING_MAX
                                          ? FCSL_LINK_FULL
                                          : fcsl_link_send(&wire->link, PORT, message, size);
    wire->spoken = 1;
    (void)pthread_mutex_unlock(&wire->lock);
    if (closed) {
        return FCSL_WIRE_CLOSED;
    }
    if (status == FCSL_LINK_FULL) {
        return FCSL_WIRE_NONE;
    }
    if (status != FCSL_LINK_OK) {
        (void)snprintf(wire->text, sizeof wire->text, "a message of %zu bytes is too long for the link", size);
        return FCSL_WIRE_ERROR;
    }
    notify(wire->wake);
    return FCSL_WIRE_OK;
}

/* The oldest message that fits, if there is one. What does not fit is dropped. */
static fcsl_wire_status_t take(wire_t *wire, uint8_t *message, size_t capacity, size_t *size)
{
    fcsl_wire_status_t status = FCSL_WIRE_NONE;
    (void)pthread_mutex_lock(&wire->lock);
    fcsl_link_status_t got = fcsl_link_receive(&wire->link, PORT, message, capacity, size);
    while (got == FCSL_LINK_TOO_LARGE) { /* every turn takes a message out of the port */
        wire->too_large++;
        (void)fcsl_link_receive(&wire->link, PORT, wire->dropped, sizeof wire->dropped, size);
        got = fcsl_link_receive(&wire->link, PORT, message, capacity, size);
    }
    if (got == FCSL_LINK_OK) {
        status = FCSL_WIRE_OK;
    } else if (wire->disconnected || (!wire->has_peer && wire->line.listener < 0)) {
        wire->disconnected = 0;
        status = FCSL_WIRE_CLOSED;
    }
    (void)pthread_mutex_unlock(&wire->lock);
    return status;
}

static fcsl_wire_status_t link_receive(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity, size_t *size)
{
    wire_t *wire = ctx;
    for (;;) { /* ends at the deadline, whatever arrives */
        clear(wire->news);
        const fcsl_wire_status_t status = take(wire, message, capacity, size);
        if (status != FCSL_WIRE_NONE || fcsl_monotonic_ns() >= deadline_ns) {
            return status;
        }
        struct pollfd entry = {.fd = wire->news, .events = POLLIN};
        const struct timespec left = fcsl_time_left(deadline_ns);
        if (ppoll(&entry, 1, &left, NULL) < 0) {
            return FCSL_WIRE_NONE; /* a signal */
        }
    }
}

static const char *link_explain(void *ctx)
{
    return ((const wire_t *)ctx)->text;
}

static void link_count(void *ctx, void *values)
{
    wire_t *wire = ctx;
    (void)pthread_mutex_lock(&wire->lock);
    const counters_t now = {
        .connected = (uint64_t)(fcsl_link_connected(&wire->link) != 0),
        .link = wire->link.counters,
        .port = wire->link.ports[PORT].counters,
        .garbage = wire->garbage,
        .failures = wire->failures,
        .too_large = wire->too_large + wire->link.ports[PORT].counters.too_large,
    };
    (void)pthread_mutex_unlock(&wire->lock);
    memcpy(values, &now, sizeof now);
}

/* Whether the peer has all that was sent, or is not there to take it. */
static int is_delivered(wire_t *wire)
{
    (void)pthread_mutex_lock(&wire->lock);
    const int done = wire->link.ports[PORT].out.count == 0 || !fcsl_link_connected(&wire->link) || wire->disconnected ||
                     !wire->has_peer;
    (void)pthread_mutex_unlock(&wire->lock);
    return done;
}

static void release(wire_t *wire)
{
    line_close(&wire->line);
    if (wire->wake >= 0) {
        (void)close(wire->wake);
    }
    if (wire->news >= 0) {
        (void)close(wire->news);
    }
    free(wire);
}

static void link_close(void *ctx)
{
    wire_t *wire = ctx;
    const uint64_t deadline_ns = fcsl_monotonic_ns() + CLOSE_NS;
    const struct timespec poll = {.tv_nsec = POLL_NS};
    while (!is_delivered(wire) && fcsl_monotonic_ns() < deadline_ns) {
        (void)nanosleep(&poll, NULL);
    }
    (void)pthread_mutex_lock(&wire->lock);
    wire->stop = 1;
    (void)pthread_mutex_unlock(&wire->lock);
    notify(wire->wake);
    (void)pthread_join(wire->thread, NULL);
    (void)pthread_mutex_destroy(&wire->lock);
    release(wire);
}

/* ---- opening ------------------------------------------------------------------------------------------------------- */

/* The step thread may run at a real-time priority: who holds the lock then runs at it, too. */
static int make_lock(pthread_mutex_t *lock)
{
    pthread_mutexattr_t attributes;
    if (pthread_mutexattr_init(&attributes) != 0) {
        return -1;
    }
    int code = pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    code = code == 0 ? pthread_mutex_init(lock, &attributes) : code;
    (void)pthread_mutexattr_destroy(&attributes);
    return code == 0 ? 0 : -1;
}

/* Signals belong to the program's own threads. */
static int start(wire_t *wire)
{
    sigset_t all;
    sigset_t before;
    if (make_lock(&wire->lock) != 0) {
        return -1;
    }
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int code = pthread_create(&wire->thread, NULL, run, wire);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (code != 0) {
        (void)pthread_mutex_destroy(&wire->lock);
    }
    return code == 0 ? 0 : -1;
}

/* Differs from start to start, of one program and of several: the nanoseconds and the process number, mixed. */
static uint16_t new_session(fcsl_wire_side_t side)
{
    uint64_t mixed = (fcsl_monotonic_ns() ^ ((uint64_t)getpid() << 32u)) * UINT64_C(0x9E3779B97F4A7C15);
    const uint16_t session = (uint16_t)(mixed >> 48u);
    /* The two ends never take the same one. */
    return side == FCSL_WIRE_LISTEN ? (uint16_t)((session & 0xfffeu) | (session < 2u ? 2u : 0u))
                                    : (uint16_t)(session | 1u);
}

int fcsl_wire_over_link(const line_t *line, fcsl_wire_side_t side, size_t message_max, fcsl_wire_t *wire,
                        fcsl_error_t *error)
{
    fcsl_link_policy_t policies[FCSL_LINK_PORTS] = {[PORT] = FCSL_LINK_RELIABLE};
    const size_t most = FCSL_LINK_BUFFER - FCSL_LINK_SIZE_BYTES;
    wire_t *self = message_max <= most ? calloc(1, sizeof *self) : NULL;
    if (self == NULL) {
        line_t owned = *line;
        line_close(&owned);
        if (message_max > most) {
            (void)fcsl_fail(error,
                            "a message of the machine may have %zu bytes, and the link carries %zu: use unix:PATH",
                            message_max, most);
        } else {
            (void)fcsl_fail(error, "out of memory for the wire");
        }
        return -1;
    }
    const int stream = !line->datagrams && !line->serial;
    self->line = *line;
    self->has_peer = line->fd >= 0;
    self->tick_ns = line->frame_ns > TICK_NS ? line->frame_ns : TICK_NS;
    self->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    self->news = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (self->wake < 0 || self->news < 0 ||
        fcsl_link_open(&self->link, policies, new_session(side), stream ? RETRANSMIT_TICKS_TCP : RETRANSMIT_TICKS) !=
            0 ||
        start(self) != 0) {
        release(self);
        return fcsl_fail(error, "cannot start the thread of the wire");
    }
    *wire = (fcsl_wire_t){
        .ctx = self,
        .send = link_send,
        .receive = link_receive,
        .explain = link_explain,
        .close = link_close,
        .counters = &fcsl_wire_link_counters,
        .count = link_count,
    };
    return 0;
}
