/* SPDX-License-Identifier: Apache-2.0
 *
 * Checkpoints (docs/guide/recording.md): to a client and back, or to a file in the folder that the program was started with. The
 * step thread copies what is saved, and gets what a checkpoint holds; everything else is done here, on the server's thread.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base64.h"
#include "run/checkpoint.h"
#include "base/replace_file.h"
#include "protocol.h"

enum { PORTION_BYTES = 360 * 1024 }; /* of one reply; a multiple of 3, so that the texts of portions can be joined */

static const fcsl_machine_t *machine_of(const protocol_t *protocol)
{
    return protocol->catalog.blocks[protocol->catalog.machine].machine;
}

static const fcsl_monitor_t *monitor_of(const protocol_t *protocol)
{
    return protocol->host->run != NULL ? fcsl_run_monitor(protocol->host->run) : NULL;
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
    if (request->protocol->checkpoints == NULL) {
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

static void join(const protocol_t *protocol, const char *name, char path[FILE_PATH_BYTES])
{
    (void)snprintf(path, FILE_PATH_BYTES, "%s/%s", protocol->checkpoints, name);
}

/* ---- save ---------------------------------------------------------------------------------------------------------- */

int fcsl_handle_save(request_t *request)
{
    char name[FILE_BYTES];
    if (fcsl_request_machine(request) == NULL || read_name(request, name) != 0) {
        return -1;
    }
    command_t *command = fcsl_request_prepare(request, COMMAND_SAVE);
    command->block = request->protocol->catalog.machine;
    memcpy(command->file, name, sizeof name);
    return 0;
}

void fcsl_protocol_complete(protocol_t *protocol)
{
    command_t *command = &protocol->slot->command;
    if (command->kind != COMMAND_SAVE || command->status != FCSL_VARS_OK) {
        return;
    }
    checkpoint_buffer_t *checkpoint = &protocol->checkpoint;
    const fcsl_machine_t *machine = machine_of(protocol);
    checkpoint->size = fcsl_checkpoint_encode(machine, command->bytes, monitor_of(protocol),
                                              command->bytes + machine->size, command->hardware, checkpoint->bytes);
    checkpoint->held = checkpoint->size;
    checkpoint->number++;
    if (command->file[0] != '\0') {
        char path[FILE_PATH_BYTES];
        join(protocol, command->file, path);
        if (fcsl_replace_file(path, checkpoint->bytes, checkpoint->size, &command->error) != 0) {
            command->status = FCSL_VARS_FAILED;
        }
    }
}

static void put_portion(const checkpoint_buffer_t *checkpoint, size_t at, json_out_t *out)
{
    const size_t left = checkpoint->size - at;
    const size_t size = left < PORTION_BYTES ? left : PORTION_BYTES;
    fcsl_json_raw(out, ",\"data\":\"");
    if (out->overflow || out->capacity - out->at < BASE64_BYTES(size)) {
        out->overflow = 1;
        return;
    }
    fcsl_base64_encode(checkpoint->bytes + at, size, out->text + out->at);
    out->at += BASE64_BYTES(size) - 1u;
    fcsl_json_raw(out, "\"");
}

void fcsl_write_saved(request_t *request)
{
    const protocol_t *protocol = request->protocol;
    const char *name = protocol->slot->command.file;
    fcsl_json_raw(request->out, ",\"bytes\":%zu", protocol->checkpoint.size);
    if (name[0] != '\0') {
        fcsl_json_raw(request->out, ",\"file\":");
        fcsl_json_quoted(request->out, name);
        return;
    }
    request->client->checkpoint_number = protocol->checkpoint.number;
    put_portion(&protocol->checkpoint, 0, request->out);
}

/* ---- portions ------------------------------------------------------------------------------------------------------ */

/* Whether the checkpoint that is kept is the one that this client saved or loads. */
static int is_own(const request_t *request)
{
    return request->client->checkpoint_number != 0 &&
           request->client->checkpoint_number == request->protocol->checkpoint.number;
}

static int is_whole(const checkpoint_buffer_t *checkpoint)
{
    return checkpoint->size > 0 && checkpoint->held == checkpoint->size;
}

/* Refuses what needs the client's own; `otherwise` is what to do when it never had one. */
static int refuse_foreign(request_t *request, const char *otherwise)
{
    const int had = request->client->checkpoint_number != 0;
    return fcsl_request_refuse(request, "refused", "save", "%s",
                               had ? "another client has saved or loaded since, and one checkpoint is kept: begin anew"
                                   : otherwise);
}

int fcsl_handle_saved(request_t *request)
{
    const checkpoint_buffer_t *checkpoint = &request->protocol->checkpoint;
    uint64_t at = 0;
    if (fcsl_request_number(request, "at", checkpoint->room, &at) != 0) {
        return -1;
    }
    if (!is_own(request)) {
        return refuse_foreign(request, "no checkpoint of this client is kept: save, or load one");
    }
    if (!is_whole(checkpoint)) {
        return fcsl_request_refuse(request, "refused", "load", "%zu of %zu bytes have been loaded", checkpoint->held,
                                   checkpoint->size);
    }
    if (at >= checkpoint->size) {
        return fcsl_request_refuse(request, "bad_request", "", "the checkpoint has %zu bytes", checkpoint->size);
    }
    put_portion(checkpoint, (size_t)at, request->out);
    return 0;
}

/* Brings the member "data", of `most` bytes at most, into protocol->incoming; returns how many, or -1 after a refusal. */
static ptrdiff_t take_data(request_t *request, size_t most)
{
    const char *data = fcsl_request_text(request, "data", REQUEST_BYTES_MAX);
    if (data == NULL) {
        return -1;
    }
    const size_t length = strlen(data);
    const ptrdiff_t bytes = fcsl_base64_size(data, length);
    if (bytes >= 0 && (size_t)bytes > most) {
        return fcsl_request_refuse(request, "bad_value", "",
                                   "\"data\" has %td bytes, and %zu are still to come at most", bytes, most);
    }
    if (bytes < 0 || fcsl_base64_decode(data, length, request->protocol->incoming, (size_t)bytes) != 0) {
        return fcsl_request_refuse(request, "bad_value", "", "\"data\" is not base64 text");
    }
    return bytes;
}

/* Of `bytes`, how many there will be, and `at`, how many have come. 0, or -1 after a refusal. */
static int read_extent(request_t *request, uint64_t *size, uint64_t *at)
{
    const checkpoint_buffer_t *checkpoint = &request->protocol->checkpoint;
    if (fcsl_request_number(request, "bytes", INT64_MAX, size) != 0 ||
        fcsl_request_number(request, "at", INT64_MAX, at) != 0) {
        return -1;
    }
    return *size < checkpoint->room
               ? 0
               : fcsl_request_refuse(request, "refused", "",
                                     "a checkpoint of machine '%s' has at most %zu bytes: one of %" PRIu64
                                     " is of another machine, or of another layout",
                                     machine_of(request->protocol)->name, checkpoint->room - 1u, *size);
}

int fcsl_handle_load(request_t *request)
{
    checkpoint_buffer_t *checkpoint = &request->protocol->checkpoint;
    const int begins = fcsl_json_member(&request->json, 0, "bytes") != 0;
    uint64_t size = checkpoint->size;
    uint64_t at = 0;
    if (fcsl_request_machine(request) == NULL || read_extent(request, &size, &at) != 0) {
        return -1;
    }
    if (!begins && !is_own(request)) {
        return refuse_foreign(request, "nothing of this client is being loaded: begin with \"bytes\"");
    }
    const size_t held = begins ? 0 : checkpoint->held;
    if (at != held) {
        return fcsl_request_refuse(request, "bad_request", "", "%zu bytes have come, so \"at\" must %s", held,
                                   held == 0 ? "be left out" : "be that");
    }
    const ptrdiff_t taken = take_data(request, (size_t)size - held);
    if (taken < 0) {
        return -1;
    }
    if (begins) { /* what another client had there is its no more */
        request->client->checkpoint_number = ++checkpoint->number;
        checkpoint->size = (size_t)size;
    }
    memcpy(checkpoint->bytes + held, request->protocol->incoming, (size_t)taken);
    checkpoint->held = held + (size_t)taken;
    fcsl_json_raw(request->out, ",\"loaded\":%zu", checkpoint->held);
    return 0;
}

/* ---- restore ------------------------------------------------------------------------------------------------------- */

/* Reads the file into protocol->incoming; returns its bytes, or -1 after a refusal. */
static ptrdiff_t take_file(request_t *request, const char *name)
{
    const protocol_t *protocol = request->protocol;
    char path[FILE_PATH_BYTES];
    fcsl_error_t error;
    join(protocol, name, path);
    const ptrdiff_t size = fcsl_checkpoint_read(path, 0, protocol->incoming, protocol->checkpoint.room, &error);
    return size >= 0 ? size : fcsl_request_refuse(request, "refused", "", "%s", error.text);
}

/* What is to be restored, and how many bytes; null after a refusal. What is kept stays as it is. */
static const uint8_t *find(request_t *request, size_t *size)
{
    const protocol_t *protocol = request->protocol;
    const checkpoint_buffer_t *checkpoint = &protocol->checkpoint;
    const int has_data = fcsl_json_member(&request->json, 0, "data") != 0;
    char name[FILE_BYTES];
    if (read_name(request, name) != 0) {
        return NULL;
    }
    if (has_data && name[0] != '\0') {
        (void)fcsl_request_refuse(request, "bad_request", "", "restore takes \"file\" or \"data\", not both");
        return NULL;
    }
    if (has_data || name[0] != '\0') {
        const ptrdiff_t taken = has_data ? take_data(request, checkpoint->room) : take_file(request, name);
        *size = taken >= 0 ? (size_t)taken : 0;
        return taken >= 0 ? protocol->incoming : NULL;
    }
    if (!is_own(request)) {
        (void)refuse_foreign(request, "restore needs \"data\" or \"file\", or what was saved or loaded before");
        return NULL;
    }
    if (!is_whole(checkpoint)) {
        (void)fcsl_request_refuse(request, "refused", "load", "%zu of %zu bytes have been loaded", checkpoint->held,
                                  checkpoint->size);
        return NULL;
    }
    *size = checkpoint->size;
    return checkpoint->bytes;
}

int fcsl_handle_restore(request_t *request)
{
    const fcsl_machine_t *machine = fcsl_request_machine(request);
    int ignore_source_hash = 0;
    size_t size = 0;
    if (machine == NULL || fcsl_request_flag(request, "ignore_source_hash", &ignore_source_hash) != 0) {
        return -1;
    }
    const uint8_t *bytes = find(request, &size);
    if (bytes == NULL) {
        return -1;
    }
    fcsl_checkpoint_t checkpoint;
    fcsl_error_t error;
    if (fcsl_checkpoint_decode(machine, monitor_of(request->protocol), bytes, size, ignore_source_hash, &checkpoint,
                               &error) != 0) {
        return fcsl_request_refuse(request, "refused", "", "%s", error.text);
    }
    command_t *command = fcsl_request_prepare(request, COMMAND_RESTORE);
    command->block = request->protocol->catalog.machine;
    memcpy(command->bytes, checkpoint.data, checkpoint.size);
    command->size = checkpoint.size;
    fcsl_checkpoint_hardware(&checkpoint, command->hardware);
    return 0;
}
