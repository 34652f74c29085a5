/* SPDX-License-Identifier: Apache-2.0
 *
 * Requests and replies: which command it is, what it may hold, how its errors are reported.
 */
#define _GNU_SOURCE
#include "protocol.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "run/checkpoint.h"
#include "value.h"

typedef struct {
    const char *name;
    const char *members; /* names it takes, between blanks */
    int needs_step_thread;/* it needs the step thread */
    int (*handle)(request_t *request);
} handler_t;

/* What every command takes. */
#define COMMON "cmd id "
enum { COMMON_BYTES = sizeof COMMON - 1 };

static const handler_t HANDLERS[] = {
    {"get", COMMON "paths", 0, fcsl_handle_get},
    {"set", COMMON "values allow_non_finite", 1, fcsl_handle_set},
    {"parameters", COMMON, 0, fcsl_handle_parameters},
    {"set_parameters", COMMON "file name", 1, fcsl_handle_set_parameters},
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
enum { HANDLER_COUNT = sizeof HANDLERS / sizeof HANDLERS[0] };

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
static int check_members(request_t *request, const handler_t *handler)
{
    uint32_t seen = 0;
    uint32_t index = 1;
    for (uint32_t i = 0; i < request->json.tokens[0].count; i++) {
        const json_token_t *name = &request->json.tokens[index];
        const uint32_t bit = member_bit(handler->members, request->json.text + name->start, name->end - name->start);
        if (bit == 0 || (seen & bit) != 0) {
            char key[NAME_BYTES];
            if (fcsl_json_string(&request->json, index, key, sizeof key) != 0) {
                return fcsl_request_refuse(request, "bad_request", "", "a member's name is too long or not plain");
            }
            return fcsl_request_refuse(request, "bad_request", bit != 0 ? "" : handler->members + COMMON_BYTES,
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
    request->client->id[0] = '\0';
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
    memcpy(request->client->id, request->json.text + id->start - quote, length);
    request->client->id[length] = '\0';
    return 0;
}

/* ---- replies ------------------------------------------------------------------------------------------------------- */

static void begin_reply(json_out_t *out, const client_t *client, const char *ok)
{
    out->at = 0;
    out->overflow = 0;
    fcsl_json_text(out, "{\"ok\":");
    fcsl_json_text(out, ok);
    if (client != NULL && client->id[0] != '\0') {
        fcsl_json_text(out, ",\"id\":");
        fcsl_json_text(out, client->id);
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

void fcsl_protocol_error(json_out_t *out, const char *code, const char *message)
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
    atomic_fetch_add(&request->protocol->counters->requests_refused, 1);
    begin_reply(request->out, request->client, "false");
    write_error(request->out, request->error_code, request->error_message, request->error_hint, request->error_writer);
}

/* ---- members that handlers read ---------------------------------------------------------------------------------- */

int fcsl_request_refuse(request_t *request, const char *code, const char *hint, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(request->error_message, sizeof request->error_message, format, arguments);
    va_end(arguments);
    (void)snprintf(request->error_code, sizeof request->error_code, "%s", code);
    (void)snprintf(request->error_hint, sizeof request->error_hint, "%.255s", hint);
    return -1;
}

const char *fcsl_request_text(request_t *request, const char *key, size_t capacity)
{
    const uint32_t token = fcsl_json_member(&request->json, 0, key);
    if (token == 0 || fcsl_json_string(&request->json, token, request->protocol->text, capacity) != 0) {
        (void)fcsl_request_refuse(request, "bad_request", "", "this command needs a string \"%s\"", key);
        return NULL;
    }
    return request->protocol->text;
}

int fcsl_request_number(request_t *request, const char *key, uint64_t max, uint64_t *number)
{
    const uint32_t index = fcsl_json_member(&request->json, 0, key);
    if (index == 0) {
        return 0;
    }
    const json_token_t *token = &request->json.tokens[index];
    uint64_t value = 0;
    for (uint32_t i = token->start; token->type == JSON_NUMBER && i < token->end && value <= max; i++) {
        const char c = request->json.text[i];
        const uint64_t digit = (uint64_t)(c - '0');
        value = c >= '0' && c <= '9' && value <= (UINT64_MAX - digit) / 10u ? value * 10u + digit : UINT64_MAX;
    }
    if (value == 0 || value > max) {
        return fcsl_request_refuse(request, "bad_request", "", "\"%s\" must be an integer from 1 to %" PRIu64, key,
                                   max);
    }
    *number = value;
    return 0;
}

int fcsl_request_flag(request_t *request, const char *key, int *flag)
{
    const uint32_t index = fcsl_json_member(&request->json, 0, key);
    const json_type_t type = index == 0 ? JSON_FALSE : request->json.tokens[index].type;
    *flag = type == JSON_TRUE;
    return type == JSON_TRUE || type == JSON_FALSE
               ? 0
               : fcsl_request_refuse(request, "bad_request", "", "\"%s\" must be true or false", key);
}

int fcsl_request_target(request_t *request, uint32_t token, target_t *target)
{
    const char *path = request->protocol->text;
    const catalog_t *catalog = &request->protocol->catalog;
    if (fcsl_json_string(&request->json, token, request->protocol->text, PATH_BYTES_MAX) != 0) {
        return fcsl_request_refuse(request, "bad_request", "", "a path is a string of less than %d bytes",
                                   PATH_BYTES_MAX);
    }
    switch (fcsl_catalog_find(catalog, path, target)) {
    case TARGET_OK:
        return 0;
    case TARGET_INDEX: {
        char type[NAME_BYTES];
        fcsl_value_type(target->field, &target->view, type, sizeof type);
        return fcsl_request_refuse(request, "bad_index", target->entry->path, "'%s' does not name a part of %s", path,
                                   type);
    }
    default:
        return fcsl_request_refuse(request, "unknown_path", fcsl_catalog_nearest(catalog, path), "no field '%s'", path);
    }
}

int fcsl_request_paths(request_t *request, uint32_t max, uint32_t *token, uint32_t *count)
{
    *token = fcsl_json_member(&request->json, 0, "paths");
    *count = request->json.tokens[*token].count;
    if (*token == 0 || request->json.tokens[*token].type != JSON_ARRAY || *count == 0 || *count > max) {
        return fcsl_request_refuse(request, "bad_request", "",
                                   "this command needs \"paths\": a list of 1 to %" PRIu32 " paths", max);
    }
    *token += 1;
    return 0;
}

/* ---- authenticate ------------------------------------------------------------------------------------------------ */

/* The token itself, compared in a time that does not depend on where it differs. */
int fcsl_handle_authenticate(request_t *request)
{
    const char *secret = request->protocol->secret;
    const char *token = fcsl_request_text(request, "token", TOKEN_BYTES_MAX);
    if (token == NULL) {
        return -1;
    }
    const size_t length = strlen(secret);
    const size_t given = strlen(token);
    unsigned different = length != given;
    for (size_t i = 0; i < given; i++) {
        different |= (unsigned)((unsigned char)token[i] ^ (unsigned char)secret[length > 0 ? i % length : 0]);
    }
    if (different != 0 && length > 0) {
        return fcsl_request_refuse(request, "unauthorized", "", "this is not the token of this server");
    }
    request->client->trusted = 1;
    return 0;
}

/* ---- requests ------------------------------------------------------------------------------------------------------ */

static int find_handler(request_t *request, const handler_t **handler)
{
    const char *names[HANDLER_COUNT + 1];
    const char *name = fcsl_request_text(request, "cmd", NAME_BYTES);
    if (name == NULL) {
        return -1;
    }
    for (size_t i = 0; i < HANDLER_COUNT; i++) {
        names[i] = HANDLERS[i].name;
        if (strcmp(HANDLERS[i].name, name) == 0) {
            *handler = &HANDLERS[i];
            return check_members(request, *handler);
        }
    }
    names[HANDLER_COUNT] = NULL;
    return fcsl_request_refuse(request, "unknown_command", fcsl_nearest(names, name), "no command '%s'", name);
}

static int dispatch(request_t *request, serve_status_t *serving)
{
    const handler_t *handler = NULL;
    if (find_handler(request, &handler) != 0) {
        return -1;
    }
    if (!request->client->trusted && handler->handle != fcsl_handle_authenticate) {
        return fcsl_request_refuse(request, "unauthorized", "authenticate",
                                   "the first request must be authenticate, with the token");
    }
    if (handler->needs_step_thread &&
        (request->protocol->ticks_left > 0 || !fcsl_slot_is_free(request->protocol->slot))) {
        request->protocol->ticks_stopped |= handler->handle == fcsl_handle_pause;
        *serving = SERVE_BUSY;
        return 0;
    }
    const int status = handler->handle(request);
    if (status == 0 && handler->needs_step_thread) {
        *serving = SERVE_POSTED;
        fcsl_slot_post(request->protocol->slot);
    }
    return status;
}

serve_status_t fcsl_protocol_serve(protocol_t *protocol, client_t *client, const char *line, size_t size,
                                   json_out_t *out)
{
    request_t request = {.protocol = protocol, .client = client, .out = out};
    serve_status_t serving = SERVE_REPLIED;
    int status = 0;
    const char *problem = fcsl_json_parse(line, size, protocol->tokens, TOKENS_MAX, &request.json);
    client->id[0] = '\0';
    if (problem != NULL || request.json.tokens[0].type != JSON_OBJECT) {
        client->bad_in_a_row++;
        begin_reply(out, client, "false");
        status = fcsl_request_refuse(&request, "bad_json", "", "%s",
                                     problem != NULL ? problem : "a request is a JSON object");
    } else {
        client->bad_in_a_row = 0;
        /* The reply begins with the id, which is noted first; handlers write behind it. */
        status = note_id(&request);
        begin_reply(out, client, "true");
        status = status == 0 ? dispatch(&request, &serving) : status;
    }
    /* A client that has not sent the token has one try. */
    serving = !client->trusted && status != 0 ? SERVE_UNTRUSTED : serving;
    if (serving == SERVE_BUSY || serving == SERVE_POSTED) {
        atomic_fetch_add(&protocol->counters->requests, serving == SERVE_POSTED);
        return serving;
    }
    atomic_fetch_add(&protocol->counters->requests, 1);
    end_reply(&request, status);
    return serving;
}

static int write_result(request_t *request, const command_t *command)
{
    const char *text = command->error.text;
    const uint64_t left = command->kind == COMMAND_TICK ? request->protocol->ticks_left : 0;
    switch (command->status) {
    case FCSL_VARS_OK:
        if (left > 0) {
            return fcsl_request_refuse(request, "refused", "", "a `pause` ended it %" PRIu64 " ticks early", left);
        }
        if (fcsl_request_snapshot_at(request, command->published - 1u) != 0) {
            return -1;
        }
        fcsl_request_status(request->protocol, request->out);
        if (command->kind == COMMAND_SET) {
            fcsl_write_overwritten(request->protocol, request->out);
        } else if (command->kind == COMMAND_SAVE) {
            fcsl_write_saved(request);
        } else if (command->kind == COMMAND_HARDWARE) {
            fcsl_write_hardware(request->protocol, request->out);
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

void fcsl_protocol_reply(protocol_t *protocol, client_t *client, json_out_t *out)
{
    request_t request = {.protocol = protocol, .client = client, .out = out};
    begin_reply(out, client, "true");
    end_reply(&request, write_result(&request, &protocol->slot->command));
}

void fcsl_protocol_reply_ended(protocol_t *protocol, client_t *client, json_out_t *out)
{
    request_t request = {.protocol = protocol, .client = client, .out = out};
    begin_reply(out, client, "false");
    end_reply(&request, fcsl_request_refuse(&request, "ended", "", "the run has ended"));
}

int fcsl_protocol_open(protocol_t *protocol)
{
    const catalog_t *catalog = &protocol->catalog;
    const fcsl_machine_t *machine =
        catalog->machine < catalog->block_count ? catalog->blocks[catalog->machine].machine : NULL;
    const fcsl_monitor_t *monitor = protocol->host->run != NULL ? fcsl_run_monitor(protocol->host->run) : NULL;
    protocol->checkpoint.room =
        machine != NULL ? fcsl_checkpoint_capacity(machine, monitor) + FCSL_OTHER_MEMORY_BYTES + 1u : 1u;
    protocol->snapshot = calloc(1, fcsl_history_bytes(protocol->history) + 1u);
    protocol->checkpoint.bytes = malloc(protocol->checkpoint.room);
    protocol->incoming = malloc(protocol->checkpoint.room);
    protocol->tokens = calloc(TOKENS_MAX, sizeof *protocol->tokens);
    protocol->text = malloc(REQUEST_BYTES_MAX + 8u);
    if (protocol->snapshot == NULL || protocol->checkpoint.bytes == NULL || protocol->incoming == NULL ||
        protocol->tokens == NULL || protocol->text == NULL || fcsl_protocol_open_parameters(protocol, machine) != 0) {
        fcsl_protocol_free(protocol);
        return -1;
    }
    return 0;
}

void fcsl_protocol_free(protocol_t *protocol)
{
    free(protocol->snapshot);
    free(protocol->checkpoint.bytes);
    free(protocol->incoming);
    free(protocol->tokens);
    free(protocol->text);
    free(protocol->compiled);
    free(protocol->file);
    protocol->compiled = NULL;
    protocol->file = NULL;
    protocol->snapshot = NULL;
    protocol->checkpoint.bytes = NULL;
    protocol->incoming = NULL;
    protocol->tokens = NULL;
    protocol->text = NULL;
}
