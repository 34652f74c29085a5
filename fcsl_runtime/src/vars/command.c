/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "command.h"

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base64.h"
#include "fcsl/fcsl_scalar.h"
#include "run_internal.h"
#include "tick_stats.h"
#include "value.h"

enum { NAME_BYTES = 256, TEXT_BYTES = 1024, ID_BYTES = 64 };
static const uint64_t TICKS_PER_REQUEST_MAX = 1000000u;

/* A request being served. */
typedef struct {
    commander_t *commander;
    const fcsl_machine_t *machine;
    json_t json;
    json_out_t out;
    char error_code[NAME_BYTES];
    char error_message[TEXT_BYTES];
    char error_hint[NAME_BYTES];
} request_t;

typedef int (*handler_t)(request_t *request);

typedef struct {
    const char *name;
    const char *members; /* names it takes besides "cmd" and "id", each between blanks */
    handler_t handler;
} entry_t;

static int refuse(request_t *request, const char *code, const char *hint, const char *message)
{
    (void)snprintf(request->error_code, sizeof request->error_code, "%s", code);
    (void)snprintf(request->error_hint, sizeof request->error_hint, "%.255s", hint);
    (void)snprintf(request->error_message, sizeof request->error_message, "%s", message);
    return -1;
}

/* Text of a required string member; null after a refusal. */
static const char *text_member(request_t *request, const char *key, size_t capacity)
{
    char message[TEXT_BYTES];
    const uint32_t token = fcsl_json_member(&request->json, 0, key);
    if (token == 0 || fcsl_json_string(&request->json, token, request->commander->text, capacity) != 0) {
        (void)snprintf(message, sizeof message, "this command needs a string \"%s\"", key);
        (void)refuse(request, "bad_request", "", message);
        return NULL;
    }
    return request->commander->text;
}

static int resolve(request_t *request, target_t *target)
{
    const char *path = text_member(request, "path", NAME_BYTES);
    if (path == NULL) {
        return -1;
    }
    char message[TEXT_BYTES];
    const target_status_t status = value_resolve(request->machine, path, target);
    if (status == TARGET_UNKNOWN) {
        (void)snprintf(message, sizeof message, "no field '%s'", path);
        return refuse(request, "unknown_path", value_nearest_path(request->machine, path), message);
    }
    if (status == TARGET_INDEX) {
        char type[NAME_BYTES];
        value_type(target->field, type, sizeof type);
        (void)snprintf(message, sizeof message, "'%s' does not name a scalar of %s", path, type);
        return refuse(request, "bad_index", target->field->path, message);
    }
    return 0;
}

/* Waits for the step thread; -1 at the server's end. */
static int wait_for(request_t *request)
{
    commander_t *commander = request->commander;
    while (!fcsl_mailbox_done(commander->mailbox)) {
        struct pollfd entries[2] = {{.fd = commander->mailbox->answered, .events = POLLIN},
                                    {.fd = commander->stop, .events = POLLIN}};
        (void)poll(entries, 2, -1);
        if (entries[1].revents != 0) {
            return -1;
        }
    }
    return 0;
}

/* Hands the prepared command to the step thread; 0, or -1 with its refusal. */
static int call(request_t *request, command_kind_t kind)
{
    command_t *command = &request->commander->mailbox->command;
    command->kind = kind;
    command->block = 0;
    fcsl_mailbox_post(request->commander->mailbox);
    if (wait_for(request) != 0) {
        return refuse(request, "ended", "", "the run has ended");
    }
    switch (command->status) {
    case FCSL_VARS_OK:
        return 0;
    case FCSL_VARS_RUNNING:
        return refuse(request, "running", "pause", "ticks can be made only while the machine is paused");
    case FCSL_VARS_ENDED:
        return refuse(request, "ended", "", command->error.text);
    case FCSL_VARS_FAILED:
        return refuse(request, "failed", "", command->error.text);
    default:
        return refuse(request, "refused", "", command->error.text);
    }
}

static const char *state_name(const request_t *request, int32_t state)
{
    return state >= 0 && (uint32_t)state < request->machine->state_count ? request->machine->states[state].name : "";
}

/* Takes the newest publication; -1 with a refusal when there is none. */
static int look(request_t *request, fcsl_moment_t *moment)
{
    return fcsl_history_latest(request->commander->history, moment, request->commander->snapshot) == FCSL_HISTORY_OK
               ? 0
               : refuse(request, "failed", "", "no tick could be read");
}

