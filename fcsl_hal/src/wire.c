/* SPDX-License-Identifier: Apache-2.0
 *
 * The controller's end of the wire. An I/O thread takes packets off the socket, checks them and fills slots; the step
 * thread takes messages out of the slots, waiting on a condition variable with a time limit, and sends without waiting.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_socket.h"
#include "wire_packet.h"

enum { SLOTS = 4, TEXT_BYTES = 512, CONNECT_RETRY_MS = 20 };

typedef enum { LINK_UP = 0, LINK_ENDED = 1, LINK_LOST = 2, LINK_INTERRUPTED = 3 } link_t;

typedef struct {
    fcsl_message_t message; /* its bytes are in `bytes` */
    uint8_t *bytes;
} slot_t;

typedef struct {
    fcsl_channel_table_t table;
    uint32_t timeout_ms;
    int fd;
    int stop; /* eventfd: ends the I/O thread */
    pthread_t thread;
    size_t slot_bytes;
    uint8_t *inbox;      /* I/O thread only; slot_bytes */
    char text[TEXT_BYTES]; /* step thread only */

    pthread_mutex_t lock; /* guards what follows */
    pthread_cond_t changed;
    slot_t slots[SLOTS];
    uint32_t first;
    uint32_t used;
    link_t link;
    int stopping;
    uint64_t messages_dropped;
} wire_t;

static void set_link(wire_t *wire, link_t link)
{
    (void)pthread_mutex_lock(&wire->lock);
    if (wire->link == LINK_UP) {
        wire->link = link;
    }
    (void)pthread_cond_broadcast(&wire->changed);
    (void)pthread_mutex_unlock(&wire->lock);
}

/* The message with its bytes copied to `bytes`. */
static fcsl_message_t moved(const fcsl_message_t *message, uint8_t *bytes)
{
    fcsl_message_t copy = *message;
    memcpy(bytes, message->bytes, message->size);
    copy.bytes = bytes;
    return copy;
}

/* Puts the message in the inbox into a slot, waiting for a free one; the socket's own buffer holds back the peer. */
static void store_message(wire_t *wire, const fcsl_message_t *message)
{
    (void)pthread_mutex_lock(&wire->lock);
    while (wire->used == SLOTS && !wire->stopping) {
        (void)pthread_cond_wait(&wire->changed, &wire->lock);
    }
    if (wire->used < SLOTS) {
        slot_t *slot = &wire->slots[(wire->first + wire->used) % SLOTS];
        slot->message = moved(message, slot->bytes);
        wire->used++;
        (void)pthread_cond_broadcast(&wire->changed);
    }
    (void)pthread_mutex_unlock(&wire->lock);
}

/* Takes one packet off the socket; returns 0 when the link is over. */
static int receive_packet(wire_t *wire)
{
    const ssize_t got = recv(wire->fd, wire->inbox, wire->slot_bytes, MSG_DONTWAIT | MSG_TRUNC);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return 1;
    }
    if (got <= 0) {
        set_link(wire, LINK_LOST);
        return 0;
    }
    const size_t size = (size_t)got;
    fcsl_message_t message;
    fcsl_wire_packet_t packet;
    if (size <= wire->slot_bytes &&
        fcsl_message_check(&wire->table, FCSL_SENSOR_MESSAGE, wire->inbox, size, &message) == FCSL_MESSAGE_OK) {
        store_message(wire, &message);
    } else if (size <= wire->slot_bytes && fcsl_wire_parse(wire->inbox, size, &packet) == 0 &&
               packet.kind == FCSL_WIRE_END) {
        set_link(wire, LINK_ENDED);
        return 0;
    } else {
        (void)pthread_mutex_lock(&wire->lock);
        wire->messages_dropped++;
        (void)pthread_mutex_unlock(&wire->lock);
    }
    return 1;
}

