/* SPDX-License-Identifier: Apache-2.0
 *
 * A Zenoh session, for bus.c alone; a Rust library implements it (io/src/zenoh.rs). It allocates, locks and waits, so the thread
 * that steps a machine calls nothing here.
 */
#ifndef FCSL_ZENOH_SESSION_H
#define FCSL_ZENOH_SESSION_H

#include <stddef.h>
#include <stdint.h>

typedef struct fcsl_zenoh fcsl_zenoh_t;

/* What Zenoh's threads call, several of them at a time. `number` is that of the declaration. */
typedef struct {
    void *ctx;
    /* A put, or a delete (null, 0). */
    void (*sample)(void *ctx, uint32_t number, const uint8_t *bytes, size_t size);
    void (*stray)(void *ctx);
    void (*matching)(void *ctx, uint32_t number, int matching);
    /* How many tokens of a watched key there are. */
    void (*tokens)(void *ctx, uint32_t number, uint32_t count);
    /* The last call: none of the others runs, and none will. Once for each fcsl_zenoh_open, whatever that returned. */
    void (*release)(void *ctx);
} fcsl_zenoh_events_t;

/* Opens a session with the configuration file `path`, or where that is null with `config` (JSON5). Waits as long as the
 * configuration says. Returns 0, or -1 with `error` filled, as all below. */
int fcsl_zenoh_open(const char *path, const char *config, const fcsl_zenoh_events_t *events, fcsl_zenoh_t **out,
                    char *error, size_t error_size);

/* Declares a key to put on. The declarations are numbered from 0, and so are those of each kind below. `droppable` messages
 * give way when a receiver is slow, others make fcsl_zenoh_put wait. Of a `latched` one Zenoh's advanced subscribers get the last
 * message when they come later. Beside the messages of one that `attaches` stands what rmw_zenoh puts there. */
int fcsl_zenoh_declare_output(fcsl_zenoh_t *session, uint32_t number, const char *key, int droppable, int latched,
                              int attaches, char *error, size_t error_size);

/* Calls `sample` for what other sessions put on keys that `key` (an expression) includes. */
int fcsl_zenoh_declare_input(fcsl_zenoh_t *session, uint32_t number, const char *key, char *error, size_t error_size);

/* Calls `stray` for what other sessions put on keys that `key` includes, and no input that was declared before. */
int fcsl_zenoh_declare_strays(fcsl_zenoh_t *session, const char *key, char *error, size_t error_size);

/* Answers queries for `key` with these bytes, which are copied; with none it does not answer. */
int fcsl_zenoh_declare_answer(fcsl_zenoh_t *session, const char *key, const uint8_t *bytes, size_t size, char *error,
                              size_t error_size);

/* Declares a service, after all outputs: calls `sample` with the payload of a query for `key`. The next fcsl_zenoh_put for the
 * output behind those that were declared, and the services before this one, is its reply. Until then other queries get the bytes
 * of `busy`; one without a payload, or with more than `most` bytes, gets nothing: `sample` is called
 * as for a delete, or with a byte more than `most`. */
int fcsl_zenoh_declare_service(fcsl_zenoh_t *session, uint32_t number, const char *key, size_t most,
                               const uint8_t *busy, size_t busy_size, char *error, size_t error_size);

/* A liveliness token, while the session lives: `key`, with the session's number in the place of `{zid}`, or else behind it. */
int fcsl_zenoh_declare_token(fcsl_zenoh_t *session, const char *key, char *error, size_t error_size);

/* Calls `tokens` when another session with such a token comes or goes. */
int fcsl_zenoh_watch_token(fcsl_zenoh_t *session, uint32_t number, const char *key, char *error, size_t error_size);

/* Answers queries with these bytes from now on. Any thread may call it, while others put. */
int fcsl_zenoh_answer(const fcsl_zenoh_t *session, uint32_t answer, const uint8_t *bytes, size_t size);

/* Returns 0, or -1. 0 does not say that anybody got it. */
int fcsl_zenoh_put(fcsl_zenoh_t *session, uint32_t output, const uint8_t *bytes, size_t size);

/* How many sessions this one is connected to. */
uint32_t fcsl_zenoh_peers(const fcsl_zenoh_t *session);

/* Ends the session and frees it. It may wait for ten seconds and more. */
void fcsl_zenoh_close(fcsl_zenoh_t *session);

#endif /* FCSL_ZENOH_SESSION_H */
