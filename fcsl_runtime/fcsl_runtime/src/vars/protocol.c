/* SPDX-License-Identifier: Apache-2.0
 *
 * Requests and replies: which command it is, what it may hold, how its errors are told.
 */
#define _GNU_SOURCE
#include "commander.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "run/checkpoint.h"
#include "request.h"

typedef struct {
    const char *name;
    const char *members; /* names it takes, between blanks */
    int acts;            /* it needs the step thread */
    int (*handle)(request_t *request);
} command_entry_t;

/* What every command takes. */
#define COMMON "cmd id "
enum { COMMON_BYTES = sizeof COMMON - 1 };

static const command_entry_t COMMANDS[] = {
    {"get", COMMON "paths", 0, fcsl_handle_get},
    {"set", COMMON "values allow_non_finite", 1, fcsl_handle_set},
    {"eval", COMMON "expression", 0, fcsl_handle_eval},
    {"pause", COMMON, 1, fcsl_handle_pause},
    {"resume", COMMON, 1, fcsl_handle_resume},
    {"tick", COMMON "count", 1, fcsl_handle_tick},
    {"state", COMMON, 0, fcsl_handle_state},
    {"set_state", COMMON "state", 1, fcsl_handle_set_state},
    {"save", COMMON "file", 1, fcsl_handle_save},
    {"saved", COMMON "at", 0, fcsl_handle_saved},
    {"load", COMMON "bytes at data", 0, fcsl_handle_load},
    {"restore", COMMON "file data ignore_source_hash", 1, fcsl_handle_restore},
    {"inject", COMMON "instance what", 1, fcsl_handle_inject},
    {"attach", COMMON "channel", 1, fcsl_handle_attach},
    {"sample", COMMON "channel value age_ticks stamp_ns allow_non_finite", 1, fcsl_handle_sample},
    {"record", COMMON "bag namespace", 1, fcsl_handle_record},
    {"stop_recording", COMMON, 1, fcsl_handle_stop_recording},
    {"hardware", COMMON "bank number value", 1, fcsl_handle_hardware},
    {"list", COMMON "prefix", 0, fcsl_handle_list},
    {"describe", COMMON "path", 0, fcsl_handle_describe},
    {"subscribe", COMMON "paths every format", 0, fcsl_handle_subscribe},
    {"unsubscribe", COMMON "subscription", 0, fcsl_handle_unsubscribe},
    {"stats", COMMON, 0, fcsl_handle_stats},
    {"authenticate", COMMON "token", 0, fcsl_handle_authenticate},
};
enum { COMMAND_COUNT = sizeof COMMANDS / sizeof COMMANDS[0] };

/* ---- members ------------------------------------------------------------------------------------------------------- */

/* A bit of its own for each name among `names`, which blanks divide; 0 where it is none of them. */
static uint32_t member_bit(const char *names, const char *name, size_t length)
{
    uint32_t bit = 1;
    for (const char *at = names; *at != '\0'; bit <<= 1) {
        const size_t size = strcspn(at, " ");
        if (size == length && memcmp(at, name, length) == 0) {
            return bit;
        }
        at += size + (at[size] == ' ');
    }
    return 0;
}

/* Refuses members that the command does not have, and repeated ones: a misspelt name must not be ignored. */
static int check_members(request_t *request, const command_entry_t *entry)
{
    uint32_t seen = 0;
    uint32_t index = 1;
    for (uint32_t i = 0; i < request->json.tokens[0].count; i++) {
        const json_token_t *name = &request->json.tokens[index];
        const uint32_t bit = member_bit(entry->members, request->json.text + name->start, name->end - name->start);
        if (bit == 0 || (seen & bit) != 0) {
            char key[NAME_BYTES];
            if (fcsl_json_string(&request->json, index, key, sizeof key) != 0) {
                return fcsl_request_refuse(request, "bad_request", "", "a member's name is too long or not plain");
            }
            return fcsl_request_refuse(request, "bad_request", bit != 0 ? "" : entry->members + COMMON_BYTES,
                                       "\"%s\" %s", key,
                                       bit != 0 ? "is given twice" : "is not a member of this command");
        }
        seen |= bit;
        index = request->json.tokens[index + 1].next;
    }
    return 0;
}

