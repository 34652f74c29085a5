/* SPDX-License-Identifier: Apache-2.0
 *
 * Commands that change something: they are prepared and checked here, and the step thread acts on them.
 */
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "machine/enumerators.h"
#include "protocol.h"
#include "value.h"

/* ---- what overwrites it -------------------------------------------------------------------------------------------- */

static int is_scheduled(const fcsl_machine_t *machine, const uint8_t *data, int32_t instance)
{
    int32_t state = 0;
    memcpy(&state, data + machine->next_state_offset, sizeof state);
    if (state < 0 || (uint32_t)state >= machine->state_count) {
        return 0;
    }
    const fcsl_state_t *next = &machine->states[state];
    for (uint32_t i = 0; i < next->schedule_count; i++) {
        if ((int32_t)next->schedule[i].instance == instance) {
            return 1;
        }
    }
    return 0;
}

/* The sensor channel that a HAL serves for this field, or null. */
static const fcsl_channel_t *serving_channel(const fcsl_machine_t *machine, const uint8_t *data, uint32_t field)
{
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        if (channel->direction == FCSL_SENSOR && channel->field == field && data[channel->attached_offset] != 0) {
            return channel;
        }
    }
    return NULL;
}

/* What writes the field anyway, as things stand in the publication `data`: a path, "the machine", "channel NAME",
 * "instance NAME", or "". */
static void find_writer(const fcsl_vars_block_t *block, uint32_t index, const uint8_t *data, char *text, size_t size)
{
    const fcsl_machine_t *machine = block->machine;
    const fcsl_field_t *field = &block->fields[index];
    text[0] = '\0';
    if (block->writers != NULL && block->writers[index] != NULL) {
        (void)snprintf(text, size, "%s", block->writers[index]);
    } else if (machine != NULL && field->connected_from != FCSL_NONE) {
        (void)snprintf(text, size, "%s", fcsl_value_source(machine->fields, field));
    } else if (machine != NULL) {
        const fcsl_channel_t *channel = serving_channel(machine, data, index);
        if (channel != NULL) {
            (void)snprintf(text, size, "channel %s", channel->name);
        } else if ((field->flags & FCSL_FIELD_ASSIGNED) != 0 && is_scheduled(machine, data, field->instance)) {
            (void)snprintf(text, size, "instance %s", machine->instances[field->instance].name);
        } else if ((field->flags & (FCSL_FIELD_WRITABLE | FCSL_FIELD_FROZEN)) == 0) {
            (void)snprintf(text, size, "the machine");
        }
    }
}

void fcsl_write_overwritten(const protocol_t *protocol, json_out_t *out)
{
    const command_t *command = &protocol->slot->command;
    const catalog_t *catalog = &protocol->catalog;
    int some = 0;
    fcsl_json_raw(out, ",\"overwritten_by\":{");
    for (uint32_t i = 0; i < command->write_count; i++) {
        const write_t *write = &command->writes[i];
        char text[NAME_BYTES];
        int listed = 0;
        for (uint32_t j = 0; j < i && !listed; j++) {
            listed = command->writes[j].block == write->block && command->writes[j].field == write->field;
        }
        find_writer(&catalog->blocks[write->block], write->field, protocol->snapshot + catalog->bases[write->block],
                    text, sizeof text);
        if (!listed && text[0] != '\0') {
            const char *prefix = catalog->blocks[write->block].prefix;
            fcsl_json_raw(out, "%s\"%s%s%s\":", some ? "," : "", prefix, prefix[0] != '\0' ? "." : "",
                          catalog->blocks[write->block].fields[write->field].path);
            fcsl_json_quoted(out, text);
            some = 1;
        }
    }
    fcsl_json_raw(out, "}");
}

/* ---- set ----------------------------------------------------------------------------------------------------------- */

static int check_writable(request_t *request, const target_t *target)
{
    const fcsl_field_t *field = target->field;
    if ((field->flags & FCSL_FIELD_FROZEN) != 0) {
        return fcsl_request_refuse(request, "refused", "",
                                   "'%s' is frozen: the compiler folded its value into the code", target->entry->path);
    }
    if ((field->flags & FCSL_FIELD_WRITABLE) != 0) {
        return 0;
    }
    const protocol_t *protocol = request->protocol;
    const uint32_t block = target->entry->block;
    if (fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    find_writer(&protocol->catalog.blocks[block], target->entry->field,
                protocol->snapshot + protocol->catalog.bases[block], request->error_writer,
                sizeof request->error_writer);
    return fcsl_request_refuse(request, "refused", "", "'%s' cannot be set: it is computed here", target->entry->path);
}

/* Cuts what is meant into contiguous pieces of fields. */
static int add_writes(request_t *request, const target_t *target, size_t at)
{
    command_t *command = &request->protocol->slot->command;
    const fcsl_field_t *fields = request->protocol->catalog.blocks[target->entry->block].fields;
    const uint32_t scalar = fcsl_scalar_size(target->field->type);
    const uint32_t count = fcsl_view_count(&target->view);
    write_t *write = NULL;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t field = target->entry->field + (uint32_t)fcsl_view_field(&target->view, i);
        const int64_t byte = target->field->offset + fcsl_view_byte(&target->view, i);
        const uint32_t element = (uint32_t)(byte - fields[field].offset) / scalar;
        if (write == NULL || field != write->field || element != write->element + write->size / scalar) {
            if (command->write_count == WRITES_MAX) {
                return fcsl_request_refuse(request, "too_large", "", "one set writes at most %d pieces of fields",
                                           WRITES_MAX);
            }
            write = &command->writes[command->write_count++];
            *write = (write_t){
                .block = target->entry->block, .field = field, .element = element, .at = at + (size_t)i * scalar};
        }
        write->size += scalar;
    }
    return 0;
}

