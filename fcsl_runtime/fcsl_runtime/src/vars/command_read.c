/* SPDX-License-Identifier: Apache-2.0
 *
 * Commands that only look: they read one publication of the history and never meet the step thread.
 */
#include <string.h>

#include "evaluate.h"
#include "machine/enumerators.h"
#include "request.h"
#include "value.h"

int fcsl_request_snapshot(request_t *request)
{
    commander_t *commander = request->commander;
    const uint64_t published = fcsl_history_published(commander->history);
    if (published == commander->snapshot_of && published > 0) {
        return 0;
    }
    if (fcsl_history_latest(commander->history, &commander->moment, commander->snapshot) != FCSL_HISTORY_OK) {
        commander->snapshot_of = 0;
        return fcsl_request_refuse(request, "failed", "",
                                   "no tick could be read: ticks come faster than they are copied");
    }
    commander->snapshot_of = published; /* or a later one: then the next request copies once more than it had to */
    return 0;
}

int fcsl_request_snapshot_at(request_t *request, uint64_t number)
{
    commander_t *commander = request->commander;
    commander->snapshot_of = 0;
    return fcsl_history_read(commander->history, number, &commander->moment, commander->snapshot) == FCSL_HISTORY_OK
               ? 0
               : fcsl_request_snapshot(request);
}

static void put_tick(const commander_t *commander, json_out_t *out)
{
    fcsl_json_text(out, ",\"tick\":");
    fcsl_json_u64(out, commander->moment.tick);
}

static void put_state(const commander_t *commander, json_out_t *out, const char *name, uint32_t offset)
{
    const catalog_t *catalog = &commander->catalog;
    char text[NAME_BYTES];
    int32_t state = 0;
    memcpy(&state, commander->snapshot + catalog->bases[catalog->machine] + offset, sizeof state);
    fcsl_json_text(out, ",\"");
    fcsl_json_text(out, name);
    fcsl_json_text(out, "\":");
    fcsl_json_quoted(
        out, fcsl_enumerator_name(catalog->blocks[catalog->machine].machine, FCSL_STATE, state, text, sizeof text));
}

void fcsl_request_status(const commander_t *commander, json_out_t *out)
{
    const catalog_t *catalog = &commander->catalog;
    put_tick(commander, out);
    if (catalog->machine < catalog->block_count) {
        const fcsl_machine_t *machine = catalog->blocks[catalog->machine].machine;
        put_state(commander, out, "state", machine->state_offset);
        put_state(commander, out, "next_state", machine->next_state_offset);
    }
    fcsl_json_text(out, commander->moment.paused ? ",\"paused\":true" : ",\"paused\":false");
}

const fcsl_machine_t *fcsl_request_machine(request_t *request)
{
    const catalog_t *catalog = &request->commander->catalog;
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
    commander_t *commander = request->commander;
    int found = 0;
    for (uint32_t i = 0; i < commander->catalog.count; i++) {
        const entry_t *entry = &commander->catalog.entries[i];
        const char *member = fcsl_catalog_member(entry, path);
        if (member != NULL) {
            const target_t target = fcsl_catalog_target(&commander->catalog, entry);
            fcsl_json_text(request->out, found ? "," : "{");
            fcsl_json_quoted(request->out, member);
            fcsl_json_text(request->out, ":");
            fcsl_value_write(&target, commander->snapshot + target.at, request->out);
            found = 1;
        }
    }
    fcsl_json_text(request->out, found ? "}" : "");
    return found;
}

static int get_one(request_t *request, uint32_t token)
{
    commander_t *commander = request->commander;
    const json_token_t *path = &request->json.tokens[token];
    target_t target;
    const int known = fcsl_request_target(request, token, &target) == 0;
    fcsl_json_text(request->out, "\"");
    fcsl_json_bytes(request->out, request->json.text + path->start, path->end - path->start);
    fcsl_json_text(request->out, "\":");
    if (known) {
        fcsl_value_write(&target, commander->snapshot + target.at, request->out);
        return 0;
    }
    /* The refusal stands unless it is a group's name. */
    char group[GROUP_BYTES];
    const int unknown = strcmp(request->error_code, "unknown_path") == 0;
    return unknown && (get_group(request, commander->text) ||
                       (fcsl_catalog_find_group(&commander->catalog, commander->text, group) == 0 &&
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
    put_tick(request->commander, request->out);
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

/* ---- eval, state -------------------------------------------------------------------------------------------- */

int fcsl_handle_eval(request_t *request)
{
    commander_t *commander = request->commander;
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
    if (fcsl_evaluate(text, &commander->catalog, commander->snapshot, &evaluated, &error) != 0) {
        return fcsl_request_refuse(request, error.code, error.hint, "%s at character %zu of the expression", error.text,
                                   error.at + 1u);
    }
    put_tick(commander, request->out);
    fcsl_json_text(request->out, ",\"value\":");
    fcsl_evaluated_write(&evaluated, request->out);
    return 0;
}

int fcsl_handle_state(request_t *request)
{
    if (fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    fcsl_request_status(request->commander, request->out);
    return 0;
}
