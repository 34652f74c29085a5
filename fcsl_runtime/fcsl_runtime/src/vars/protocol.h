/* SPDX-License-Identifier: Apache-2.0
 *
 * The protocol of the variable server: one JSON object per line in, one out (docs/reference/variables.md).
 *
 * One `set` of a client:
 *   1. event_loop.c receives bytes (client.c); each whole line goes to fcsl_protocol_serve (protocol.c): a request.
 *   2. Its handler, fcsl_handle_set (request_write.c), checks every value and writes the command into the slot.
 *   3. fcsl_slot_post (command.c) hands the slot to the step thread; a request that needs it meanwhile is blocked.
 *   4. fcsl_vars_serve (execute.c), on the step thread between two ticks: executes the command, publishes, fcsl_slot_finish.
 *   5. fcsl_vars_reply_command (event_loop.c): fcsl_slot_take_back, then fcsl_protocol_reply writes the reply from that publication.
 *   6. fcsl_vars_send: to the client; what remains unsent goes in later turns of the loop.
 * Words: *client* (a connection and its state), *request* (a parsed line), *command* (what the step thread executes), *slot* (where
 * it waits), *reply*.
 */
#ifndef FCSL_VARS_PROTOCOL_H
#define FCSL_VARS_PROTOCOL_H

#include <stdatomic.h>

#include "catalog.h"
#include "client.h"
#include "command.h"
#include "fcsl/fcsl_expression.h"
#include "json.h"

enum {
    TOKENS_MAX = REQUEST_BYTES_MAX / 2,
    TOKEN_BYTES_MAX = 128,
    PARAMETER_TEXT_BYTES = REPLY_BYTES_MAX / 2,
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
    uint64_t number; /* counts them: the client that has it holds the same number */
} checkpoint_buffer_t;

typedef struct {
    catalog_t catalog;
    const fcsl_history_t *history;
    const fcsl_vars_host_t *host;
    slot_t *slot;
    service_counters_t *counters;
    const char *secret;     /* "" when none is required */
    json_token_t *tokens;   /* TOKENS_MAX */
    char *text;             /* REQUEST_BYTES_MAX: strings of a request */
    uint8_t *snapshot;      /* the publication of `moment` */
    uint8_t *compiled;       /* the machine's struct with its compiled parameters; null without a machine */
    char *file;              /* PARAMETER_TEXT_BYTES: a parameter file that is made */
    const char *checkpoints; /* the folder of named ones, or null */
    checkpoint_buffer_t checkpoint;
    uint8_t *incoming; /* checkpoint.room bytes: what a request brings, before it is known to be right */
    fcsl_moment_t moment;
    uint64_t snapshot_of;     /* publications when it was taken; 0: none was */
    uint64_t ticks_left;    /* of the `tick` under way, behind what was handed over */
    int ticks_stopped;      /* by a `pause`: the `tick` under way goes on no further */
    uint32_t ticks_at_once; /* 0: without subscriptions; else no more between two readings of the history */
} protocol_t;

typedef enum {
    SERVE_REPLIED,   /* the reply is written */
    SERVE_POSTED,   /* the step thread has the command: fcsl_protocol_reply writes the reply when it is done */
    SERVE_BUSY,     /* the step thread has another client's command: serve the line again when it is done */
    SERVE_UNTRUSTED /* the reply is written; the client is dropped */
} serve_status_t;

/* catalog, history, host, slot, counters and secret are set; takes memory. 0, or -1 without. */
int fcsl_protocol_open(protocol_t *protocol);
void fcsl_protocol_free(protocol_t *protocol);

/* Serves one request line (without its newline); a reply is one line (with its newline) in `out`. */
serve_status_t fcsl_protocol_serve(protocol_t *protocol, client_t *client, const char *line, size_t size,
                                   json_out_t *out);
/* Step thread, for COMMAND_HARDWARE: puts the value in, if there is one, and takes out what is there; refused where there is
 * no room for it. */
fcsl_vars_status_t fcsl_reach_hardware(command_t *command, fcsl_hw_sim_t *hardware);
/* Takes the next ticks of the `tick` under way out of ticks_left. Between two portions a host handles signals. */
uint64_t fcsl_protocol_next_ticks(protocol_t *protocol);
/* After fcsl_slot_take_back: what is left to do on this thread, also when no client waits for the reply any more. */
void fcsl_protocol_complete(protocol_t *protocol);
/* Then: writes the reply of the command that was handed over. */
void fcsl_protocol_reply(protocol_t *protocol, client_t *client, json_out_t *out);
/* The reply of a command that the step thread will not execute any more. */
void fcsl_protocol_reply_ended(protocol_t *protocol, client_t *client, json_out_t *out);

/* Writes an error reply that answers no request. */
void fcsl_protocol_error(json_out_t *out, const char *code, const char *message);

/* ---- a request that is served, for the files that handle them ---------------------------------------------------- */

