/* SPDX-License-Identifier: Apache-2.0
 *
 * The variable server: its struct, its event loop, its clients. Begin with protocol.h.
 */
#ifndef FCSL_VARS_SERVER_H
#define FCSL_VARS_SERVER_H

#include <poll.h>
#include <pthread.h>

#include "listen.h"
#include "protocol.h"

enum { FOREVER = -1 }; /* of a wait */
enum { POLL_MS = 200 }; /* how long a turn waits at most while a time limit runs */
enum { POLLED_MAX = CLIENTS_MAX + 2 }; /* of poll */

struct fcsl_vars {
    const fcsl_history_t *history;
    fcsl_vars_host_t host;
    slot_t slot;
    listener_t listener;
    char checkpoints[FOLDER_BYTES]; /* the folder of named ones; "" for none */
    int wakeup; /* eventfd: ends the wait of a turn, for a command that is done or for the loop */
    atomic_int loop_owner; /* the thread that runs the loop: event_loop.c */
    sem_t loop_returned; /* ends the sleep of the server's thread while it does not run the loop */
    int started;
    pthread_t thread;
    service_counters_t counters;
    protocol_t protocol;
    client_t clients[CLIENTS_MAX];
    uint32_t used; /* at the front, beyond which all are free */
    uint64_t connections; /* accepted so far */
    uint64_t accept_at_ns; /* no connection is taken before: there was no room for one; 0: there was */
    uint32_t next;       /* client that is served first in the next turn */
    uint32_t command_client; /* whose command the step thread has; CLIENTS_MAX: it has disconnected, or there is none */
    uint64_t cursor; /* publications that subscriptions have seen */
    uint64_t overtaken; /* of them, those since the last that was read before it was overwritten */
    uint8_t *sample; /* the one that is read */
    uint64_t tick_by_ns; /* when the `tick` under way goes on, whatever subscribers have read */
};

/* event_loop.c: the server's thread; what ends the wait of a turn; and what ends the thread. */
void *fcsl_vars_run_loop(void *vars);
void fcsl_vars_wake_loop(const fcsl_vars_t *vars);
void fcsl_vars_stop_loop(fcsl_vars_t *vars);
/* Step thread, around a command that it executes: whether it runs the loop; whether it still does. */
int fcsl_vars_begin_command(fcsl_vars_t *vars);
int fcsl_vars_end_command(fcsl_vars_t *vars);

/* What a turn waits for of a client; returns how long at most, in ms, or FOREVER. */
int fcsl_vars_watch(const client_t *client, struct pollfd *polled);
/* Receives what it has sent (as poll's `events` say), serves some of it, and drops it where it is too slow. */
void fcsl_vars_serve_client(fcsl_vars_t *vars, client_t *client, short events, uint64_t now_ns);
/* server.c: takes the connections that wait; after one that the system has no room for, none for a while. */
void fcsl_vars_accept(fcsl_vars_t *vars, uint64_t now_ns);
/* Sends what is unsent, as far as that goes without waiting; closes it when the peer has disconnected, or all is sent. */
void fcsl_vars_send(fcsl_vars_t *vars, client_t *client, uint64_t now_ns);
void fcsl_vars_close_client(fcsl_vars_t *vars, client_t *client);
/* Sends it an error, as far as it still reads, and closes. */
void fcsl_vars_drop_client(fcsl_vars_t *vars, client_t *client, const char *code, const char *why, uint64_t now_ns);

/* Replies when the step thread is done with its command, and gives it the next ticks of a `tick`. */
void fcsl_vars_reply_command(fcsl_vars_t *vars, uint64_t now_ns);

/* streams.c: sends what subscriptions are due of all that was published. */
void fcsl_vars_stream(fcsl_vars_t *vars, uint64_t now_ns);
/* Whether a client subscribes; sets how many ticks a `tick` may make between two readings of the history. */
int fcsl_vars_prepare_streams(fcsl_vars_t *vars);

#endif /* FCSL_VARS_SERVER_H */
