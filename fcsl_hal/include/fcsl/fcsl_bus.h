/* SPDX-License-Identifier: Apache-2.0
 *
 * A session on the bus: messages under keys, over Zenoh (docs/reference/transports.md). One thread, that which steps a machine, posts, takes and
 * waits; none of these allocates, and only fcsl_bus_wait waits. Threads of the session talk to Zenoh and meet that thread in
 * memory that fcsl_bus_open allocates.
 */
#ifndef FCSL_BUS_H
#define FCSL_BUS_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Most bytes of a message, of a key, and most keys of each kind in a session. */
#define FCSL_BUS_MESSAGE_MAX (1u << 20)
#define FCSL_BUS_KEY_MAX     255u
#define FCSL_BUS_KEYS_MAX    1024u
/* Tokens may say more: that of a ROS 2 topic has names, type, hash and quality of service. */
#define FCSL_BUS_TOKEN_MAX 1023u
/* Most bytes that fcsl_bus_open allocates for the inputs and the ring. */
#define FCSL_BUS_MEMORY_MAX (256u << 20)

typedef struct fcsl_bus fcsl_bus_t;

typedef enum {
    FCSL_BUS_LISTEN = 0, /* a peer that others connect to; they see each other through it */
    FCSL_BUS_CLIENT = 1, /* connects to one that listens */
    FCSL_BUS_PEER = 2    /* the same, among equals */
} fcsl_bus_role_t;

/* A key to receive on, or an expression with stars (`lander/engine/` and a star): the messages of several keys, in their order. */
typedef struct {
    const char *key;
    uint32_t bytes; /* of the longest message */
    uint32_t least; /* of the shortest one */
    uint32_t depth; /* 1: fcsl_bus_take gets the newest message; more: as many wait, and the next one is dropped */
    int quiet; /* its messages do not end fcsl_bus_wait: others follow that do */
    /* Whether a message takes a place; null: each does. Zenoh's threads call it with `what`. */
    int (*fits)(uint64_t what, const uint8_t *bytes, size_t size);
    uint64_t what;
} fcsl_bus_input_t;

/* A key that answers queries, with these bytes until fcsl_bus_answer replaces them; with none it is silent. They are copied. */
typedef struct {
    const char *key;
    const void *bytes;
    uint32_t size;
} fcsl_bus_answer_t;

/* All other keys are concrete (`lander/engine/throttle`). Each kind is numbered by place. */
typedef struct {
    fcsl_bus_role_t role;
    const char
        *endpoint;    /* "tcp:HOST:PORT", HOST a number or `localhost`; nothing else is connected to or listened on */
    const char
        *config_path; /* instead of an endpoint: a Zenoh configuration file, and nothing but what it says; or null */
    uint32_t timeout_ms;     /* how long fcsl_bus_open tries to connect; 0: once */
    int connects_later; /* of those that connect: fcsl_bus_open does not wait, and the session connects when somebody listens. All
                           that stands here must outlive it */
    int observer; /* messages of this session give way to all others, and are dropped where a receiver is slow */
    int attaches; /* beside each message stand its number, the system's time and the publisher's GID, as rmw_zenoh requires */
    uint32_t ring_bytes; /* for what is posted and not yet put; a message may take half of it */
    const char *const *outputs;
    uint32_t output_count;
    uint32_t
        latched_count; /* the first so many: who subscribes later, as Zenoh's advanced subscribers do, gets their last message */
    const fcsl_bus_input_t *inputs;
    uint32_t input_count;
    /* The last so many inputs are services: queries for their keys are their messages, one at a time. What is posted for output
     * `output_count` + i answers that of service i. Meanwhile other queries get the bytes of `busy`. */
    uint32_t service_count;
    const void *busy;
    uint32_t busy_bytes;
    const char *const *
        tokens; /* while this session lives, others see these; the session's number stands for `{zid}` in them, or else behind them */
    uint32_t token_count;
    const fcsl_bus_answer_t *answers;
    uint32_t answer_count;
    const char *const *watched; /* tokens of other sessions */
    uint32_t watched_count;
    const char *
        strays; /* a key expression (`lander/` and two stars), or null: messages there that no input takes are counted */
} fcsl_bus_options_t;

typedef struct {
    uint64_t posted; /* messages that fcsl_bus_post took */
    uint64_t refused; /* those that it did not: no room, or longer than half of the ring */
    uint64_t put; /* of the posted ones, handed to Zenoh. With nobody there Zenoh takes them, too */
    uint64_t put_failed; /* of the posted ones, refused by Zenoh */
    uint64_t received; /* messages on the keys of inputs */
    uint64_t replaced; /* of these, never taken because a newer one came (depth 1) */
    uint64_t overflowed; /* of these, dropped because `depth` messages waited */
    uint64_t
        wrong_size; /* of these, dropped because they are longer than the input's `bytes` or shorter than its `least` */
    uint64_t misfits; /* of these, dropped because they do not fit the input */
    uint64_t deletions; /* of these, no message but Zenoh's delete: dropped */
    uint64_t strays; /* messages under `strays` on keys that no input has */
    uint64_t connects; /* sessions that were connected to this one, looked at every 50 ms */
    uint64_t disconnects;
} fcsl_bus_counters_t;

/* Opens a session, declares all that is in `options` and starts its threads. A session that listens opens at once, or fails;
 * others wait for one that listens. Returns 0, or -1 with `error` filled. */
int fcsl_bus_open(const fcsl_bus_options_t *options, fcsl_bus_t **bus, fcsl_error_t *error);

/* Takes a message for an output; messages leave in their order, also those of different outputs. Returns 0, or -1: refused and
 * counted. */
int fcsl_bus_post(fcsl_bus_t *bus, uint32_t output, const void *bytes, size_t size);

/* Copies the next message of an input (depth 1: the newest one) and sets *size: 1. 0: none came since the last call.
 * `bytes` has room for as many as the input's `bytes`. */
int fcsl_bus_take(fcsl_bus_t *bus, uint32_t input, void *bytes, size_t *size);

/* Replaces the bytes of an answer. Copies them, may wait for a query that is being answered: not from the thread that steps.
 * Returns 0, or -1: no such answer, too long, or no memory. */
int fcsl_bus_answer(fcsl_bus_t *bus, uint32_t answer, const void *bytes, size_t size);

/* Waits until a message came for an input that is not quiet, or something that the three functions below tell changed, since the
 * last call of this: 1. 0 at
 * `deadline_ns` of CLOCK_MONOTONIC, or when a signal is caught. */
int fcsl_bus_wait(fcsl_bus_t *bus, uint64_t deadline_ns);

/* Whether some other session has an input for the output. */
int fcsl_bus_matched(const fcsl_bus_t *bus, uint32_t output);

/* How many other sessions with the watched token live. One that is killed or frozen leaves within the lease (1 s). */
uint32_t fcsl_bus_token_count(const fcsl_bus_t *bus, uint32_t watched);

/* How many sessions this one is connected to. */
uint32_t fcsl_bus_peers(const fcsl_bus_t *bus);

/* May be called from any thread. */
void fcsl_bus_count(const fcsl_bus_t *bus, fcsl_bus_counters_t *counters);

/* Puts what was posted, ends the session and frees it. Returns 0, or -1 when Zenoh does not end within `timeout_ms`: then what
 * is left of the session stays until it does, or the process ends. */
int fcsl_bus_close(fcsl_bus_t *bus, uint32_t timeout_ms);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_BUS_H */
