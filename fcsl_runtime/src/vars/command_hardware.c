/* SPDX-License-Identifier: Apache-2.0
 *
 * `hardware`: one pin or channel of the simulated hardware that a machine reaches, read or put in.
 */
#include <inttypes.h>
#include <stddef.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "request.h"
#include "value.h"

enum { GPIO, ADC, PWM, COUNTER, BANKS };

static const char *const NAMES[BANKS + 1] = {"gpio", "adc", "pwm", "counter", NULL};
static const uint8_t TYPES[BANKS] = {FCSL_BOOL, FCSL_F64, FCSL_F64, FCSL_I64};
static const size_t OFFSETS[BANKS] = {offsetof(fcsl_hw_sim_t, gpio), offsetof(fcsl_hw_sim_t, adc),
                                      offsetof(fcsl_hw_sim_t, pwm), offsetof(fcsl_hw_sim_t, counter)};

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
        token != 0 ? fcsl_value_read(&target, &request->json, token, ANY_FLOAT, value) : "it is missing";
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
    if (number >= FCSL_HW_SIM_COUNT) {
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

void fcsl_reach_hardware(command_t *command, fcsl_hw_sim_t *hardware)
{
    const uint32_t size = fcsl_scalar_size(TYPES[command->bank]);
    uint8_t *cell = (uint8_t *)hardware + OFFSETS[command->bank] + (size_t)command->index * size;
    if (command->put) {
        memcpy(cell, command->bytes, size);
    }
    memcpy(command->bytes, cell, size);
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
