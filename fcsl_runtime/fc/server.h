/* SPDX-License-Identifier: Apache-2.0
 *
 * The command server's thread: newline-delimited JSON over a Unix stream socket. Bounded in every direction: clients,
 * bytes of a request, bytes of a reply, time a client may take to read it.
 */
#ifndef FC_SERVER_H
#define FC_SERVER_H

#include "command.h"

typedef struct server server_t;

/* Listens on `path`; nothing is served before server_start. Null with `error` filled. */
server_t *server_listen(const char *path, const fcsl_machine_t *machine, mailbox_t *mailbox,
                        service_counters_t *counters, fcsl_error_t *error);
int server_start(server_t *server, fcsl_error_t *error);
/* Asks the thread to end; it may be waiting for an answer, so the caller serves the mailbox until server_ended. */
void server_stop(server_t *server);
int server_ended(const server_t *server);
/* Joins the thread, closes all, unlinks the socket. Accepts null. */
void server_free(server_t *server);

#endif /* FC_SERVER_H */
