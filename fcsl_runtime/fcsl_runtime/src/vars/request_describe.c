/* SPDX-License-Identifier: Apache-2.0
 *
 * What there is: paths, and what they are.
 */
#include <inttypes.h>
#include <string.h>

#include "protocol.h"
#include "value.h"

int fcsl_handle_list(request_t *request)
{
    const catalog_t *catalog = &request->protocol->catalog;
    const uint32_t token = fcsl_json_member(&request->json, 0, "prefix");
    const char *prefix = token == 0 ? "" : fcsl_request_text(request, "prefix", NAME_BYTES);
    if (prefix == NULL) {
        return -1;
    }
    int first = 1;
    fcsl_json_raw(request->out, ",\"paths\":[");
    for (uint32_t i = 0; i < catalog->count; i++) {
        if (strncmp(catalog->entries[i].path, prefix, strlen(prefix)) == 0) {
            fcsl_json_raw(request->out, first ? "" : ",");
            fcsl_json_quoted(request->out, catalog->entries[i].path);
            first = 0;
        }
    }
    fcsl_json_raw(request->out, "]");
    return 0;
}

static void put_member(json_out_t *out, const char *key, const char *text)
{
    fcsl_json_raw(out, ",\"%s\":", key);
    fcsl_json_quoted(out, text);
}

/* A list of names, one of each item of a table. */
static void put_names(json_out_t *out, const char *key, uint32_t count,
                      const char *(*name)(const void *table, uint32_t i), const void *table)
{
    fcsl_json_raw(out, ",\"%s\":[", key);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_json_raw(out, i > 0 ? "," : "");
        fcsl_json_quoted(out, name(table, i));
    }
    fcsl_json_raw(out, "]");
}

static const char *state_name(const void *table, uint32_t i)
{
    return ((const fcsl_machine_t *)table)->states[i].name;
}

static const char *request_name(const void *table, uint32_t i)
{
    return ((const fcsl_machine_t *)table)->requests[i];
}

static const char *instance_name(const void *table, uint32_t i)
{
    return ((const fcsl_machine_t *)table)->instances[i].name;
}

static const char *block_prefix(const void *table, uint32_t i)
{
    return ((const fcsl_vars_block_t *)table)[i].prefix;
}

static int describe_all(request_t *request)
{
    const catalog_t *catalog = &request->protocol->catalog;
    json_out_t *out = request->out;
    if (catalog->machine < catalog->block_count) {
        const fcsl_machine_t *machine = catalog->blocks[catalog->machine].machine;
        put_member(out, "machine", machine->name);
        fcsl_json_raw(out, ",\"tick_hz\":%" PRIu64 ",\"size\":%" PRIu32, machine->tick_hz, machine->size);
        put_member(out, "source_hash", machine->source_hash);
        put_member(out, "layout_hash", machine->layout_hash);
        put_member(out, "build_hash", machine->build_hash);
        put_names(out, "states", machine->state_count, state_name, machine);
        put_names(out, "requests", machine->request_count, request_name, machine);
        put_names(out, "instances", machine->instance_count, instance_name, machine);
    }
    put_names(out, "blocks", catalog->block_count, block_prefix, catalog->blocks);
    return 0;
}

static void describe_field(const target_t *target, const fcsl_vars_block_t *block, json_out_t *out)
{
    static const char *const roles[] = {"machine", "input", "output", "parameter", "state", "counter", "channel"};
    const fcsl_field_t *field = target->field;
    char type[NAME_BYTES];
    const view_t whole = fcsl_view_whole(field);
    fcsl_value_type(field, &whole, type, sizeof type);
    put_member(out, "path", target->entry->path);
    put_member(out, "role", field->role <= FCSL_ROLE_CHANNEL ? roles[field->role] : "");
    put_member(out, "type", type);
    put_member(out, "unit", field->unit);
    put_member(out, "doc", field->doc);
    put_member(out, "instance",
               field->instance == FCSL_NONE || target->machine == NULL
                   ? block->prefix
                   : target->machine->instances[field->instance].name);
    put_member(out, "connected_from", fcsl_value_source(block->fields, field));
    fcsl_json_raw(out, ",\"minimum\":");
    fcsl_json_f64(out, field->minimum);
    fcsl_json_raw(out, ",\"maximum\":");
    fcsl_json_f64(out, field->maximum);
    fcsl_json_raw(out, ",\"writable\":%s,\"frozen\":%s", (field->flags & FCSL_FIELD_WRITABLE) != 0 ? "true" : "false",
                  (field->flags & FCSL_FIELD_FROZEN) != 0 ? "true" : "false");
}

int fcsl_handle_describe(request_t *request)
{
    const uint32_t token = fcsl_json_member(&request->json, 0, "path");
    if (token == 0) {
        return describe_all(request);
    }
    target_t target;
    if (fcsl_request_target(request, token, &target) != 0) {
        return -1;
    }
    /* Of an array of structs the one that is named; of a slice, the first. */
    const catalog_t *catalog = &request->protocol->catalog;
    const uint32_t block = target.entry->block;
    const uint32_t field = target.entry->field + (uint32_t)target.view.fields;
    target = fcsl_catalog_target(catalog, fcsl_catalog_field(catalog, block, field));
    describe_field(&target, &catalog->blocks[block], request->out);
    return 0;
}
