/* SPDX-License-Identifier: Apache-2.0
 *
 * A request being served, for the files that handle commands.
 */
#ifndef FCSL_VARS_REQUEST_H
#define FCSL_VARS_REQUEST_H

#include "commander.h"

enum { NAME_BYTES = 256, TEXT_BYTES = 1024 };

typedef struct {
    commander_t *commander;
    session_t *session;
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

/* Text of a required string member, in commander->text; null after a refusal. */
const char *fcsl_request_text(request_t *request, const char *key, size_t capacity);
/* An optional integer member from 1 to `max`; -1 after a refusal. `number` keeps what it is when there is none. */
int fcsl_request_number(request_t *request, const char *key, uint64_t max, uint64_t *number);
/* An optional boolean member, false when there is none; -1 after a refusal. */
int fcsl_request_flag(request_t *request, const char *key, int *flag);
/* The field, or part of it, that a string token names; -1 after a refusal. */
int fcsl_request_target(request_t *request, uint32_t token, target_t *target);
/* The list of `paths`, 1 to `max`: its first token and count; -1 after a refusal. */
int fcsl_request_paths(request_t *request, uint32_t max, uint32_t *token, uint32_t *count);

/* Takes the newest publication into commander->snapshot; -1 after a refusal. */
int fcsl_request_snapshot(request_t *request);
/* Takes publication `number`, or the newest when that one is gone. */
int fcsl_request_snapshot_at(request_t *request, uint64_t number);
/* Members that tell how the host is: tick, state, next_state, paused. From the snapshot. */
void fcsl_request_status(const commander_t *commander, json_out_t *out);
/* The first machine, or null after a refusal. */
const fcsl_machine_t *fcsl_request_machine(request_t *request);

/* ---- the commands: 0, or -1 after a refusal ------------------------------------------------------------------------ */

/* command_look.c: what only looks. */
int fcsl_handle_get(request_t *request);
int fcsl_handle_eval(request_t *request);
int fcsl_handle_state(request_t *request);
int fcsl_handle_stats(request_t *request);
/* command_describe.c */
int fcsl_handle_list(request_t *request);
int fcsl_handle_describe(request_t *request);
/* command_act.c: what prepares a command for the step thread, and what is said when it is done. */
int fcsl_handle_set(request_t *request);
int fcsl_handle_pause(request_t *request);
int fcsl_handle_resume(request_t *request);
int fcsl_handle_tick(request_t *request);
int fcsl_handle_set_state(request_t *request);
void fcsl_write_overwritten(const commander_t *commander, json_out_t *out);
/* An empty command for the step thread. */
command_t *fcsl_request_prepare(request_t *request, command_kind_t kind);
/* command_checkpoint.c: the whole machine, out and in. */
int fcsl_handle_save(request_t *request);
int fcsl_handle_saved(request_t *request);
int fcsl_handle_load(request_t *request);
int fcsl_handle_restore(request_t *request);
void fcsl_write_saved(request_t *request);
/* command_stage.c: what tests do to a machine. */
int fcsl_handle_inject(request_t *request);
int fcsl_handle_attach(request_t *request);
int fcsl_handle_sample(request_t *request);
int fcsl_handle_record(request_t *request);
int fcsl_handle_stop_recording(request_t *request);
/* command_hardware.c */
int fcsl_handle_hardware(request_t *request);
void fcsl_write_hardware(const commander_t *commander, json_out_t *out);
/* command_authenticate.c */
int fcsl_handle_authenticate(request_t *request);
/* command_subscribe.c */
int fcsl_handle_subscribe(request_t *request);
int fcsl_handle_unsubscribe(request_t *request);

#endif /* FCSL_VARS_REQUEST_H */