enum { NAME_BYTES = 256, TEXT_BYTES = 1024 };

typedef struct {
    protocol_t *protocol;
    client_t *client;
    json_t json;
    json_out_t *out;
    char error_code[32];
    char error_message[TEXT_BYTES];
    char error_hint[NAME_BYTES];
    char error_writer[NAME_BYTES]; /* "overwritten_by" of a field that cannot be set; "" otherwise */
} request_t;

/* Notes an error; always -1. */
__attribute__((format(printf, 4, 5))) int fcsl_request_refuse(request_t *request, const char *code, const char *hint,
                                                              const char *format, ...);

/* Text of a required string member, in protocol->text; null after a refusal. */
const char *fcsl_request_text(request_t *request, const char *key, size_t capacity);
/* An optional integer member from 1 to `max`; -1 after a refusal. `number` keeps what it is when there is none. */
int fcsl_request_number(request_t *request, const char *key, uint64_t max, uint64_t *number);
/* An optional boolean member, false when there is none; -1 after a refusal. */
int fcsl_request_flag(request_t *request, const char *key, int *flag);
/* The field, or part of it, that a string token names; -1 after a refusal. */
int fcsl_request_target(request_t *request, uint32_t token, target_t *target);
/* The list of `paths`, 1 to `max`: its first token and count; -1 after a refusal. */
int fcsl_request_paths(request_t *request, uint32_t max, uint32_t *token, uint32_t *count);

/* Takes the newest publication into protocol->snapshot; -1 after a refusal. */
int fcsl_request_snapshot(request_t *request);
/* Takes publication `number`, or the newest when that one is overwritten. */
int fcsl_request_snapshot_at(request_t *request, uint64_t number);
/* Members of the host's status: tick, state, next_state, paused. From the snapshot. */
void fcsl_request_status(const protocol_t *protocol, json_out_t *out);
/* The first machine, or null after a refusal. */
const fcsl_machine_t *fcsl_request_machine(request_t *request);

/* ---- expressions over what is served: request_read.c ------------------------------------------------------------ */

typedef struct {
    fcsl_expression_value_t value;
    uint8_t type;                  /* of a name */
    const fcsl_machine_t *machine; /* of a name */
} evaluated_t;

/* The value of `text` over one publication; 0, or -1 with `error`. */
int fcsl_evaluate(const char *text, const catalog_t *catalog, const uint8_t *snapshot, evaluated_t *evaluated,
                  fcsl_expression_error_t *error);
void fcsl_evaluated_write(const evaluated_t *evaluated, json_out_t *out);

/* ---- handlers: 0, or -1 after a refusal -- ------------------------------------------------------------------------ */

/* request_read.c, request_stats.c: what only reads. */
int fcsl_handle_get(request_t *request);
int fcsl_handle_eval(request_t *request);
int fcsl_handle_state(request_t *request);
int fcsl_handle_stats(request_t *request);
/* request_describe.c */
int fcsl_handle_list(request_t *request);
int fcsl_handle_describe(request_t *request);
/* request_write.c: what prepares a command for the step thread, and what the reply says when it is done. */
int fcsl_handle_set(request_t *request);
int fcsl_handle_pause(request_t *request);
int fcsl_handle_resume(request_t *request);
int fcsl_handle_tick(request_t *request);
int fcsl_handle_set_state(request_t *request);
void fcsl_write_overwritten(const protocol_t *protocol, json_out_t *out);
/* An empty command for the step thread. */
command_t *fcsl_request_prepare(request_t *request, command_kind_t kind);
/* request_checkpoint.c: the whole machine, out and in. */
int fcsl_handle_save(request_t *request);
int fcsl_handle_saved(request_t *request);
int fcsl_handle_load(request_t *request);
int fcsl_handle_restore(request_t *request);
void fcsl_write_saved(request_t *request);
/* request_parameters.c: parameter files. fcsl_protocol_open_parameters takes memory; 0, or -1 without. */
int fcsl_protocol_open_parameters(protocol_t *protocol, const fcsl_machine_t *machine);
int fcsl_handle_parameters(request_t *request);
int fcsl_handle_set_parameters(request_t *request);
/* request_inject.c: what tests inject into a machine. */
int fcsl_handle_inject(request_t *request);
int fcsl_handle_attach(request_t *request);
int fcsl_handle_sample(request_t *request);
int fcsl_handle_record(request_t *request);
int fcsl_handle_stop_recording(request_t *request);
int fcsl_handle_hardware(request_t *request);
void fcsl_write_hardware(const protocol_t *protocol, json_out_t *out);
/* protocol.c */
int fcsl_handle_authenticate(request_t *request);
/* request_subscribe.c */
int fcsl_handle_subscribe(request_t *request);
int fcsl_handle_unsubscribe(request_t *request);

#endif /* FCSL_VARS_PROTOCOL_H */