/* The part that all replies share that tell how the host is. */
static int reply_status(request_t *request)
{
    fcsl_moment_t moment;
    int32_t state = 0;
    if (look(request, &moment) != 0) {
        return -1;
    }
    const uint8_t *data = request->commander->snapshot;
    memcpy(&state, data + request->machine->state_offset, sizeof state);
    fcsl_json_raw(&request->out, ",\"tick\":%" PRIu64 ",\"state\":", moment.tick);
    fcsl_json_quoted(&request->out, state_name(request, state));
    memcpy(&state, data + request->machine->next_state_offset, sizeof state);
    fcsl_json_raw(&request->out, ",\"next_state\":");
    fcsl_json_quoted(&request->out, state_name(request, state));
    fcsl_json_raw(&request->out, ",\"paused\":%s", moment.paused ? "true" : "false");
    return 0;
}

static int handle_get(request_t *request)
{
    target_t target;
    fcsl_moment_t moment;
    if (resolve(request, &target) != 0 || look(request, &moment) != 0) {
        return -1;
    }
    const size_t from = target.field->offset + (size_t)target.element * fcsl_scalar_size(target.field->type);
    fcsl_json_raw(&request->out, ",\"tick\":%" PRIu64 ",\"value\":", moment.tick);
    value_write(request->machine, &target, request->commander->snapshot + from, &request->out);
    return 0;
}

static int handle_set(request_t *request)
{
    target_t target;
    command_t *command = &request->commander->mailbox->command;
    if (resolve(request, &target) != 0) {
        return -1;
    }
    const uint32_t token = fcsl_json_member(&request->json, 0, "value");
    if (token == 0) {
        return refuse(request, "bad_request", "", "set needs a \"value\"");
    }
    const char *problem = value_read(request->machine, &target, &request->json, token, command->bytes);
    if (problem != NULL) {
        char message[TEXT_BYTES];
        char type[NAME_BYTES];
        value_type(target.field, type, sizeof type);
        (void)snprintf(message, sizeof message, "'%.255s' is %.64s%s: %s", target.field->path,
                       target.whole ? type : "a scalar of ", target.whole ? "" : type, problem);
        return refuse(request, "bad_value", "", message);
    }
    command->write_count = 1;
    command->writes[0] = (write_t){.field = target.index,
                                   .element = target.element,
                                   .size = target.count * fcsl_scalar_size(target.field->type)};
    return call(request, COMMAND_SET) == 0 ? reply_status(request) : -1;
}

static int handle_pause(request_t *request)
{
    return call(request, COMMAND_PAUSE) == 0 ? reply_status(request) : -1;
}

static int handle_resume(request_t *request)
{
    return call(request, COMMAND_RESUME) == 0 ? reply_status(request) : -1;
}

static int handle_state(request_t *request)
{
    return reply_status(request);
}

static int handle_tick(request_t *request)
{
    uint64_t count = 1;
    const uint32_t token = fcsl_json_member(&request->json, 0, "count");
    if (token != 0) {
        const json_token_t *number = &request->json.tokens[token];
        const char *text = request->json.text + number->start;
        const size_t length = number->end - number->start;
        count = 0;
        for (size_t i = 0; i < length && length <= 8 && number->type == JSON_NUMBER; i++) {
            count = text[i] >= '0' && text[i] <= '9' ? count * 10u + (uint64_t)(text[i] - '0') : UINT32_MAX;
        }
    }
    if (count == 0 || count > TICKS_PER_REQUEST_MAX) {
        return refuse(request, "bad_request", "", "\"count\" must be an integer from 1 to 1000000");
    }
    request->commander->mailbox->command.count = count;
    return call(request, COMMAND_TICK) == 0 ? reply_status(request) : -1;
}

static int handle_set_state(request_t *request)
{
    const char *name = text_member(request, "state", NAME_BYTES);
    if (name == NULL) {
        return -1;
    }
    const int32_t state = value_state(request->machine, name);
    if (state == FCSL_NONE) {
        char message[TEXT_BYTES];
        (void)snprintf(message, sizeof message, "no state '%s'", name);
        return refuse(request, "unknown_state", value_nearest_state(request->machine, name), message);
    }
    request->commander->mailbox->command.state = state;
    return call(request, COMMAND_SET_STATE) == 0 ? reply_status(request) : -1;
}