/* Notes the "id" as it is to be repeated. One that cannot be is refused: the client would wait for its reply in vain. */
static int note_id(request_t *request)
{
    const uint32_t index = fcsl_json_member(&request->json, 0, "id");
    request->session->id[0] = '\0';
    if (index == 0) {
        return 0;
    }
    const json_token_t *id = &request->json.tokens[index];
    if ((id->type != JSON_NUMBER && id->type != JSON_STRING) || id->end - id->start > ID_BYTES) {
        return fcsl_request_refuse(request, "bad_request", "",
                                   "\"id\" must be a number or a string of at most %d bytes", ID_BYTES);
    }
    const uint32_t quote = id->type == JSON_STRING;
    const size_t length = id->end - id->start + 2u * quote;
    memcpy(request->session->id, request->json.text + id->start - quote, length);
    request->session->id[length] = '\0';
    return 0;
}

/* ---- replies ------------------------------------------------------------------------------------------------------- */

static void begin_reply(json_out_t *out, const session_t *session, const char *ok)
{
    out->at = 0;
    out->overflow = 0;
    fcsl_json_text(out, "{\"ok\":");
    fcsl_json_text(out, ok);
    if (session != NULL && session->id[0] != '\0') {
        fcsl_json_text(out, ",\"id\":");
        fcsl_json_text(out, session->id);
    }
}

static void write_error(json_out_t *out, const char *code, const char *message, const char *hint, const char *writer)
{
    fcsl_json_raw(out, ",\"error\":{\"code\":");
    fcsl_json_quoted(out, code);
    fcsl_json_raw(out, ",\"message\":");
    fcsl_json_quoted(out, message);
    fcsl_json_raw(out, ",\"hint\":");
    fcsl_json_quoted(out, hint);
    if (writer[0] != '\0') {
        fcsl_json_raw(out, ",\"overwritten_by\":");
        fcsl_json_quoted(out, writer);
    }
    fcsl_json_raw(out, "}}\n");
}

void fcsl_commander_error(json_out_t *out, const char *code, const char *message)
{
    begin_reply(out, NULL, "false");
    write_error(out, code, message, "", "");
}

/* Ends a reply of which `status` says whether it is an error. */
static void end_reply(request_t *request, int status)
{
    if (status == 0) {
        fcsl_json_text(request->out, "}\n");
        if (!request->out->overflow) {
            return;
        }
        (void)fcsl_request_refuse(request, "too_large", "", "the reply is too large; ask for less");
    }
    atomic_fetch_add(&request->commander->counters->requests_refused, 1);
    begin_reply(request->out, request->session, "false");
    write_error(request->out, request->error_code, request->error_message, request->error_hint, request->error_writer);
}

/* ---- requests ------------------------------------------------------------------------------------------------------ */

static int find_command(request_t *request, const command_entry_t **entry)
{
    const char *names[COMMAND_COUNT + 1];
    const char *name = fcsl_request_text(request, "cmd", NAME_BYTES);
    if (name == NULL) {
        return -1;
    }
    for (size_t i = 0; i < COMMAND_COUNT; i++) {
        names[i] = COMMANDS[i].name;
        if (strcmp(COMMANDS[i].name, name) == 0) {
            *entry = &COMMANDS[i];
            return check_members(request, *entry);
        }
    }
    names[COMMAND_COUNT] = NULL;
    return fcsl_request_refuse(request, "unknown_command", fcsl_nearest(names, name), "no command '%s'", name);
}

static int dispatch(request_t *request, serving_t *serving)
{
    const command_entry_t *entry = NULL;
    if (find_command(request, &entry) != 0) {
        return -1;
    }
    if (!request->session->trusted && entry->handle != fcsl_handle_authenticate) {
        return fcsl_request_refuse(request, "unauthorized", "authenticate",
                                   "the first request must be authenticate, with the token");
    }
    if (entry->acts && (request->commander->ticks_left > 0 || !fcsl_mailbox_is_free(request->commander->mailbox))) {
        request->commander->ticks_stopped |= entry->handle == fcsl_handle_pause;
        *serving = BUSY;
        return 0;
    }
    const int status = entry->handle(request);
    if (status == 0 && entry->acts) {
        *serving = POSTED;
        fcsl_mailbox_post(request->commander->mailbox);
    }
    return status;
}

