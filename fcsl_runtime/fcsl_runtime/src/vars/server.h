/* SPDX-License-Identifier: Apache-2.0
 *
 * The variable server: clients, what they share, and its end on the step thread.
 */
#ifndef FCSL_VARS_SERVER_H
#define FCSL_VARS_SERVER_H

#include <poll.h>
#include <pthread.h>

#include "client.h"
#include "listen.h"

enum { FOREVER = -1 }; /* of a wait */
enum { POLL_MS = 200 }; /* how long a round waits at most while a time limit runs */
enum { ENTRIES_MAX = CLIENTS_MAX + 2 }; /* of poll */

struct fcsl_vars {
    const fcsl_history_t *history;
    fcsl_vars_host_t host;
    mailbox_t mailbox;
    listener_t listener;
    char checkpoints[FOLDER_BYTES]; /* the folder of named ones; "" for none */
    int attention; /* eventfd: ends the wait of a round, for a command that is done or for the rounds */
    atomic_int rounds; /* who makes them: event_loop.c */
    sem_t returned; /* ends the sleep of the server's thread while it makes none */
    int started;
    pthread_t thread;
    service_counters_t counters;
    commander_t commander;
    client_t clients[CLIENTS_MAX];
    uint32_t used; /* places at the front, beyond which all are free */
    uint64_t connections; /* accepted so far */
    uint64_t accept_at_ns; /* no connection is taken before: there was no room for one; 0: there was */
    uint32_t next;       /* client that is served first in the coming round */
    uint32_t poster;     /* client whose command the step thread has; CLIENTS_MAX: it is gone, or there is none */
    uint64_t cursor;     /* publications that subscriptions have seen */
    uint64_t overtaken;  /* of them, those since the last that was read before it was overwritten */
    uint8_t *sample;     /* the one they are looking at */
    uint64_t tick_by_ns; /* when the `tick` under way goes on, whatever subscribers have read */
};

/* event_loop.c: the server's thread; what ends its wait; and what ends it. */
void *fcsl_vars_make_rounds(void *vars);
void fcsl_vars_call(const fcsl_vars_t *vars);
void fcsl_vars_end_rounds(fcsl_vars_t *vars);
/* Step thread, around its work on a command: whether it makes the rounds; whether it still does. */
int fcsl_vars_begin_work(fcsl_vars_t *vars);
int fcsl_vars_end_work(fcsl_vars_t *vars);

/* client_round.c: what a client is waited for; returns how long at most, in ms, or FOREVER. */
int fcsl_vars_watch(const client_t *client, struct pollfd *entry);
/* Takes what it has sent (as poll's `events` say), serves some of it, and sees to it that it keeps its time. */
void fcsl_vars_serve_client(fcsl_vars_t *vars, client_t *client, short events, uint64_t now_ns);
/* Takes the connections that wait; after one that the system has no room for, none for a while. */
void fcsl_vars_accept(fcsl_vars_t *vars, uint64_t now_ns);
/* Sends what is unsent, as far as that goes without waiting; closes it when the peer is gone, or all was said. */
void fcsl_vars_send(fcsl_vars_t *vars, client_t *client, uint64_t now_ns);
void fcsl_vars_close_client(fcsl_vars_t *vars, client_t *client);

/* pending_command.c: replies when the step thread is done with its command, and gives it the next ticks of a `tick`. */
void fcsl_vars_serve_command(fcsl_vars_t *vars, uint64_t now_ns);

/* streams.c: sends what subscriptions are due of all that was published. */
void fcsl_vars_stream(fcsl_vars_t *vars, uint64_t now_ns);
/* Whether anyone subscribes; sets how many ticks a `tick` may make between two looks at the history. */
int fcsl_vars_prepare_streams(fcsl_vars_t *vars);

#endif /* FCSL_VARS_SERVER_H */