static int handle_save(request_t *request)
{
    const uint32_t size = request->machine->size;
    json_out_t *out = &request->out;
    if (reply_status(request) != 0) {
        return -1;
    }
    uint8_t *copy = request->commander->mailbox->command.bytes;
    fcsl_copy_canonical(request->machine, copy, request->commander->snapshot);
    fcsl_json_raw(out, ",\"layout_hash\":");
    fcsl_json_quoted(out, request->machine->layout_hash);
    fcsl_json_raw(out, ",\"data\":\"");
    if (out->overflow || out->capacity - out->at < BASE64_BYTES((size_t)size)) {
        return refuse(request, "too_large", "", "the machine is too large for one reply");
    }
    fcsl_base64_encode(copy, size, out->text + out->at);
    out->at += BASE64_BYTES((size_t)size) - 1u;
    fcsl_json_raw(out, "\"");
    return 0;
}

static int handle_restore(request_t *request)
{
    const char *hash = text_member(request, "layout_hash", NAME_BYTES);
    if (hash == NULL) {
        return -1;
    }
    if (strcmp(hash, request->machine->layout_hash) != 0) {
        return refuse(request, "refused", "", "the checkpoint was taken of a machine with another layout");
    }
    const char *data = text_member(request, "data", REQUEST_BYTES_MAX);
    if (data == NULL) {
        return -1;
    }
    if (fcsl_base64_decode(data, strlen(data), request->commander->mailbox->command.bytes, request->machine->size) != 0) {
        return refuse(request, "bad_value", "", "\"data\" is not the base64 text of a checkpoint of this machine");
    }
    return call(request, COMMAND_RESTORE) == 0 ? reply_status(request) : -1;
}

static int handle_list(request_t *request)
{
    const uint32_t token = fcsl_json_member(&request->json, 0, "prefix");
    const char *prefix = token == 0 ? "" : text_member(request, "prefix", NAME_BYTES);
    if (prefix == NULL) {
        return -1;
    }
    fcsl_json_raw(&request->out, ",\"paths\":[");
    int first = 1;
    for (uint32_t i = 0; i < request->machine->field_count; i++) {
        if (strncmp(request->machine->fields[i].path, prefix, strlen(prefix)) == 0) {
            fcsl_json_raw(&request->out, first ? "" : ",");
            fcsl_json_quoted(&request->out, request->machine->fields[i].path);
            first = 0;
        }
    }
    fcsl_json_raw(&request->out, "]");
    return 0;
}

static void put_member(json_out_t *out, const char *key, const char *text)
{
    fcsl_json_raw(out, ",\"%s\":", key);
    fcsl_json_quoted(out, text);
}

static int describe_machine(request_t *request)
{
    const fcsl_machine_t *machine = request->machine;
    json_out_t *out = &request->out;
    put_member(out, "machine", machine->name);
    fcsl_json_raw(out, ",\"tick_hz\":%" PRIu64 ",\"size\":%" PRIu32, machine->tick_hz, machine->size);
    put_member(out, "source_hash", machine->source_hash);
    put_member(out, "layout_hash", machine->layout_hash);
    put_member(out, "build_hash", machine->build_hash);
    fcsl_json_raw(out, ",\"states\":[");
    for (uint32_t i = 0; i < machine->state_count; i++) {
        fcsl_json_raw(out, i > 0 ? "," : "");
        fcsl_json_quoted(out, machine->states[i].name);
    }
    fcsl_json_raw(out, "],\"requests\":[");
    for (uint32_t i = 0; i < machine->request_count; i++) {
        fcsl_json_raw(out, i > 0 ? "," : "");
        fcsl_json_quoted(out, machine->requests[i]);
    }
    fcsl_json_raw(out, "],\"instances\":[");
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_json_raw(out, i > 0 ? "," : "");
        fcsl_json_quoted(out, machine->instances[i].name);
    }
    fcsl_json_raw(out, "]");
    return 0;
}