serving_t fcsl_commander_serve(commander_t *commander, session_t *session, const char *line, size_t size,
                               json_out_t *out)
{
    request_t request = {.commander = commander, .session = session, .out = out};
    serving_t serving = SERVED;
    int status = 0;
    const char *problem = fcsl_json_parse(line, size, commander->tokens, TOKENS_MAX, &request.json);
    session->id[0] = '\0';
    if (problem != NULL || request.json.tokens[0].type != JSON_OBJECT) {
        session->bad_in_a_row++;
        begin_reply(out, session, "false");
        status = fcsl_request_refuse(&request, "bad_json", "", "%s",
                                     problem != NULL ? problem : "a request is a JSON object");
    } else {
        session->bad_in_a_row = 0;
        /* The reply begins with the id, which is noted first; handlers write behind it. */
        status = note_id(&request);
        begin_reply(out, session, "true");
        status = status == 0 ? dispatch(&request, &serving) : status;
    }
    /* Whoever has not told the token has one try. */
    serving = !session->trusted && status != 0 ? UNTRUSTED : serving;
    if (serving == BUSY || serving == POSTED) {
        atomic_fetch_add(&commander->counters->requests, serving == POSTED);
        return serving;
    }
    atomic_fetch_add(&commander->counters->requests, 1);
    end_reply(&request, status);
    return serving;
}

static int tell(request_t *request, const command_t *command)
{
    const char *text = command->error.text;
    const uint64_t left = command->kind == COMMAND_TICK ? request->commander->ticks_left : 0;
    switch (command->status) {
    case FCSL_VARS_OK:
        if (left > 0) {
            return fcsl_request_refuse(request, "refused", "", "a `pause` ended it %" PRIu64 " ticks early", left);
        }
        if (fcsl_request_snapshot_at(request, command->published - 1u) != 0) {
            return -1;
        }
        fcsl_request_status(request->commander, request->out);
        if (command->kind == COMMAND_SET) {
            fcsl_write_overwritten(request->commander, request->out);
        } else if (command->kind == COMMAND_SAVE) {
            fcsl_write_saved(request);
        } else if (command->kind == COMMAND_HARDWARE) {
            fcsl_write_hardware(request->commander, request->out);
        }
        return 0;
    case FCSL_VARS_NOT_PAUSED:
        return fcsl_request_refuse(request, "not_paused", "pause", "this is done only while the machine is paused");
    case FCSL_VARS_ENDED:
        return fcsl_request_refuse(request, "ended", "", "%s", text);
    case FCSL_VARS_FAILED:
        return fcsl_request_refuse(request, "failed", "", "%s", text);
    default:
        return fcsl_request_refuse(request, "refused", "", "%s", text);
    }
}

void fcsl_commander_finish(commander_t *commander, session_t *session, json_out_t *out)
{
    request_t request = {.commander = commander, .session = session, .out = out};
    begin_reply(out, session, "true");
    end_reply(&request, tell(&request, &commander->mailbox->command));
}

void fcsl_commander_abandon(commander_t *commander, session_t *session, json_out_t *out)
{
    request_t request = {.commander = commander, .session = session, .out = out};
    begin_reply(out, session, "false");
    end_reply(&request, fcsl_request_refuse(&request, "ended", "", "the run has ended"));
}

int fcsl_commander_open(commander_t *commander)
{
    const catalog_t *catalog = &commander->catalog;
    const fcsl_machine_t *machine =
        catalog->machine < catalog->block_count ? catalog->blocks[catalog->machine].machine : NULL;
    commander->kept.room = machine != NULL ? fcsl_checkpoint_capacity(machine) + 1u : 1u;
    commander->snapshot = calloc(1, fcsl_history_bytes(commander->history) + 1u);
    commander->kept.bytes = malloc(commander->kept.room);
    commander->incoming = malloc(commander->kept.room);
    commander->tokens = calloc(TOKENS_MAX, sizeof *commander->tokens);
    commander->text = malloc(REQUEST_BYTES_MAX + 8u);
    if (commander->snapshot == NULL || commander->kept.bytes == NULL || commander->incoming == NULL ||
        commander->tokens == NULL || commander->text == NULL) {
        fcsl_commander_free(commander);
        return -1;
    }
    return 0;
}

void fcsl_commander_free(commander_t *commander)
{
    free(commander->snapshot);
    free(commander->kept.bytes);
    free(commander->incoming);
    free(commander->tokens);
    free(commander->text);
    commander->snapshot = NULL;
    commander->kept.bytes = NULL;
    commander->incoming = NULL;
    commander->tokens = NULL;
    commander->text = NULL;
}
