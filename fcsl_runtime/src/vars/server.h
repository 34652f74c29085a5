/* SPDX-License-Identifier: Apache-2.0
 *
 * The variable server: clients, what they share, and its end on the step thread.
 */
#ifndef FCSL_VARS_SERVER_H
#define FCSL_VARS_SERVER_H

#include <pthread.h>

#include "client.h"
#include "listen.h"

enum { CLIENTS_MAX = 64 };

struct fcsl_vars {
    const fcsl_history_t *history;
    fcsl_vars_host_t host;
    mailbox_t mailbox;
    listener_t listener;
    int stop; /* eventfd */
    int started;
    pthread_t thread;
    service_counters_t counters;
    commander_t commander;
    client_t clients[CLIENTS_MAX];
    uint32_t next;       /* client that is served first in the coming round */
    uint32_t poster;     /* client whose command the step thread has; CLIENTS_MAX: it is gone, or there is none */
    uint64_t cursor;     /* publications that subscriptions have seen */
    uint8_t *sample;     /* the one they are looking at */
    uint64_t tick_by_ns; /* when the `tick` under way goes on, whatever subscribers have read */
};

/* streams.c: sends what subscriptions are due of all that was published. */
void fcsl_vars_stream(fcsl_vars_t *vars, uint64_t now_ns);
/* Whether anyone subscribes; sets how many ticks a `tick` may make between two looks at the history. */
int fcsl_vars_prepare_streams(fcsl_vars_t *vars);

#endif /* FCSL_VARS_SERVER_H */
