/* SPDX-License-Identifier: Apache-2.0
 *
 * Requests that only read: one publication of the history, without the step thread.
 */
#include <stdio.h>
#include <string.h>

#include "machine/enumerators.h"
#include "protocol.h"
#include "value.h"

int fcsl_request_snapshot(request_t *request)
{
    protocol_t *protocol = request->protocol;
    const uint64_t published = fcsl_history_published(protocol->history);
    if (published == protocol->snapshot_of && published > 0) {
        return 0;
    }
    if (fcsl_history_latest(protocol->history, &protocol->moment, protocol->snapshot) != FCSL_HISTORY_OK) {
        protocol->snapshot_of = 0;
        return fcsl_request_refuse(request, "failed", "",
                                   "no tick could be read: ticks come faster than they are copied");
    }
    protocol->snapshot_of = published; /* or a later one: then the next request copies once more than it had to */
    return 0;
}

int fcsl_request_snapshot_at(request_t *request, uint64_t number)
{
    protocol_t *protocol = request->protocol;
    protocol->snapshot_of = 0;
    return fcsl_history_read(protocol->history, number, &protocol->moment, protocol->snapshot) == FCSL_HISTORY_OK
               ? 0
               : fcsl_request_snapshot(request);
}

static void put_tick(const protocol_t *protocol, json_out_t *out)
{
    fcsl_json_text(out, ",\"tick\":");
    fcsl_json_u64(out, protocol->moment.tick);
}

static void put_state(const protocol_t *protocol, json_out_t *out, const char *name, uint32_t offset)
{
    const catalog_t *catalog = &protocol->catalog;
    char text[NAME_BYTES];
    int32_t state = 0;
    memcpy(&state, protocol->snapshot + catalog->bases[catalog->machine] + offset, sizeof state);
    fcsl_json_text(out, ",\"");
    fcsl_json_text(out, name);
    fcsl_json_text(out, "\":");
    fcsl_json_quoted(
        out, fcsl_enumerator_name(catalog->blocks[catalog->machine].machine, FCSL_STATE, state, text, sizeof text));
}

void fcsl_request_status(const protocol_t *protocol, json_out_t *out)
{
    const catalog_t *catalog = &protocol->catalog;
    put_tick(protocol, out);
    if (catalog->machine < catalog->block_count) {
        const fcsl_machine_t *machine = catalog->blocks[catalog->machine].machine;
        put_state(protocol, out, "state", machine->state_offset);
        put_state(protocol, out, "next_state", machine->next_state_offset);
    }
    fcsl_json_text(out, protocol->moment.paused ? ",\"paused\":true" : ",\"paused\":false");
}

const fcsl_machine_t *fcsl_request_machine(request_t *request)
{
    const catalog_t *catalog = &request->protocol->catalog;
    if (catalog->machine < catalog->block_count) {
        return catalog->blocks[catalog->machine].machine;
    }
    (void)fcsl_request_refuse(request, "refused", "", "no machine is hosted here");
    return NULL;
}

/* ---- get ----------------------------------------------------------------------------------------------------------- */

/* All fields of an instance or struct, as an object; 0 when the path names none. */
static int get_group(request_t *request, const char *path)
{
    protocol_t *protocol = request->protocol;
    int found = 0;
    for (uint32_t i = 0; i < protocol->catalog.count; i++) {
        const entry_t *entry = &protocol->catalog.entries[i];
        const char *member = fcsl_catalog_member(entry, path);
        if (member != NULL) {
            const target_t target = fcsl_catalog_target(&protocol->catalog, entry);
            fcsl_json_text(request->out, found ? "," : "{");
            fcsl_json_quoted(request->out, member);
            fcsl_json_text(request->out, ":");
            fcsl_value_write(&target, protocol->snapshot + target.at, request->out);
            found = 1;
        }
    }
    fcsl_json_text(request->out, found ? "}" : "");
    return found;
}

static int get_one(request_t *request, uint32_t token)
{
    protocol_t *protocol = request->protocol;
    const json_token_t *path = &request->json.tokens[token];
    target_t target;
    const int known = fcsl_request_target(request, token, &target) == 0;
    fcsl_json_text(request->out, "\"");
    fcsl_json_bytes(request->out, request->json.text + path->start, path->end - path->start);
    fcsl_json_text(request->out, "\":");
    if (known) {
        fcsl_value_write(&target, protocol->snapshot + target.at, request->out);
        return 0;
    }
    /* The refusal stands unless it is a group's name. */
    char group[GROUP_BYTES];
    const int unknown = strcmp(request->error_code, "unknown_path") == 0;
    return unknown && (get_group(request, protocol->text) ||
                       (fcsl_catalog_find_group(&protocol->catalog, protocol->text, group) == 0 &&
                        get_group(request, group)))
               ? 0
               : -1;
}