static void *run_io(void *argument)
{
    wire_t *wire = argument;
    for (;;) {
        struct pollfd entries[2] = {{.fd = wire->fd, .events = POLLIN}, {.fd = wire->stop, .events = POLLIN}};
        if (poll(entries, 2, -1) < 0 && errno != EINTR) {
            set_link(wire, LINK_LOST);
            return NULL;
        }
        if (entries[1].revents != 0 || (entries[0].revents != 0 && !receive_packet(wire))) {
            return NULL;
        }
    }
}

/* Takes the message of `tick` out of the slots if it is there; older ones are dropped. Called with the lock held. */
static fcsl_hal_status_t take_message(wire_t *wire, uint64_t tick, uint8_t *bytes, size_t capacity,
                                      fcsl_message_t *message)
{
    while (wire->used > 0) {
        const slot_t *slot = &wire->slots[wire->first];
        if (slot->message.tick > tick) {
            (void)snprintf(wire->text, sizeof wire->text,
                           "sensor message of tick %" PRIu64 " came while tick %" PRIu64 " was due", slot->message.tick,
                           tick);
            return FCSL_HAL_ERROR;
        }
        const int wanted = slot->message.tick == tick && slot->message.size <= capacity;
        if (wanted) {
            *message = moved(&slot->message, bytes);
        } else {
            wire->messages_dropped++;
        }
        wire->first = (wire->first + 1u) % SLOTS;
        wire->used--;
        (void)pthread_cond_broadcast(&wire->changed);
        if (wanted) {
            return FCSL_HAL_OK;
        }
    }
    if (wire->link == LINK_ENDED) {
        (void)snprintf(wire->text, sizeof wire->text, "the simulator ended the run at tick %" PRIu64, tick);
        return FCSL_HAL_CLOSED;
    }
    if (wire->link == LINK_LOST) {
        (void)snprintf(wire->text, sizeof wire->text, "the simulator went away before sensor message of tick %" PRIu64,
                       tick);
        return FCSL_HAL_ERROR;
    }
    return FCSL_HAL_NONE;
}

static fcsl_hal_status_t wire_sample(void *ctx, uint64_t tick, uint8_t *bytes, size_t capacity, fcsl_message_t *message)
{
    wire_t *wire = ctx;
    struct timespec deadline = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &deadline);
    const uint64_t nanoseconds = (uint64_t)deadline.tv_nsec + (uint64_t)(wire->timeout_ms % 1000u) * 1000000u;
    deadline.tv_sec += (time_t)(wire->timeout_ms / 1000u + nanoseconds / 1000000000u);
    deadline.tv_nsec = (long)(nanoseconds % 1000000000u);

    (void)pthread_mutex_lock(&wire->lock);
    fcsl_hal_status_t status = FCSL_HAL_NONE;
    int timed_out = 0;
    while (status == FCSL_HAL_NONE) {
        if (wire->link == LINK_INTERRUPTED) {
            (void)snprintf(wire->text, sizeof wire->text,
                           "interrupted while waiting for sensor message of tick %" PRIu64, tick);
            status = FCSL_HAL_CLOSED;
            break;
        }
        status = take_message(wire, tick, bytes, capacity, message);
        if (status == FCSL_HAL_NONE && timed_out) {
            (void)snprintf(wire->text, sizeof wire->text, "no sensor message of tick %" PRIu64 " within %" PRIu32 " ms",
                           tick, wire->timeout_ms);
            if (wire->messages_dropped > 0) {
                const size_t length = strlen(wire->text);
                (void)snprintf(wire->text + length, sizeof wire->text - length,
                               " (%" PRIu64 " malformed or late messages dropped)", wire->messages_dropped);
            }
            status = FCSL_HAL_TIMEOUT;
        } else if (status == FCSL_HAL_NONE) {
            timed_out = pthread_cond_timedwait(&wire->changed, &wire->lock, &deadline) != 0;
        }
    }
    (void)pthread_mutex_unlock(&wire->lock);
    return status;
}

