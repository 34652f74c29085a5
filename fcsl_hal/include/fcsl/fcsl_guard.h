/* SPDX-License-Identifier: Apache-2.0
 *
 * The slot between a flight program and fcsl-guard, the process that owns the actuators (docs/hardware/arming.md): shared memory that
 * holds the newest actuator message and when its tick began.
 *
 * One writes, one reads, neither waits for the other, and there is no lock that a dying writer could leave taken. The memory
 * has no name: the guard makes it, of a size that nobody can change any more, and hands it over on a Unix socket that its
 * owner alone may open, to one flight program at a time.
 */
#ifndef FCSL_GUARD_H
#define FCSL_GUARD_H

#include <stdatomic.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_codec.h"

#define FCSL_GUARD_MAGIC  0x47534346u /* "FCSG" */
#define FCSL_GUARD_LAYOUT 1u          /* incremented when the struct below changes its meaning */

enum { FCSL_GUARD_HASH_BYTES = 72 };

/* The shared memory. The head is the guard's, the rest is the writer's. While the sequence is odd the words behind it are
 * being written; each even number belongs to one command. A writer that dies in between leaves it odd: no command. */
typedef struct {
    uint32_t magic;
    uint32_t layout;
    uint64_t capacity; /* bytes of `message` */
    char source_hash[FCSL_GUARD_HASH_BYTES]; /* of the guard's machine */
    _Atomic uint64_t sequence;
    _Atomic uint64_t begun_ns; /* the heartbeat: monotonic time at which the tick of the command began */
    _Atomic uint64_t size; /* bytes of the message */
    _Atomic uint64_t message[];
} fcsl_guard_slot_t;

/* Bytes of a slot for the actuator messages of a machine. */
size_t fcsl_guard_slot_bytes(const fcsl_machine_t *machine);

/* ---- flight program ---- */

typedef struct {
    fcsl_guard_slot_t *slot; /* null: no guard */
    size_t bytes; /* of the slot */
    size_t capacity; /* of its message */
    int connection; /* the guard sees its end when this process ends, however it does */
} fcsl_guard_link_t;

/* Gets the slot of the guard that listens on `path`; waits 2 s for its answer. Refuses a guard whose machine has other sources.
 * `error` receives a message on failure. Returns 0, or -1. */
int fcsl_guard_connect(const char *path, const fcsl_machine_t *machine, fcsl_guard_link_t *link, fcsl_error_t *error);
/* Writes the command of a tick that began at `begun_ns` of the monotonic clock: it is as old as the sensors that it was computed
 * from, however long the tick took. Makes no system call. Returns 0, or -1 when the message does not fit. Without a guard it
 * does nothing. */
int fcsl_guard_command(const fcsl_guard_link_t *link, const fcsl_message_t *message, uint64_t begun_ns);
/* Whether the guard has ended: nobody takes the commands. Does not wait. */
int fcsl_guard_has_ended(const fcsl_guard_link_t *link);
void fcsl_guard_disconnect(fcsl_guard_link_t *link);

/* ---- guard ---- */

typedef struct {
    const char *path; /* of the socket */
    const fcsl_machine_t *machine;
    int listener;
    int client; /* connection of the flight program that has the slot; -1: none has */
    int32_t client_pid;
    int memory; /* the slot, as a descriptor to hand over */
    fcsl_guard_slot_t *slot;
    size_t bytes;
    size_t capacity;
    uint64_t taken; /* sequence of the last command taken */
} fcsl_guard_server_t;

typedef enum {
    FCSL_GUARD_NO_EVENT = 0,
    FCSL_GUARD_JOINED = 1, /* a flight program has the slot, which is empty */
    FCSL_GUARD_LEFT = 2,   /* it has ended */
    FCSL_GUARD_REFUSED = 3 /* a second one was told that the slot is taken */
} fcsl_guard_event_t;

/* Makes the slot and listens on `path` (fcsl_socket_listen), which must last until fcsl_guard_unlisten. Returns 0, or -1 with
 * `error` filled; fcsl_guard_unlisten takes both back. */
int fcsl_guard_listen(const char *path, const fcsl_machine_t *machine, fcsl_guard_server_t *server,
                      fcsl_error_t *error);
/* Whether a flight program has come or gone; at most one event per call. Does not wait. */
fcsl_guard_event_t fcsl_guard_poll(fcsl_guard_server_t *server);
/* Copies a command that was not taken before to `bytes` (server->capacity of them), unchecked, and sets *size and *begun_ns.
 * Returns 1, or 0 when there is none, none whole, or nobody has the slot. A size that no slot can hold is 0. Does not wait. */
int fcsl_guard_take(fcsl_guard_server_t *server, uint8_t *bytes, size_t *size, uint64_t *begun_ns);
/* Closes all, and unlinks the socket. */
void fcsl_guard_unlisten(fcsl_guard_server_t *server);

#endif /* FCSL_GUARD_H */
