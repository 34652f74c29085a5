/* SPDX-License-Identifier: Apache-2.0
 *
 * Parameter files (docs/reference/variables.md): what differs from the compiled values, and a set that takes the place of others between
 * two ticks.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_parameters.h"
#include "fcsl/fcsl_scalar.h"
#include "protocol.h"

int fcsl_protocol_open_parameters(protocol_t *protocol, const fcsl_machine_t *machine)
{
    if (machine == NULL) {
        return 0;
    }
    const size_t align = machine->align > sizeof(void *) ? machine->align : sizeof(void *);
    protocol->compiled = aligned_alloc(align, (machine->size + align - 1u) / align * align);
    protocol->file = malloc(PARAMETER_TEXT_BYTES);
    if (protocol->compiled == NULL || protocol->file == NULL) {
        return -1;
    }
    machine->init(protocol->compiled);
    return 0;
}

int fcsl_handle_parameters(request_t *request)
{
    const protocol_t *protocol = request->protocol;
    const fcsl_machine_t *machine = fcsl_request_machine(request);
    if (machine == NULL || fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    const uint8_t *data = protocol->snapshot + protocol->catalog.bases[protocol->catalog.machine];
    if (fcsl_parameters_write(machine, data, protocol->compiled, protocol->file, PARAMETER_TEXT_BYTES) < 0) {
        return fcsl_request_refuse(request, "too_large", "", "the parameters that differ take more than %d bytes",
                                   PARAMETER_TEXT_BYTES);
    }
    fcsl_json_raw(request->out, ",\"file\":");
    fcsl_json_quoted(request->out, protocol->file);
    return 0;
}

typedef struct {
    command_t *command;
    uint32_t block;
    const fcsl_field_t *fields;
    size_t at;
} set_t;

/* One write for each parameter; of each scalar the text has two bytes at least, so that the values fit. */
static int add_write(void *ctx, uint32_t field, const void *bytes, fcsl_error_t *error)
{
    set_t *set = ctx;
    command_t *command = set->command;
    const uint32_t size = set->fields[field].size;
    if (command->write_count == WRITES_MAX) {
        return fcsl_fail(error, "one request sets at most %d parameters", WRITES_MAX);
    }
    command->writes[command->write_count++] =
        (write_t){.block = set->block, .field = field, .size = size, .at = set->at};
    memcpy(command->bytes + set->at, bytes, size);
    set->at += size;
    return 0;
}

int fcsl_handle_set_parameters(request_t *request)
{
    char name[NAME_BYTES];
    const fcsl_machine_t *machine = fcsl_request_machine(request);
    const char *text = machine != NULL ? fcsl_request_text(request, "name", NAME_BYTES) : NULL;
    if (text == NULL) {
        return -1;
    }
    memcpy(name, text, strlen(text) + 1u);
    text = fcsl_request_text(request, "file", REQUEST_BYTES_MAX);
    if (text == NULL) {
        return -1;
    }
    const uint32_t block = request->protocol->catalog.machine;
    set_t set = {.command = fcsl_request_prepare(request, COMMAND_SET), .block = block, .fields = machine->fields};
    const fcsl_parameters_t parameters = {.text = text, .size = strlen(text), .name = name, .name_space = ""};
    fcsl_error_t error;
    if (fcsl_parameters_each(machine, &parameters, add_write, &set, &error) != 0) {
        return fcsl_request_refuse(request, "refused", "", "%s", error.text);
    }
    return 0;
}
