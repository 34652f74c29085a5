/* SPDX-License-Identifier: Apache-2.0
 *
 * The protocol of the variable server: one JSON object per line in, one out (docs/reference/variables.md).
 */
#ifndef FCSL_VARS_COMMANDER_H
#define FCSL_VARS_COMMANDER_H

#include <stdatomic.h>

#include "catalog.h"
#include "json.h"
#include "mailbox.h"
#include "subscription.h"

enum {
    TOKENS_MAX = REQUEST_BYTES_MAX / 2,
    TOKEN_BYTES_MAX = 128,
    FOLDER_BYTES = 3840, /* with FILE_BYTES and what fcsl_replace_file adds less than PATH_MAX */
    FILE_PATH_BYTES = FOLDER_BYTES + FILE_BYTES
};

typedef struct {
    atomic_uint_fast64_t requests;
    atomic_uint_fast64_t requests_refused;
    atomic_uint_fast64_t clients_dropped;
    atomic_uint_fast64_t samples_lost;
} service_counters_t;

/* The checkpoint that was saved last, or that is being loaded: the program keeps one. */
typedef struct {
    uint8_t *bytes;
    size_t room;     /* one more than the longest has, so that longer files show */
    size_t size;     /* of the whole; 0 when there is none */
    size_t held;     /* what is there of it, from the front */
    uint64_t number; /* counts them: the session that has it holds the same number */
} kept_t;

typedef struct {
    catalog_t catalog;
    const fcsl_history_t *history;
    const fcsl_vars_host_t *host;
    mailbox_t *mailbox;
    service_counters_t *counters;
    const char *secret;     /* "" when none is asked for */
    json_token_t *tokens;   /* TOKENS_MAX */
    char *text;             /* REQUEST_BYTES_MAX: strings of a request */
    uint8_t *snapshot;      /* the publication that `moment` tells of */
    const char *checkpoints; /* the folder of named ones, or null */
    kept_t kept;
    uint8_t *incoming; /* kept.room bytes: what a request brings, before it is known to be right */
    fcsl_moment_t moment;
    uint64_t snapshot_of;     /* publications when it was taken; 0: none was */
    uint64_t ticks_left;    /* of the `tick` under way, behind what was handed over */
    int ticks_stopped;      /* by a `pause`: the `tick` under way goes on no further */
    uint32_t ticks_at_once; /* 0: nobody subscribed; else no more between two looks at the history */
} commander_t;

/* What the protocol keeps of a client. */
typedef struct {
    int trusted;            /* it needs no token, or has told it */
    int bad_in_a_row;       /* requests that were no JSON */
    uint64_t checkpoint_number; /* of the checkpoint that it saved or began to load last; 0: none */
    char id[ID_BYTES + 3u]; /* of the request under way, as it is repeated; "" without one */
    subscription_t subscriptions[SUBSCRIPTIONS_MAX];
} session_t;

typedef enum {
    SERVED,   /* the reply is written */
    POSTED,   /* the step thread has the command: commander_finish writes the reply when it is done */
    BUSY,     /* the step thread has another client's command: serve the line again when it is done */
    UNTRUSTED /* the reply is written; the client goes */
} serving_t;

/* catalog, history, host, mailbox, counters and secret are set; takes memory. 0, or -1 without. */
int fcsl_commander_open(commander_t *commander);
void fcsl_commander_free(commander_t *commander);

/* Serves one request line (without its newline); a reply is one line (with its newline) in `out`. */
serving_t fcsl_commander_serve(commander_t *commander, session_t *session, const char *line, size_t size,
                               json_out_t *out);
/* Step thread, for COMMAND_HARDWARE: puts the value in, if there is one, and takes out what is there; refused where there is
 * no room for it. */
fcsl_vars_status_t fcsl_reach_hardware(command_t *command, fcsl_hw_sim_t *hardware);
/* Takes the next ticks of the `tick` under way out of ticks_left. Between two portions a host looks at signals. */
uint64_t fcsl_commander_portion(commander_t *commander);
/* After fcsl_mailbox_done: what is left to do on this thread, also when nobody waits for the reply any more. */
void fcsl_commander_complete(commander_t *commander);
/* Then: writes the reply of the command that was handed over. */
void fcsl_commander_finish(commander_t *commander, session_t *session, json_out_t *out);
/* The reply of a command that no one will answer any more. */
void fcsl_commander_abandon(commander_t *commander, session_t *session, json_out_t *out);

/* Writes an error reply that answers no request. */
void fcsl_commander_error(json_out_t *out, const char *code, const char *message);

#endif /* FCSL_VARS_COMMANDER_H */
