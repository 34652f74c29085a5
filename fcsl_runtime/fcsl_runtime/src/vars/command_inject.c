/* SPDX-License-Identifier: Apache-2.0
 *
 * Commands with which a test plays the world of a machine: faults, samples of sensors, recordings.
 */
#include <string.h>

#include "fcsl/fcsl_channels.h"
#include "fcsl/fcsl_scalar.h"
#include "request.h"
#include "value.h"

int fcsl_handle_inject(request_t *request)
{
    static const char *const INJECTIONS[] = {[INJECT_FAULT] = "fault",
                                             [INJECT_OVERRUN] = "overrun",
                                             [INJECT_DEGRADED] = "degraded",
                                             [INJECT_FAILED] = "failed",
                                             NULL};
    const fcsl_machine_t *machine = fcsl_request_machine(request);
    const char *word = machine != NULL ? fcsl_request_text(request, "what", NAME_BYTES) : NULL;
    if (word == NULL) {
        return -1;
    }
    uint32_t what = 0;
    while (INJECTIONS[what] != NULL && strcmp(INJECTIONS[what], word) != 0) {
        what++;
    }
    if (INJECTIONS[what] == NULL) {
        return fcsl_request_refuse(request, "bad_value", fcsl_nearest(INJECTIONS, word),
                                   "nothing to inject is called '%s'", word);
    }
    const char *name = fcsl_request_text(request, "instance", NAME_BYTES);
    if (name == NULL) {
        return -1;
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        if (strcmp(machine->instances[i].name, name) == 0) {
            command_t *command = fcsl_request_prepare(request, COMMAND_INJECT);
            command->block = request->commander->catalog.machine;
            command->index = i;
            command->injection = (injection_t)what;
            return 0;
        }
    }
    return fcsl_request_refuse(request, "bad_value", fcsl_nearest_instance(machine, name), "no instance '%s'", name);
}

/* The sensor channel that a request names, or null after a refusal. */
static const fcsl_channel_t *find_sensor(request_t *request)
{
    const fcsl_machine_t *machine = fcsl_request_machine(request);
    const char *name = machine != NULL ? fcsl_request_text(request, "channel", NAME_BYTES) : NULL;
    const fcsl_channel_t *channel = name != NULL ? fcsl_find_channel(machine, name, strlen(name)) : NULL;
    if (channel != NULL && channel->direction == FCSL_SENSOR) {
        return channel;
    }
    if (name != NULL) {
        (void)fcsl_request_refuse(request, "bad_value", fcsl_nearest_sensor(machine, name), "no sensor channel '%s'",
                                  name);
    }
    return NULL;
}

static command_t *prepare_for(request_t *request, command_kind_t kind, const fcsl_channel_t *channel)
{
    const catalog_t *catalog = &request->commander->catalog;
    command_t *command = fcsl_request_prepare(request, kind);
    command->block = catalog->machine;
    command->index = (uint32_t)(channel - catalog->blocks[catalog->machine].machine->channels);
    return command;
}

int fcsl_handle_attach(request_t *request)
{
    const fcsl_channel_t *channel = find_sensor(request);
    if (channel == NULL) {
        return -1;
    }
    (void)prepare_for(request, COMMAND_ATTACH, channel);
    return 0;
}

/* The channel's whole field. */
static target_t target_of(const catalog_t *catalog, const fcsl_channel_t *channel)
{
    return fcsl_catalog_target(catalog, fcsl_catalog_field(catalog, catalog->machine, channel->field));
}

int fcsl_handle_sample(request_t *request)
{
    const fcsl_channel_t *channel = find_sensor(request);
    const uint32_t value = fcsl_json_member(&request->json, 0, "value");
    uint64_t age_ticks = 0;
    uint64_t stamp_ns = 0;
    int floats = FINITE_ONLY;
    if (channel == NULL || fcsl_request_number(request, "age_ticks", UINT32_MAX, &age_ticks) != 0 ||
        fcsl_request_number(request, "stamp_ns", INT64_MAX, &stamp_ns) != 0 ||
        fcsl_request_flag(request, "allow_non_finite", &floats) != 0) {
        return -1;
    }
    command_t *command = prepare_for(request, COMMAND_SAMPLE, channel);
    const target_t target = target_of(&request->commander->catalog, channel);
    const char *problem =
        value != 0 ? fcsl_value_read(&target, &request->json, value, floats, command->bytes) : "a \"value\" is missing";
    if (problem != NULL) {
        char type[NAME_BYTES];
        fcsl_value_type(target.field, &target.view, type, sizeof type);
        return fcsl_request_refuse(request, "bad_value", "", "channel '%s' is %.64s: %s", channel->name, type, problem);
    }
    fcsl_scalars_export(command->bytes, command->bytes, target.field->type, target.field->count);
    command->size = target.field->size;
    command->age_ticks = (uint32_t)age_ticks;
    command->stamp_ns = (int64_t)stamp_ns;
    return 0;
}

int fcsl_handle_record(request_t *request)
{
    command_t *command = fcsl_request_prepare(request, COMMAND_RECORD);
    const char *bag = fcsl_request_text(request, "bag", TEXT_BYTES);
    if (bag == NULL) {
        return -1;
    }
    const size_t length = strlen(bag) + 1u;
    memcpy(command->bytes, bag, length);
    command->bytes[length] = '\0';
    if (fcsl_json_member(&request->json, 0, "namespace") != 0) {
        const char *name_space = fcsl_request_text(request, "namespace", NAME_BYTES);
        if (name_space == NULL) {
            return -1;
        }
        memcpy(command->bytes + length, name_space, strlen(name_space) + 1u);
    }
    return 0;
}

int fcsl_handle_stop_recording(request_t *request)
{
    (void)fcsl_request_prepare(request, COMMAND_STOP_RECORDING);
    return 0;
}
