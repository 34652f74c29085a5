/* SPDX-License-Identifier: Apache-2.0
 *
 * What the actuators get, described like the outputs of a model: so it is recorded, served and sent as the plant's truth is.
 */
#include "actuators.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"

static const char NAME[] = "actuators";
static const char PREFIX[] = "outputs.";
enum { GATE = 0, FIRST_CHANNEL = 1 }; /* fields */

static uint32_t next_multiple(uint32_t offset)
{
    return (offset + 7u) / 8u * 8u;
}

/* "wing.left" becomes outputs.wing_left. The compiler refuses channels that become one name. Returns the end of the text. */
static char *write_path(char *text, const char *channel)
{
    const size_t length = strlen(channel);
    memcpy(text, PREFIX, sizeof PREFIX);
    text += sizeof PREFIX - 1u;
    for (size_t i = 0; i <= length; i++) {
        text[i] = channel[i];
        if (text[i] == '.') {
            text[i] = '_';
        }
    }
    return text + length + 1u;
}

static void fill(fcsl_actuators_t *actuators, const fcsl_machine_t *machine, size_t text_bytes)
{
    char *text = actuators->texts;
    actuators->model.name = text;
    text += snprintf(text, text_bytes, "%s_%s", machine->name, NAME) + 1;
    actuators->fields[GATE] = (fcsl_field_t){.path = "outputs.gate",
                                             .role = FCSL_ROLE_OUTPUT,
                                             .type = FCSL_U32,
                                             .count = 1,
                                             .size = sizeof(uint32_t),
                                             .instance = FCSL_NONE,
                                             .connected_from = FCSL_NONE,
                                             .unit = "",
                                             .doc = "0: disarmed, 1: armed, 2: no command came in time",
                                             .minimum = -(double)INFINITY,
                                             .maximum = (double)INFINITY};
    uint32_t count = FIRST_CHANNEL;
    uint32_t offset = next_multiple(actuators->fields[GATE].size);
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        if (channel->direction != FCSL_ACTUATOR) {
            continue;
        }
        fcsl_field_t *field = &actuators->fields[count++];
        *field = machine->fields[channel->field];
        field->path = text;
        field->flags = 0;
        field->instance = field->connected_from = FCSL_NONE;
        field->offset = offset;
        text = write_path(text, channel->name);
        offset = next_multiple(offset + field->size);
    }
    actuators->model.abi_version = FCSL_MODEL_ABI_VERSION;
    actuators->model.size = offset;
    actuators->model.fields = actuators->fields;
    actuators->model.field_count = count;
}

static int build_table(fcsl_sim_t *sim)
{
    const fcsl_machine_t *machine = sim->machine;
    size_t text_bytes = strlen(machine->name) + sizeof "_" + sizeof NAME;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        text_bytes += sizeof PREFIX + strlen(machine->channels[i].name);
    }
    fcsl_actuators_t *actuators = calloc(1, sizeof *actuators);
    sim->actuators = actuators;
    if (!actuators) {
        return -1;
    }
    actuators->fields = calloc(machine->channel_count + FIRST_CHANNEL, sizeof *actuators->fields);
    actuators->texts = calloc(text_bytes, 1);
    if (!actuators->fields || !actuators->texts) {
        return -1;
    }
    fill(actuators, machine, text_bytes);
    actuators->as_instance.name = NAME;
    actuators->as_instance.model = &actuators->model;
    actuators->as_instance.data = calloc(actuators->model.size, 1);
    return actuators->as_instance.data ? 0 : -1;
}

int fcsl_actuators_build(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = sim->machine;
    sim->gate = fcsl_gate(machine, sim->image);
    if (machine->arm_field == FCSL_NONE && machine->command_timeout_ns == 0) {
        return 0;
    }
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        if (strcmp(sim->plant.instances[i].name, NAME) == 0) {
            return fcsl_fail(error, "model instance `%s` is named like the topic of what the actuators get: rename it",
                             NAME);
        }
    }
    if (build_table(sim)) {
        return fcsl_fail(error, "no memory for the actuators");
    }
    fcsl_actuators_update(sim);
    return 0;
}

void fcsl_actuators_free(fcsl_sim_t *sim)
{
    if (sim->actuators) {
        free(sim->actuators->fields);
        free(sim->actuators->texts);
        free(sim->actuators->as_instance.data);
        free(sim->actuators);
    }
}

void fcsl_actuators_update(fcsl_sim_t *sim)
{
    if (!sim->actuators) {
        return;
    }
    const fcsl_machine_t *machine = sim->machine;
    uint8_t *data = sim->actuators->as_instance.data;
    const fcsl_field_t *to = sim->actuators->fields;
    const uint32_t state = (uint32_t)sim->gate.state;
    memcpy(data + to->offset, &state, sizeof state);
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        if (channel->direction == FCSL_ACTUATOR) {
            to++;
            memcpy(data + to->offset, sim->image + machine->fields[channel->field].offset, to->size);
        }
    }
}