/* The step thread writes without a second check: what it would refuse is refused here. */
static int check_writes(request_t *request)
{
    const command_t *command = &request->protocol->slot->command;
    for (uint32_t i = 0; i < command->write_count; i++) {
        const write_t *write = &command->writes[i];
        const fcsl_vars_block_t *block = &request->protocol->catalog.blocks[write->block];
        const fcsl_field_t *field = &block->fields[write->field];
        fcsl_error_t error;
        if (fcsl_check_value(block->machine, field, command->bytes + write->at, write->size, &error) != 0) {
            return fcsl_request_refuse(request, "refused", "", "'%s%s%s' %s", block->prefix,
                                       block->prefix[0] != '\0' ? "." : "", field->path, error.text);
        }
    }
    return 0;
}

/* One member of "values"; `at` moves on behind its bytes. */
static int add_value(request_t *request, uint32_t name, int floats, size_t *at)
{
    command_t *command = &request->protocol->slot->command;
    target_t target;
    if (fcsl_request_target(request, name, &target) != 0 || check_writable(request, &target) != 0) {
        return -1;
    }
    const char *problem = fcsl_value_read(&target, &request->json, name + 1u, floats, command->bytes + *at);
    if (problem != NULL) {
        char type[NAME_BYTES];
        fcsl_value_type(target.field, &target.view, type, sizeof type);
        return fcsl_request_refuse(request, "bad_value", "", "'%.255s' is %.64s: %s", request->protocol->text, type,
                                   problem);
    }
    if (add_writes(request, &target, *at) != 0) {
        return -1;
    }
    *at += (size_t)fcsl_view_count(&target.view) * fcsl_scalar_size(target.field->type);
    return 0;
}

int fcsl_handle_set(request_t *request)
{
    const uint32_t values = fcsl_json_member(&request->json, 0, "values");
    int floats = FINITE_ONLY;
    size_t at = 0;
    if (values == 0 || request->json.tokens[values].type != JSON_OBJECT || request->json.tokens[values].count == 0) {
        return fcsl_request_refuse(request, "bad_request", "", "set needs \"values\": an object from paths to values");
    }
    if (fcsl_request_flag(request, "allow_non_finite", &floats) != 0) {
        return -1;
    }
    (void)fcsl_request_prepare(request, COMMAND_SET);
    uint32_t name = values + 1u;
    for (uint32_t i = 0; i < request->json.tokens[values].count; i++) {
        if (add_value(request, name, floats, &at) != 0) {
            return -1;
        }
        name = request->json.tokens[name + 1u].next;
    }
    return check_writes(request);
}

/* ---- the others ---------------------------------------------------------------------------------------------------- */

command_t *fcsl_request_prepare(request_t *request, command_kind_t kind)
{
    command_t *command = &request->protocol->slot->command;
    *command =
        (command_t){.kind = kind, .writes = command->writes, .bytes = command->bytes, .hardware = command->hardware};
    return command;
}

int fcsl_handle_pause(request_t *request)
{
    (void)fcsl_request_prepare(request, COMMAND_PAUSE);
    return 0;
}

int fcsl_handle_resume(request_t *request)
{
    (void)fcsl_request_prepare(request, COMMAND_RESUME);
    return 0;
}

uint64_t fcsl_protocol_next_ticks(protocol_t *protocol)
{
    static const uint64_t UNWATCHED_TICKS = 1000u;
    const uint64_t most = protocol->ticks_at_once != 0 ? protocol->ticks_at_once : UNWATCHED_TICKS;
    const uint64_t count = protocol->ticks_left < most ? protocol->ticks_left : most;
    protocol->ticks_left -= count;
    return count;
}

int fcsl_handle_tick(request_t *request)
{
    uint64_t count = 1;
    if (fcsl_request_number(request, "count", TICKS_MAX, &count) != 0) {
        return -1;
    }
    request->protocol->ticks_left = count;
    request->protocol->ticks_stopped = 0;
    fcsl_request_prepare(request, COMMAND_TICK)->count = fcsl_protocol_next_ticks(request->protocol);
    return 0;
}

int fcsl_handle_set_state(request_t *request)
{
    const fcsl_machine_t *machine = fcsl_request_machine(request);
    const char *name = machine != NULL ? fcsl_request_text(request, "state", NAME_BYTES) : NULL;
    if (name == NULL) {
        return -1;
    }
    const int32_t state = fcsl_enumerator_find(machine, FCSL_STATE, name, strlen(name));
    if (state == FCSL_NONE) {
        return fcsl_request_refuse(request, "unknown_state", fcsl_nearest_state(machine, name), "no state '%s'", name);
    }
    command_t *command = fcsl_request_prepare(request, COMMAND_SET_STATE);
    command->block = request->protocol->catalog.machine;
    command->state = state;
    return 0;
}