static fcsl_hal_status_t wire_actuate(void *ctx, const fcsl_message_t *message)
{
    wire_t *wire = ctx;
    const uint64_t tick = message->tick;
    /* In lock-step no more than one message is under way, so a full buffer means that the peer is out of step. */
    if (send(wire->fd, message->bytes, message->size, MSG_NOSIGNAL | MSG_DONTWAIT) >=
        0) { /* a packet goes whole or not at all */
        return FCSL_HAL_OK;
    }
    if (errno != EPIPE && errno != ECONNRESET) {
        (void)snprintf(wire->text, sizeof wire->text, "cannot send actuator message of tick %" PRIu64 ": %s", tick,
                       strerror(errno));
        return FCSL_HAL_ERROR;
    }
    /* The simulator may have ended the run after its last sensor message: let the I/O thread read what it left. */
    (void)pthread_mutex_lock(&wire->lock);
    while (wire->link == LINK_UP && wire->used < SLOTS) {
        (void)pthread_cond_wait(&wire->changed, &wire->lock);
    }
    const link_t link = wire->link;
    (void)pthread_mutex_unlock(&wire->lock);
    (void)snprintf(wire->text, sizeof wire->text, "the simulator %s before actuator message of tick %" PRIu64,
                   link == LINK_ENDED ? "ended the run" : "went away", tick);
    return link == LINK_ENDED || link == LINK_INTERRUPTED ? FCSL_HAL_CLOSED : FCSL_HAL_ERROR;
}

static const char *wire_explain(void *ctx)
{
    return ((const wire_t *)ctx)->text;
}

static void wire_interrupt(void *ctx)
{
    set_link(ctx, LINK_INTERRUPTED);
}

static void free_wire(wire_t *wire)
{
    for (uint32_t i = 0; i < SLOTS; i++) {
        free(wire->slots[i].bytes);
    }
    free(wire->inbox);
    if (wire->fd >= 0) {
        (void)close(wire->fd);
    }
    if (wire->stop >= 0) {
        (void)close(wire->stop);
    }
    free(wire);
}

static void wire_close(void *ctx)
{
    wire_t *wire = ctx;
    (void)pthread_mutex_lock(&wire->lock);
    wire->stopping = 1;
    (void)pthread_cond_broadcast(&wire->changed);
    (void)pthread_mutex_unlock(&wire->lock);
    const uint64_t one = 1;
    if (write(wire->stop, &one, sizeof one) == (ssize_t)sizeof one) {
        (void)pthread_join(wire->thread, NULL);
    }
    (void)pthread_cond_destroy(&wire->changed);
    (void)pthread_mutex_destroy(&wire->lock);
    free_wire(wire);
}

/* Connects, trying again until the deadline while nobody listens: the two programs may start in either order. */
static int connect_until(const char *path, uint64_t deadline_ms, char *error, size_t error_size)
{
    for (;;) {
        const int fd = fcsl_socket_connect(path, SOCK_SEQPACKET, error, error_size);
        if (fd >= 0 || fcsl_wire_now_ms() >= deadline_ms) {
            return fd;
        }
        const struct timespec pause = {.tv_nsec = CONNECT_RETRY_MS * 1000000L};
        (void)nanosleep(&pause, NULL);
    }
}

static int shake_hands(wire_t *wire, uint64_t deadline_ms, char *error, size_t error_size)
{
    if (fcsl_wire_send_hello(wire->fd, &wire->table) != 0) {
        (void)snprintf(error, error_size, "cannot send the handshake: %s", strerror(errno));
        return -1;
    }
    int ready = 0;
    do {
        ready = fcsl_wire_wait_readable(wire->fd, deadline_ms);
    } while (ready < 0 && errno == EINTR);
    if (ready <= 0) {
        (void)snprintf(error, error_size, "no handshake from the simulator within %" PRIu32 " ms", wire->timeout_ms);
        return -1;
    }
    fcsl_wire_packet_t packet;
    const ssize_t size = recv(wire->fd, wire->inbox, wire->slot_bytes, MSG_DONTWAIT);
    if (size <= 0 || fcsl_wire_parse(wire->inbox, (size_t)size, &packet) != 0 || packet.kind == FCSL_WIRE_END) {
        (void)snprintf(error, error_size, "the other end of the socket did not answer as a simulator does");
        return -1;
    }
    if (packet.kind == FCSL_WIRE_REFUSAL) {
        (void)snprintf(error, error_size, "the simulator refused: %s", packet.text);
        return -1;
    }
    return fcsl_wire_differs(&packet, &wire->table, error, error_size) ? -1 : 0;
}

