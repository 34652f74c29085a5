/* SPDX-License-Identifier: Apache-2.0
 *
 * A client of the variable server: its connection, bytes in, messages out, how long either may take; and what the protocol keeps
 * of it.
 */
#ifndef FCSL_VARS_CLIENT_H
#define FCSL_VARS_CLIENT_H

#include "json.h"
#include "subscription.h"

enum { OUT_BYTES = SAMPLES_BYTES_MAX + REPLY_BYTES_MAX };

typedef struct {
    int fd;      /* -1: free */
    uint64_t number; /* of the connection: they are counted */
    int ended;   /* the peer sends nothing more; it goes once what it has sent is answered */
    int closing; /* nothing more is read; it goes once all is sent */
    int has_command; /* the step thread has its command */
    int blocked; /* its request needs the step thread, which has another command */
    size_t received;
    size_t out_from; /* unsent: out[out_from .. out_to), whole messages but for the first */
    size_t out_to;
    uint64_t unsent_since_ns; /* nothing could be sent since then; 0: nothing is to be sent */
    uint64_t unread_since_ns; /* a request is awaited or incomplete since then; 0: none is */
    int trusted;            /* it needs no token, or has sent it */
    int bad_in_a_row;       /* requests that were no JSON */
    uint64_t checkpoint_number; /* of the checkpoint that it saved or began to load last; 0: none */
    char id[ID_BYTES + 3u]; /* of the request under way, as it is repeated; "" without one */
    subscription_t subscriptions[SUBSCRIPTIONS_MAX];
    char *in;  /* REQUEST_BYTES_MAX + 1: the newline */
    char *out; /* OUT_BYTES */
} client_t;

/* 0, or -1 without memory. */
int fcsl_client_allocate(client_t *client);
void fcsl_client_free(client_t *client);

void fcsl_client_begin(client_t *client, int fd, int trusted, uint64_t now_ns);
void fcsl_client_close(client_t *client);

/* Takes what has arrived, and notes the end of it; 0 when the connection is broken. */
int fcsl_client_receive(client_t *client, uint64_t now_ns);
/* The first complete line, null when there is none; it stays until fcsl_client_next. */
const char *fcsl_client_line(const client_t *client, size_t *size);
void fcsl_client_next(client_t *client, size_t size, uint64_t now_ns);

size_t fcsl_client_unsent(const client_t *client);
/* Room for a message of `capacity` bytes behind what is unsent; nothing is sent by it before fcsl_client_put. */
json_out_t fcsl_client_room(client_t *client, size_t capacity);
void fcsl_client_put(client_t *client, const json_out_t *out, uint64_t now_ns);
/* Sends without waiting; 0 when the peer has disconnected. */
int fcsl_client_send(client_t *client, uint64_t now_ns);

/* Why this client is to be dropped now, or null: it does not read, or sends no request. */
const char *fcsl_client_overdue(const client_t *client, uint64_t now_ns);

#endif /* FCSL_VARS_CLIENT_H */
