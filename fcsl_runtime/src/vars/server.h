/* SPDX-License-Identifier: Apache-2.0
 *
 * The variable server: newline-delimited JSON over a stream socket. Bounded in every direction: clients, bytes of a request,
 * bytes of a reply, time a client may take to read it.
 */
#ifndef FCSL_VARS_SERVER_H
#define FCSL_VARS_SERVER_H

#include <pthread.h>

#include "command.h"

enum { CLIENTS_MAX = 8, ADDRESS_BYTES = 128 };

typedef struct {
    int fd;      /* -1: free */
    int closing; /* drop once the reply is sent */
    size_t received;
    size_t reply_size;
    size_t reply_sent;
    uint64_t reply_since_ns;
    char *request; /* REQUEST_BYTES_MAX + 1: the newline */
    char *reply;   /* REPLY_BYTES_MAX */
} client_t;

struct fcsl_vars {
    const fcsl_vars_block_t *blocks;
    uint32_t block_count;
    const fcsl_history_t *history;
    fcsl_vars_host_t host;
    mailbox_t mailbox;
    int listener;
    int stop; /* eventfd */
    int started;
    pthread_t thread;
    service_counters_t counters;
    commander_t commander;
    client_t clients[CLIENTS_MAX];
    char address[ADDRESS_BYTES];
};

#endif /* FCSL_VARS_SERVER_H */
