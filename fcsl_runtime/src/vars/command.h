/* SPDX-License-Identifier: Apache-2.0
 *
 * The protocol of the command server: one JSON object per line in, one out (docs/protocol.md).
 */
#ifndef FCSL_VARS_COMMAND_H
#define FCSL_VARS_COMMAND_H

#include <stdatomic.h>

#include "json.h"
#include "mailbox.h"

enum { REQUEST_BYTES_MAX = 64 * 1024, REPLY_BYTES_MAX = 512 * 1024, TOKENS_MAX = REQUEST_BYTES_MAX / 2 };

typedef struct {
    atomic_uint_fast64_t requests;
    atomic_uint_fast64_t requests_refused;
    atomic_uint_fast64_t clients_dropped;
} service_counters_t;

typedef struct {
    const fcsl_machine_t *machine;
    const fcsl_history_t *history;
    const fcsl_vars_host_t *host;
    mailbox_t *mailbox;
    int stop;             /* eventfd: the end */
    uint8_t *snapshot;
    service_counters_t *counters;
    json_token_t *tokens; /* TOKENS_MAX */
    char *text;           /* REQUEST_BYTES_MAX: strings of a request */
} commander_t;

int commander_open(commander_t *commander);
void commander_free(commander_t *commander);

/* Serves one request line (without its newline) and writes the reply line (with one). Returns the reply's bytes. */
size_t commander_serve(commander_t *commander, const char *line, size_t size, char *reply, size_t capacity);

/* Writes an error reply; returns its bytes. */
size_t commander_error(char *reply, size_t capacity, const char *code, const char *message);

#endif /* FCSL_VARS_COMMAND_H */
