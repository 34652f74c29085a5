/* SPDX-License-Identifier: Apache-2.0
 *
 * A wire of your own (docs/reference/transports.md): it puts messages into a pipe, behind their size.
 */
#include <errno.h>
#include <poll.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_wire.h"

enum { MESSAGE_MAX = 1024, SIZE_BYTES = 2 };

typedef struct {
    uint64_t too_large;
} counters_t;

static const fcsl_field_t PIPE_FIELDS[] = {
    FCSL_WIRE_COUNTER(counters_t, "wire.too_large", too_large, "messages dropped because they were too long"),
};
static const fcsl_wire_counters_t PIPE_COUNTERS = {
    .fields = PIPE_FIELDS, .field_count = 1, .bytes = sizeof(counters_t)};

/* Two pipes that do not block (O_NONBLOCK), in a program that ignores SIGPIPE. Writes of up to PIPE_BUF bytes go whole or not
 * at all. */
typedef struct {
    int in;
    int out;
    uint8_t bytes[SIZE_BYTES + MESSAGE_MAX]; /* what has come of the next message */
    size_t have;
    counters_t counters;
} pipe_wire_t;

static fcsl_wire_status_t pipe_send(void *ctx, const uint8_t *message, size_t size)
{
    const pipe_wire_t *wire = ctx;
    uint8_t bytes[SIZE_BYTES + MESSAGE_MAX] = {(uint8_t)size, (uint8_t)(size >> 8)};
    if (size > MESSAGE_MAX) {
        return FCSL_WIRE_ERROR;
    }
    memcpy(bytes + SIZE_BYTES, message, size);
    if (write(wire->out, bytes, SIZE_BYTES + size) > 0) {
        return FCSL_WIRE_OK;
    }
    return errno == EAGAIN ? FCSL_WIRE_NONE : FCSL_WIRE_CLOSED;
}

/* Reads up to `wanted` bytes of the next message: 1 when they are there, 0 when not yet, -1 when the peer is gone. */
static int fill(pipe_wire_t *wire, size_t wanted)
{
    if (wire->have < wanted) {
        const ssize_t got = read(wire->in, wire->bytes + wire->have, wanted - wire->have);
        if (got == 0) {
            return -1;
        }
        wire->have += got > 0 ? (size_t)got : 0u;
    }
    return wire->have == wanted;
}

static fcsl_wire_status_t take(pipe_wire_t *wire, uint8_t *message, size_t capacity, size_t *size)
{
    const int has_size = wire->have >= SIZE_BYTES ? 1 : fill(wire, SIZE_BYTES);
    if (has_size <= 0) {
        return has_size < 0 ? FCSL_WIRE_CLOSED : FCSL_WIRE_NONE;
    }
    const size_t length = (size_t)(wire->bytes[0] | wire->bytes[1] << 8);
    const int has_all = length <= MESSAGE_MAX ? fill(wire, SIZE_BYTES + length) : -1;
    if (has_all <= 0) {
        return has_all < 0 ? FCSL_WIRE_CLOSED : FCSL_WIRE_NONE;
    }
    wire->have = 0;
    if (length > capacity) {
        wire->counters.too_large++;
        return FCSL_WIRE_NONE;
    }
    memcpy(message, wire->bytes + SIZE_BYTES, length);
    *size = length;
    return FCSL_WIRE_OK;
}

static fcsl_wire_status_t pipe_receive(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity, size_t *size)
{
    pipe_wire_t *wire = ctx;
    for (;;) { /* every turn reads something, or waits */
        struct timespec now;
        struct pollfd entry = {.fd = wire->in, .events = POLLIN};
        const fcsl_wire_status_t status = take(wire, message, capacity, size);
        (void)clock_gettime(CLOCK_MONOTONIC, &now);
        const uint64_t now_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
        if (status != FCSL_WIRE_NONE || now_ns >= deadline_ns ||
            poll(&entry, 1, (int)((deadline_ns - now_ns) / 1000000u + 1u)) < 0) {
            return status;
        }
    }
}

static const char *pipe_explain(void *ctx)
{
    (void)ctx;
    return "a message is too long for the pipe";
}

static void pipe_count(void *ctx, void *values)
{
    memcpy(values, &((const pipe_wire_t *)ctx)->counters, sizeof(counters_t));
}

static void pipe_close(void *ctx)
{
    const pipe_wire_t *wire = ctx;
    (void)close(wire->in);
    (void)close(wire->out);
}

fcsl_wire_t pipe_wire(pipe_wire_t *wire)
{
    return (fcsl_wire_t){.ctx = wire,
                         .send = pipe_send,
                         .receive = pipe_receive,
                         .explain = pipe_explain,
                         .close = pipe_close,
                         .counters = &PIPE_COUNTERS,
                         .count = pipe_count};
}
