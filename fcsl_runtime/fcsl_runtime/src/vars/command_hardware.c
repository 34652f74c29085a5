/* SPDX-License-Identifier: Apache-2.0
 *
 * `hardware`: one pin, channel or register of the simulated hardware that a machine reaches, read or put in.
 */
#include <inttypes.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_scalar.h"
#include "request.h"
#include "value.h"

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
    command->block = request->commander->catalog.machine;
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

void fcsl_write_hardware(const commander_t *commander, json_out_t *out)
{
    const command_t *command = &commander->mailbox->command;
    fcsl_field_t field;
    const target_t target = scalar_of(&field, TYPES[command->bank]);
    fcsl_json_raw(out, ",\"value\":");
    fcsl_value_write(&target, command->bytes, out);
    fcsl_json_raw(out, ",\"failures\":%" PRIu64, command->count);
}
