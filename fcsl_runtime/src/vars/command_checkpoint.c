/* SPDX-License-Identifier: Apache-2.0
 *
 * Checkpoints (docs/checkpoints.md): to a client and back, or to a file in the folder that the program was started with. The
 * step thread copies what is saved, and gets what a checkpoint holds; everything else is done here, on the server's thread.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base64.h"
#include "checkpoint.h"
#include "replace_file.h"
#include "request.h"

enum { PORTION_BYTES = 360 * 1024 }; /* of one reply; a multiple of 3, so that the texts of portions can be joined */

static const fcsl_machine_t *machine_of(const commander_t *commander)
{
    return commander->catalog.blocks[commander->catalog.machine].machine;
}

/* ---- files --------------------------------------------------------------------------------------------------------- */

static int is_plain(const char *name)
{
    static const char PLAIN[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._+-";
    static const char PARTIAL[] = ".tmp"; /* what a file that is being written ends in */
    const size_t length = strlen(name);
    return length > 0 && length < FILE_BYTES && name[strspn(name, PLAIN)] == '\0' && name[0] != '.' && name[0] != '-' &&
           (length < sizeof PARTIAL || strcmp(name + length + 1u - sizeof PARTIAL, PARTIAL) != 0);
}

/* The member "file"; "" when there is none. */
static int read_name(request_t *request, char name[FILE_BYTES])
{
    name[0] = '\0';
    if (fcsl_json_member(&request->json, 0, "file") == 0) {
        return 0;
    }
    if (request->commander->checkpoints == NULL) {
        return fcsl_request_refuse(request, "refused", "",
                                   "this program was not told where: start it with --checkpoints DIR");
    }
    const char *text = fcsl_request_text(request, "file", TEXT_BYTES);
    if (text == NULL) {
        return -1;
    }
    if (!is_plain(text)) {
        return fcsl_request_refuse(request, "bad_value", "",
                                   "\"file\" is the name of one file: at most %d letters, digits and . _ + -, not "
                                   "beginning with . or -, not ending in .tmp",
                                   FILE_BYTES - 1);
    }
    memcpy(name, text, strlen(text) + 1u);
    return 0;
}

static void join(const commander_t *commander, const char *name, char path[FILE_PATH_BYTES])
{
    (void)snprintf(path, FILE_PATH_BYTES, "%s/%s", commander->checkpoints, name);
}

/* ---- save ---------------------------------------------------------------------------------------------------------- */

int fcsl_handle_save(request_t *request)
{
    char name[FILE_BYTES];
    if (fcsl_request_machine(request) == NULL || read_name(request, name) != 0) {
        return -1;
    }
    command_t *command = fcsl_request_prepare(request, COMMAND_SAVE);
    command->block = request->commander->catalog.machine;
    memcpy(command->file, name, sizeof name);
    return 0;
}

void fcsl_commander_complete(commander_t *commander)
{
    command_t *command = &commander->mailbox->command;
    if (command->kind != COMMAND_SAVE || command->status != FCSL_VARS_OK) {
        return;
    }
    commander->checkpoint_size =
        fcsl_checkpoint_encode(machine_of(commander), command->bytes, command->hardware, commander->checkpoint);
    commander->checkpoint_held = commander->checkpoint_size;
    commander->checkpoint_number++;
    if (command->file[0] != '\0') {
        char path[FILE_PATH_BYTES];
        join(commander, command->file, path);
        if (fcsl_replace_file(path, commander->checkpoint, commander->checkpoint_size, &command->error) != 0) {
            command->status = FCSL_VARS_FAILED;
        }
    }
}

static void put_portion(const commander_t *commander, size_t at, json_out_t *out)
{
    const size_t left = commander->checkpoint_size - at;
    const size_t size = left < PORTION_BYTES ? left : PORTION_BYTES;
    fcsl_json_raw(out, ",\"data\":\"");
    if (out->overflow || out->capacity - out->at < BASE64_BYTES(size)) {
        out->overflow = 1;
        return;
    }
    fcsl_base64_encode(commander->checkpoint + at, size, out->text + out->at);
    out->at += BASE64_BYTES(size) - 1u;
    fcsl_json_raw(out, "\"");
}

void fcsl_write_saved(request_t *request)
{
    const commander_t *commander = request->commander;
    const char *name = commander->mailbox->command.file;
    fcsl_json_raw(request->out, ",\"bytes\":%zu", commander->checkpoint_size);
    if (name[0] != '\0') {
        fcsl_json_raw(request->out, ",\"file\":");
        fcsl_json_quoted(request->out, name);
        return;
    }
    request->session->checkpoint_number = commander->checkpoint_number;
    put_portion(commander, 0, request->out);
}

/* ---- portions ------------------------------------------------------------------------------------------------------ */

/* Whether the checkpoint that is kept is the one that this client saved, loads or has restored. */
static int is_own(const request_t *request)
{
    return request->session->checkpoint_number != 0 &&
           request->session->checkpoint_number == request->commander->checkpoint_number;
}

int fcsl_handle_saved(request_t *request)
{
    const commander_t *commander = request->commander;
    uint64_t at = 0;
    if (fcsl_request_number(request, "at", commander->checkpoint_room, &at) != 0) {
        return -1;
    }
    if (!is_own(request) || commander->checkpoint_held < commander->checkpoint_size) {
        return fcsl_request_refuse(request, "refused", "save",
                                   "no checkpoint of this client is kept: one is, of whoever saved or loaded last");
    }
    if (at >= commander->checkpoint_size) {
        return fcsl_request_refuse(request, "bad_request", "", "the checkpoint has %zu bytes",
                                   commander->checkpoint_size);
    }
    put_portion(commander, (size_t)at, request->out);
    return 0;
}

/* Puts the member "data" behind `held` bytes, `size` in all at most; returns how many, or -1 after a refusal. */
static ptrdiff_t take_data(request_t *request, size_t held, size_t size)
{
    const char *data = fcsl_request_text(request, "data", REQUEST_BYTES_MAX);
    if (data == NULL) {
        return -1;
    }
    const ptrdiff_t bytes = fcsl_base64_size(data, strlen(data));
    if (bytes < 0 || (size_t)bytes > size - held ||
        fcsl_base64_decode(data, strlen(data), request->commander->checkpoint + held, (size_t)bytes) != 0) {
        return fcsl_request_refuse(request, "bad_value", "", "\"data\" is not the base64 text of a checkpoint");
    }
    return bytes;
}

int fcsl_handle_load(request_t *request)
{
    commander_t *commander = request->commander;
    const int begins = fcsl_json_member(&request->json, 0, "bytes") != 0;
    uint64_t size = commander->checkpoint_size;
    uint64_t at = 0;
    if (fcsl_request_machine(request) == NULL ||
        fcsl_request_number(request, "bytes", commander->checkpoint_room - 1u, &size) != 0 ||
        fcsl_request_number(request, "at", commander->checkpoint_room, &at) != 0) {
        return -1;
    }
    if (!begins && !is_own(request)) {
        return fcsl_request_refuse(request, "refused", "",
                                   "nothing of this client is being loaded: begin with \"bytes\", as somebody else may "
                                   "have done since");
    }
    const size_t held = begins ? 0 : commander->checkpoint_held;
    if (at != held) {
        return fcsl_request_refuse(request, "bad_request", "", "%zu bytes have come, so \"at\" must be that", held);
    }
    if (begins) {
        /* Before anything is written: what another client had there is its no more, also when this is refused. */
        request->session->checkpoint_number = ++commander->checkpoint_number;
        commander->checkpoint_size = (size_t)size;
        commander->checkpoint_held = 0;
    }
    const ptrdiff_t taken = take_data(request, held, (size_t)size);
    if (taken < 0) {
        return -1;
    }
    commander->checkpoint_held = held + (size_t)taken;
    fcsl_json_raw(request->out, ",\"loaded\":%zu", commander->checkpoint_held);
    return 0;
}

/* ---- restore ------------------------------------------------------------------------------------------------------- */

/* Brings what is to be restored into commander->checkpoint; returns its bytes, or -1 after a refusal. */
static ptrdiff_t fetch(request_t *request)
{
    commander_t *commander = request->commander;
    const int has_data = fcsl_json_member(&request->json, 0, "data") != 0;
    char name[FILE_BYTES];
    char path[FILE_PATH_BYTES];
    fcsl_error_t error;
    if (read_name(request, name) != 0) {
        return -1;
    }
    if (has_data && name[0] != '\0') {
        return fcsl_request_refuse(request, "bad_request", "", "restore takes \"file\" or \"data\", not both");
    }
    if (!has_data && name[0] == '\0') {
        return is_own(request) && commander->checkpoint_held == commander->checkpoint_size
                   ? (ptrdiff_t)commander->checkpoint_size
                   : fcsl_request_refuse(request, "bad_request", "load",
                                         "restore needs \"data\" or \"file\", or all that `load` was told of");
    }
    request->session->checkpoint_number = ++commander->checkpoint_number;
    commander->checkpoint_held = 0;
    ptrdiff_t size = 0;
    if (has_data) {
        size = take_data(request, 0, commander->checkpoint_room);
    } else {
        join(commander, name, path);
        size = fcsl_checkpoint_read(path, 0, commander->checkpoint, commander->checkpoint_room, &error);
    }
    commander->checkpoint_size = size > 0 ? (size_t)size : 1u; /* nothing is not whole */
    commander->checkpoint_held = size > 0 ? (size_t)size : 0;
    return has_data || size >= 0 ? size : fcsl_request_refuse(request, "refused", "", "%s", error.text);
}

int fcsl_handle_restore(request_t *request)
{
    const fcsl_machine_t *machine = fcsl_request_machine(request);
    int other_source = 0;
    if (machine == NULL || fcsl_request_flag(request, "other_source", &other_source) != 0) {
        return -1;
    }
    const ptrdiff_t size = fetch(request);
    if (size < 0) {
        return -1;
    }
    fcsl_checkpoint_t held;
    fcsl_error_t error;
    if (fcsl_checkpoint_decode(machine, request->commander->checkpoint, (size_t)size, other_source, &held, &error) !=
        0) {
        return fcsl_request_refuse(request, "refused", "", "%s", error.text);
    }
    command_t *command = fcsl_request_prepare(request, COMMAND_RESTORE);
    command->block = request->commander->catalog.machine;
    memcpy(command->bytes, held.data, machine->size);
    fcsl_checkpoint_hardware(&held, command->hardware);
    return 0;
}