/* Starts the I/O thread with every signal blocked: signals belong to the program's own threads. */
static int start_thread(wire_t *wire)
{
    pthread_condattr_t attributes;
    if (pthread_condattr_init(&attributes) != 0) {
        return -1;
    }
    int code = pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    code = code == 0 ? pthread_cond_init(&wire->changed, &attributes) : code;
    (void)pthread_condattr_destroy(&attributes);
    if (code != 0) {
        return -1;
    }
    if (pthread_mutex_init(&wire->lock, NULL) != 0) {
        (void)pthread_cond_destroy(&wire->changed);
        return -1;
    }
    sigset_t all;
    sigset_t before;
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    code = pthread_create(&wire->thread, NULL, run_io, wire);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (code != 0) {
        (void)pthread_cond_destroy(&wire->changed);
        (void)pthread_mutex_destroy(&wire->lock);
        return -1;
    }
    return 0;
}

static int open_wire(wire_t *wire, const char *socket_path, char *error, size_t error_size)
{
    const uint64_t deadline_ms = fcsl_wire_now_ms() + wire->timeout_ms;
    wire->inbox = malloc(wire->slot_bytes);
    int complete = wire->inbox != NULL;
    for (uint32_t i = 0; i < SLOTS; i++) {
        wire->slots[i].bytes = malloc(wire->slot_bytes);
        complete = complete && wire->slots[i].bytes != NULL;
    }
    wire->stop = eventfd(0, EFD_CLOEXEC);
    if (!complete || wire->stop < 0) {
        (void)snprintf(error, error_size, "out of memory or descriptors for the wire");
        return -1;
    }
    wire->fd = connect_until(socket_path, deadline_ms, error, error_size);
    if (wire->fd < 0 || shake_hands(wire, deadline_ms, error, error_size) != 0) {
        return -1;
    }
    if (fcsl_wire_size_buffers(wire->fd, fcsl_message_capacity(wire->table.machine, FCSL_ACTUATOR_MESSAGE)) != 0) {
        (void)snprintf(error, error_size, "cannot make room for an actuator message in the socket: %s",
                       strerror(errno));
        return -1;
    }
    if (start_thread(wire) != 0) {
        (void)snprintf(error, error_size, "cannot start the thread of the wire");
        return -1;
    }
    return 0;
}

int fcsl_hal_wire_connect(const char *socket_path, const fcsl_machine_t *machine, uint32_t timeout_ms, fcsl_hal_t *hal,
                          char *error, size_t error_size)
{
    wire_t *wire = calloc(1, sizeof *wire);
    if (wire == NULL) {
        (void)snprintf(error, error_size, "out of memory for the wire");
        return -1;
    }
    const size_t capacity = fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE);
    wire->table = fcsl_channel_table(machine);
    wire->timeout_ms = timeout_ms;
    wire->fd = -1;
    wire->stop = -1;
    wire->slot_bytes = capacity > FCSL_WIRE_PACKET_MAX ? capacity : FCSL_WIRE_PACKET_MAX;
    if (open_wire(wire, socket_path, error, error_size) != 0) {
        free_wire(wire);
        return -1;
    }
    *hal = (fcsl_hal_t){
        .ctx = wire,
        .sample = wire_sample,
        .actuate = wire_actuate,
        .explain = wire_explain,
        .interrupt = wire_interrupt,
        .close = wire_close,
        .serves = 1,
        .paces = 1,
    };
    return 0;
}