static int handle_describe(request_t *request)
{
    static const char *const roles[] = {"machine", "input", "output", "parameter", "state", "counter", "channel"};
    if (fcsl_json_member(&request->json, 0, "path") == 0) {
        return describe_machine(request);
    }
    target_t target;
    if (resolve(request, &target) != 0) {
        return -1;
    }
    char type[NAME_BYTES];
    const fcsl_field_t *field = target.field;
    json_out_t *out = &request->out;
    value_type(field, type, sizeof type);
    put_member(out, "path", field->path);
    put_member(out, "role", roles[field->role]);
    put_member(out, "type", type);
    put_member(out, "unit", field->unit);
    put_member(out, "doc", field->doc);
    put_member(out, "instance", field->instance == FCSL_NONE ? "" : request->machine->instances[field->instance].name);
    put_member(out, "connected_from",
               field->connected_from == FCSL_NONE ? "" : request->machine->fields[field->connected_from].path);
    fcsl_json_raw(out, ",\"minimum\":");
    fcsl_json_f64(out, field->minimum);
    fcsl_json_raw(out, ",\"maximum\":");
    fcsl_json_f64(out, field->maximum);
    fcsl_json_raw(out, ",\"writable\":%s,\"frozen\":%s", (field->flags & FCSL_FIELD_WRITABLE) != 0 ? "true" : "false",
             (field->flags & FCSL_FIELD_FROZEN) != 0 ? "true" : "false");
    return 0;
}

static int handle_stats(request_t *request)
{
    commander_t *commander = request->commander;
    const service_counters_t *service = commander->counters;
    json_out_t *out = &request->out;
    uint64_t faults = 0;
    uint64_t overruns = 0;
    if (reply_status(request) != 0) {
        return -1;
    }
    if (commander->host->stats != NULL) {
        commander->host->stats(commander->host->ctx, out);
    }
    fcsl_tick_stats_faults(request->machine, commander->snapshot, &faults, &overruns);
    fcsl_vars_number(out, "faults", faults);
    fcsl_vars_number(out, "overruns", overruns);
    fcsl_vars_number(out, "requests", atomic_load(&service->requests));
    fcsl_vars_number(out, "requests_refused", atomic_load(&service->requests_refused));
    fcsl_vars_number(out, "clients_dropped", atomic_load(&service->clients_dropped));
    return 0;
}

static const entry_t COMMANDS[] = {
    {"get", " path ", handle_get},
    {"set", " path value ", handle_set},
    {"pause", " ", handle_pause},
    {"resume", " ", handle_resume},
    {"tick", " count ", handle_tick},
    {"state", " ", handle_state},
    {"set_state", " state ", handle_set_state},
    {"save", " ", handle_save},
    {"restore", " layout_hash data ", handle_restore},
    {"list", " prefix ", handle_list},
    {"describe", " path ", handle_describe},
    {"stats", " ", handle_stats},
};
enum { COMMAND_COUNT = sizeof COMMANDS / sizeof COMMANDS[0] };

/* Refuses members that the command does not have, and repeated ones: a misspelt name must not be ignored. */
static int check_members(request_t *request, const entry_t *entry)
{
    char key[NAME_BYTES];
    char pattern[NAME_BYTES + 4];
    char message[TEXT_BYTES];
    uint32_t index = 1;
    for (uint32_t i = 0; i < request->json.tokens[0].count; i++) {
        if (fcsl_json_string(&request->json, index, key, sizeof key) != 0) {
            return refuse(request, "bad_request", "", "a member's name is too long or not plain");
        }
        (void)snprintf(pattern, sizeof pattern, " %s ", key);
        const int known = strchr(key, ' ') == NULL && (strcmp(key, "cmd") == 0 || strcmp(key, "id") == 0 ||
                                                       strstr(entry->members, pattern) != NULL);
        if (!known || fcsl_json_member(&request->json, 0, key) != index + 1) {
            (void)snprintf(message, sizeof message, "\"%s\" %s", key,
                           known ? "is given twice" : "is not a member of this command");
            return refuse(request, "bad_request", "", message);
        }
        index = request->json.tokens[index + 1].next;
    }
    return 0;
}

/* Whether the token is an "id" that a reply repeats. */
static int is_id(const json_token_t *id)
{
    return (id->type == JSON_NUMBER || id->type == JSON_STRING) && id->end - id->start <= ID_BYTES;
}

/* An "id" that cannot be repeated is refused: the client would wait for its reply in vain. */
static int check_id(request_t *request)
{
    const uint32_t token = fcsl_json_member(&request->json, 0, "id");
    if (token == 0 || is_id(&request->json.tokens[token])) {
        return 0;
    }
    return refuse(request, "bad_request", "", "\"id\" must be a number or a string of at most 64 bytes");
}