int fcsl_handle_get(request_t *request)
{
    uint32_t token = 0;
    uint32_t count = 0;
    if (fcsl_request_paths(request, PATHS_MAX, &token, &count) != 0 || fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    put_tick(request->protocol, request->out);
    fcsl_json_text(request->out, ",\"values\":{");
    for (uint32_t i = 0; i < count; i++) {
        fcsl_json_text(request->out, i > 0 ? "," : "");
        if (get_one(request, token) != 0) {
            return -1;
        }
        token = request->json.tokens[token].next;
    }
    fcsl_json_text(request->out, "}");
    return 0;
}

/* ---- eval -------------------------------------------------------------------------------------------------------- */

typedef struct {
    const catalog_t *catalog;
    const uint8_t *snapshot;
} served_t;

static int find(const void *context, const char *path, fcsl_expression_operand_t *operand,
                fcsl_expression_error_t *error)
{
    const served_t *served = context;
    target_t target;
    const target_status_t status = fcsl_catalog_find(served->catalog, path, &target);
    *error = (fcsl_expression_error_t){.code = "unknown_path", .hint = ""};
    if (status != TARGET_OK) {
        error->code = status == TARGET_INDEX ? "bad_index" : "unknown_path";
        error->hint = status == TARGET_INDEX ? target.entry->path : fcsl_catalog_nearest(served->catalog, path);
        (void)snprintf(error->text, sizeof error->text, "no field '%.80s'", path);
        return -1;
    }
    const uint32_t count = fcsl_view_count(&target.view);
    if (target.view.rank > 1 || count == 0 || count > FCSL_EXPRESSION_VECTOR_MAX ||
        (target.machine == NULL && target.field->type > FCSL_F64)) {
        error->code = "bad_expression";
        (void)snprintf(error->text, sizeof error->text, "name one element of '%.80s'", path);
        return -1;
    }
    *operand = (fcsl_expression_operand_t){
        .machine = target.machine, .type = target.field->type, .count = target.view.rank == 1 ? count : 0};
    for (uint32_t i = 0; i < count; i++) {
        operand->elements[i] = served->snapshot + target.at + fcsl_view_byte(&target.view, i);
    }
    return 0;
}

int fcsl_evaluate(const char *text, const catalog_t *catalog, const uint8_t *snapshot, evaluated_t *evaluated,
                  fcsl_expression_error_t *error)
{
    const served_t served = {.catalog = catalog, .snapshot = snapshot};
    fcsl_expression_t expression;
    if (fcsl_expression_compile(text, find, &served, &expression, error) != 0) {
        return -1;
    }
    evaluated->type = expression.type;
    evaluated->machine = expression.machine;
    return fcsl_expression_run(&expression, &evaluated->value, error);
}

void fcsl_evaluated_write(const evaluated_t *evaluated, json_out_t *out)
{
    char text[PATH_BYTES_MAX];
    const fcsl_expression_value_t *value = &evaluated->value;
    switch (value->kind) {
    case FCSL_EXPRESSION_BOOL:
        fcsl_json_text(out, value->integer ? "true" : "false");
        return;
    case FCSL_EXPRESSION_INTEGER:
        fcsl_json_i64(out, value->integer);
        return;
    case FCSL_EXPRESSION_FLOAT:
        fcsl_json_f64(out, value->real);
        return;
    default:
        fcsl_json_quoted(
            out, fcsl_enumerator_name(evaluated->machine, evaluated->type, (int32_t)value->integer, text, sizeof text));
    }
}

int fcsl_handle_eval(request_t *request)
{
    protocol_t *protocol = request->protocol;
    char text[FCSL_EXPRESSION_BYTES_MAX];
    const uint32_t token = fcsl_json_member(&request->json, 0, "expression");
    if (token == 0 || fcsl_json_string(&request->json, token, text, sizeof text) != 0) {
        return fcsl_request_refuse(request, "bad_request", "",
                                   "eval needs an \"expression\": a string of less than %d bytes",
                                   FCSL_EXPRESSION_BYTES_MAX);
    }
    if (fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    fcsl_expression_error_t error;
    evaluated_t evaluated;
    if (fcsl_evaluate(text, &protocol->catalog, protocol->snapshot, &evaluated, &error) != 0) {
        return fcsl_request_refuse(request, error.code, error.hint, "%s at character %zu of the expression", error.text,
                                   error.at + 1u);
    }
    put_tick(protocol, request->out);
    fcsl_json_text(request->out, ",\"value\":");
    fcsl_evaluated_write(&evaluated, request->out);
    return 0;
}

/* ---- state ------------------------------------------------------------------------------------------------------- */

int fcsl_handle_state(request_t *request)
{
    if (fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    fcsl_request_status(request->protocol, request->out);
    return 0;
}
