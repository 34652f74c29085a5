/* SPDX-License-Identifier: Apache-2.0
 *
 * What a test injects into a machine: faults, samples of sensors, simulated hardware; and recordings.
 */
#include <inttypes.h>
#include <string.h>

#include "fcsl/fcsl_channels.h"
#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_scalar.h"
#include "protocol.h"
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
            command->block = request->protocol->catalog.machine;
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
    const catalog_t *catalog = &request->protocol->catalog;
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
    const target_t target = target_of(&request->protocol->catalog, channel);
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

/* ---- hardware: one pin, channel or register of the simulated hardware, read or put in ---------------------------- */

enum { GPIO, ADC, REGISTERS, BANKS };

static const char *const NAMES[BANKS + 1] = {"gpio", "adc", "registers", NULL};
static const uint8_t TYPES[BANKS] = {FCSL_BOOL, FCSL_U32, FCSL_U32};

/* A scalar of this type, for value.c. */
static target_t scalar_of(fcsl_field_t *field, uint8_t type)
{
    *field = (fcsl_field_t){.type = type, .count = 1, .size = fcsl_scalar_size(type)};
    return (target_t){.field = field, .view = fcsl_view_whole(field)};
}

/* Reads a member as a scalar; 0, or -1 after a refusal. */
static int read_member(request_t *request, const char *key, uint32_t token, uint8_t type, void *value)
{
    fcsl_field_t field;
    const target_t target = scalar_of(&field, type);
    const char *problem =
        token != 0 ? fcsl_value_read(&target, &request->json, token, FINITE_ONLY, value) : "it is missing";
    return problem == NULL ? 0 : fcsl_request_refuse(request, "bad_value", "", "\"%s\": %s", key, problem);
}

int fcsl_handle_hardware(request_t *request)
{
    const char *name = fcsl_request_machine(request) != NULL ? fcsl_request_text(request, "bank", NAME_BYTES) : NULL;
    uint32_t bank = 0;
    uint32_t number = 0;
    if (name == NULL) {
        return -1;
    }
    while (NAMES[bank] != NULL && strcmp(NAMES[bank], name) != 0) {
        bank++;
    }
    if (bank == BANKS) {
        return fcsl_request_refuse(request, "bad_value", fcsl_nearest(NAMES, name), "no hardware is called '%s'", name);
    }
    if (read_member(request, "number", fcsl_json_member(&request->json, 0, "number"), FCSL_U32, &number) != 0) {
        return -1;
    }
    if (bank != REGISTERS && number >= FCSL_HW_SIM_COUNT) {
        return fcsl_request_refuse(request, "bad_value", "", "pins and channels are numbered 0 to %d",
                                   FCSL_HW_SIM_COUNT - 1);
    }
    const uint32_t token = fcsl_json_member(&request->json, 0, "value");
    command_t *command = fcsl_request_prepare(request, COMMAND_HARDWARE);
    command->block = request->protocol->catalog.machine;
    command->bank = bank;
    command->index = number;
    command->put = token != 0;
    return token != 0 ? read_member(request, "value", token, TYPES[bank], command->bytes) : 0;
}

static int put(const command_t *command, fcsl_hw_sim_t *hardware)
{
    uint32_t value = 0;
    switch (command->bank) {
    case GPIO:
        hardware->gpio[command->index] = command->bytes[0] != 0;
        return 0;
    case ADC:
        memcpy(&hardware->adc[command->index], command->bytes, sizeof value);
        return 0;
    default:
        memcpy(&value, command->bytes, sizeof value);
        return fcsl_hw_sim_set_register(hardware, command->index, value);
    }
}

static uint32_t get(const command_t *command, const fcsl_hw_sim_t *hardware)
{
    switch (command->bank) {
    case GPIO:
        return hardware->gpio[command->index] ? 1u : 0u;
    case ADC:
        return hardware->adc[command->index];
    default:
        return fcsl_hw_sim_register(hardware, command->index);
    }
}

fcsl_vars_status_t fcsl_reach_hardware(command_t *command, fcsl_hw_sim_t *hardware)
{
    if (command->put && put(command, hardware) != 0) {
        (void)fcsl_fail(&command->error, "simulated hardware is full: %d registers have a value already",
                        FCSL_HW_SIM_COUNT);
        return FCSL_VARS_REFUSED;
    }
    const uint32_t value = get(command, hardware);
    const uint8_t level = value != 0;
    memcpy(command->bytes, command->bank == GPIO ? (const void *)&level : &value,
           fcsl_scalar_size(TYPES[command->bank]));
    return FCSL_VARS_OK;
}

void fcsl_write_hardware(const protocol_t *protocol, json_out_t *out)
{
    const command_t *command = &protocol->slot->command;
    fcsl_field_t field;
    const target_t target = scalar_of(&field, TYPES[command->bank]);
    fcsl_json_raw(out, ",\"value\":");
    fcsl_value_write(&target, command->bytes, out);
    fcsl_json_raw(out, ",\"failures\":%" PRIu64, command->count);
}