static int dispatch(request_t *request)
{
    const char *names[COMMAND_COUNT + 1] = {0};
    const char *name = text_member(request, "cmd", NAME_BYTES);
    if (name == NULL) {
        return -1;
    }
    for (size_t i = 0; i < COMMAND_COUNT; i++) {
        if (strcmp(COMMANDS[i].name, name) == 0) {
            return check_members(request, &COMMANDS[i]) == 0 ? COMMANDS[i].handler(request) : -1;
        }
        names[i] = COMMANDS[i].name;
    }
    char message[TEXT_BYTES];
    (void)snprintf(message, sizeof message, "no command '%s'", name);
    return refuse(request, "unknown_command", value_nearest(names, name), message);
}

static size_t write_error(json_out_t *out, const char *code, const char *message, const char *hint)
{
    fcsl_json_raw(out, ",\"error\":{\"code\":");
    fcsl_json_quoted(out, code);
    fcsl_json_raw(out, ",\"message\":");
    fcsl_json_quoted(out, message);
    fcsl_json_raw(out, ",\"hint\":");
    fcsl_json_quoted(out, hint);
    fcsl_json_raw(out, "}}\n");
    return out->at;
}

size_t commander_error(char *reply, size_t capacity, const char *code, const char *message)
{
    json_out_t out;
    fcsl_json_begin(&out, reply, capacity);
    fcsl_json_raw(&out, "{\"ok\":false");
    return write_error(&out, code, message, "");
}

/* Begins a reply with the request's "id", if it has one, so that a client can match. */
static void begin_reply(request_t *request, int parsed, char *reply, size_t capacity, const char *ok)
{
    fcsl_json_begin(&request->out, reply, capacity);
    fcsl_json_raw(&request->out, "{\"ok\":%s", ok);
    const uint32_t token = parsed ? fcsl_json_member(&request->json, 0, "id") : 0;
    if (token == 0) {
        return;
    }
    const json_token_t *id = &request->json.tokens[token];
    if (is_id(id)) {
        const char *quote = id->type == JSON_STRING ? "\"" : "";
        fcsl_json_raw(&request->out, ",\"id\":%s%.*s%s", quote, (int)(id->end - id->start), request->json.text + id->start,
                 quote);
    }
}

size_t commander_serve(commander_t *commander, const char *line, size_t size, char *reply, size_t capacity)
{
    request_t request = {.commander = commander, .machine = commander->machine};
    atomic_fetch_add(&commander->counters->requests, 1);
    const char *problem = fcsl_json_parse(line, size, commander->tokens, TOKENS_MAX, &request.json);
    const int parsed = problem == NULL && request.json.tokens[0].type == JSON_OBJECT;
    begin_reply(&request, parsed, reply, capacity, "true");
    int status = 0;
    if (!parsed) {
        status = refuse(&request, "bad_json", "", problem != NULL ? problem : "a request is a JSON object");
    } else {
        status = check_id(&request) == 0 ? dispatch(&request) : -1;
    }
    if (status == 0) {
        fcsl_json_raw(&request.out, "}\n");
        if (!request.out.overflow) {
            return request.out.at;
        }
        (void)refuse(&request, "too_large", "", "the reply is too large; ask for less");
    }
    atomic_fetch_add(&commander->counters->requests_refused, 1);
    begin_reply(&request, parsed, reply, capacity, "false");
    return write_error(&request.out, request.error_code, request.error_message, request.error_hint);
}

void fcsl_vars_number(fcsl_vars_out_t *out, const char *name, uint64_t value)
{
    fcsl_json_raw(out, "%s\"%s\":%" PRIu64, out->text[out->at - 1] == '{' ? "" : ",", name, value);
}

void fcsl_vars_begin(fcsl_vars_out_t *out, const char *name)
{
    fcsl_json_raw(out, "%s\"%s\":{", out->text[out->at - 1] == '{' ? "" : ",", name);
}

void fcsl_vars_end(fcsl_vars_out_t *out)
{
    fcsl_json_raw(out, "}");
}

int commander_open(commander_t *commander)
{
    commander->snapshot = malloc(fcsl_history_bytes(commander->history));
    commander->tokens = calloc(TOKENS_MAX, sizeof *commander->tokens);
    commander->text = malloc(REQUEST_BYTES_MAX + 8u);
    if (commander->snapshot == NULL || commander->tokens == NULL || commander->text == NULL) {
        commander_free(commander);
        return -1;
    }
    return 0;
}

void commander_free(commander_t *commander)
{
    free(commander->snapshot);
    free(commander->tokens);
    free(commander->text);
    commander->snapshot = NULL;
    commander->tokens = NULL;
    commander->text = NULL;
}
