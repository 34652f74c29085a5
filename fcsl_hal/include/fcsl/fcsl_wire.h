/* SPDX-License-Identifier: Apache-2.0
 *
 * A wire carries messages between a controller and a simulator or rig: send and receive, nothing else. What the messages are
 * it does not know (fcsl_codec.h makes them). docs/reference/transports.md shows how to write one.
 *
 * A message arrives whole or not at all, and messages arrive in their order. Nothing here allocates, and send never waits.
 */
#ifndef FCSL_WIRE_H
#define FCSL_WIRE_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    FCSL_WIRE_OK = 0,
    FCSL_WIRE_NONE = 1,   /* receive: no message came; send: no room now, the message was not taken */
    FCSL_WIRE_CLOSED = 2, /* the peer is gone. A wire that listens then waits for the next one */
    FCSL_WIRE_ERROR = 3
} fcsl_wire_status_t;

/* What a wire counts, for whoever looks on: `bytes` of a struct of uint64_t that `fields` describe. */
typedef struct {
    const fcsl_field_t *fields;
    uint32_t field_count;
    uint32_t bytes; /* FCSL_WIRE_COUNTERS_MAX at most */
} fcsl_wire_counters_t;

enum { FCSL_WIRE_COUNTERS_MAX = 512 };

typedef struct {
    void *ctx;
    fcsl_wire_status_t (*send)(void *ctx, const uint8_t *message, size_t size);
    /* Waits for a message until `deadline_ns` of CLOCK_MONOTONIC (0: not at all), or until a signal is caught. Sets *size on
     * FCSL_WIRE_OK alone. What is longer than `capacity` is dropped and counted. */
    fcsl_wire_status_t (*receive)(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity, size_t *size);
    /* What the last FCSL_WIRE_ERROR was about; never null. */
    const char *(*explain)(void *ctx);
    /* Delivers what was sent, for a bounded time, and ends. */
    void (*close)(void *ctx);
    const fcsl_wire_counters_t *counters;
    /* Fills such a struct. */
    void (*count)(void *ctx, void *values);
} fcsl_wire_t;

/* A row of `fields`: a member of the struct, and its path behind `hal.`. */
#define FCSL_WIRE_COUNTER(type_, path_, member_, doc_)                                                                 \
    {.path = path_,                                                                                                    \
     .role = FCSL_ROLE_OUTPUT,                                                                                         \
     .type = FCSL_U64,                                                                                                 \
     .count = 1,                                                                                                       \
     .offset = offsetof(type_, member_),                                                                               \
     .size = sizeof(uint64_t),                                                                                         \
     .instance = FCSL_NONE,                                                                                            \
     .connected_from = FCSL_NONE,                                                                                      \
     .unit = "",                                                                                                       \
     .doc = doc_}

typedef enum {
    FCSL_WIRE_LISTEN = 0, /* the simulator's end: opens at once, the peer may come later */
    FCSL_WIRE_CONNECT = 1 /* the controller's end: waits for a peer that listens */
} fcsl_wire_side_t;

/* What a SPEC may be, for messages and usage texts. */
#define FCSL_WIRE_SPECS "unix:PATH, udp:HOST:PORT, tcp:HOST:PORT, uart:DEVICE:BAUD or zenoh:tcp:HOST:PORT"

/* 0 when `spec` has the form of one of FCSL_WIRE_SPECS, or -1 with `error` filled. Opens nothing. */
int fcsl_wire_check(const char *spec, fcsl_error_t *error);

/* What the wire counts that such a `spec` names. */
const fcsl_wire_counters_t *fcsl_wire_counters(const char *spec);

/* Opens the wire that `spec` names, for messages of up to `message_max` bytes. FCSL_WIRE_CONNECT tries again for `timeout_ms`
 * while nobody listens: two programs may start in either order. Returns 0, or with `error` filled -1, or 1 where nobody listened
 * on a Unix socket all the time. */
int fcsl_wire_open(const char *spec, fcsl_wire_side_t side, size_t message_max, uint32_t timeout_ms, fcsl_wire_t *wire,
                   fcsl_error_t *error);

/* Two ends within a process, joined by the link layer over a socket pair. */
int fcsl_wire_pair(size_t message_max, fcsl_wire_t ends[2], fcsl_error_t *error);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_WIRE_H */
