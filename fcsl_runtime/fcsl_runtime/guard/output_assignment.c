/* SPDX-License-Identifier: Apache-2.0
 *
 * Reads the assignments of outputs.
 */
#include "output_assignment.h"

#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_channels.h"
#include "fcsl/fcsl_library.h"

enum { LIST_BYTES = 256 };
static const char *const NOTHING = "none";

static void list_actuators(const fcsl_machine_t *machine, char *text, size_t size)
{
    size_t at = 0;
    (void)snprintf(text, size, "none");
    for (uint32_t i = 0; i < machine->channel_count && at < size; i++) {
        if (machine->channels[i].direction == FCSL_ACTUATOR) {
            const int length = snprintf(text + at, size - at, "%s%s", at > 0u ? ", " : "", machine->channels[i].name);
            at += length > 0 ? (size_t)length : 0u;
        }
    }
}

static int find_actuator(const fcsl_machine_t *machine, const char *name, size_t length, uint32_t *index,
                         fcsl_error_t *error)
{
    const fcsl_channel_t *channel = fcsl_find_channel(machine, name, length);
    if (channel != NULL) {
        *index = (uint32_t)(channel - machine->channels);
        return channel->direction == FCSL_ACTUATOR
                   ? 0
                   : fcsl_fail(error, "--actuator %s: channel '%s' is a sensor", name, channel->name);
    }
    char names[LIST_BYTES];
    list_actuators(machine, names, sizeof names);
    return fcsl_fail(error, "--actuator %.150s: machine '%.60s' has no such channel; its actuators are: %s", name,
                     machine->name, names);
}

/* `text` behind the equals sign. */
static int read_driver(const char *whole, const char *text, output_assignment_t *assignment, fcsl_error_t *error)
{
    assignment->device = "";
    if (strcmp(text, NOTHING) == 0) {
        return 0;
    }
    const char *name = text + fcsl_library_driver_name(text);
    const size_t rest = strcspn(name, ":");
    const size_t length = strcspn(name, ".:");
    const size_t driver = (size_t)(name - text) + length;
    if (length == 0u || driver >= sizeof assignment->driver || rest >= sizeof assignment->signal) {
        return fcsl_fail(error,
                         "--actuator %.200s: write CHANNEL=DRIVER[.SIGNAL][:DEVICE], where DRIVER is NAME or "
                         "LIBRARY.so:NAME, in less than 512 bytes",
                         whole);
    }
    memcpy(assignment->driver, text, driver);
    if (rest > length) {
        memcpy(assignment->signal, name + length + 1u, rest - length - 1u);
    }
    assignment->device = name[rest] == ':' ? name + rest + 1u : "";
    return 0;
}

static int read_assignment(const fcsl_machine_t *machine, const char *text, output_assignment_t *assignment,
                           fcsl_error_t *error)
{
    const char *equals = strchr(text, '=');
    memset(assignment, 0, sizeof *assignment);
    if (equals == NULL) {
        return fcsl_fail(error, "--actuator %.200s: write CHANNEL=DRIVER[.SIGNAL][:DEVICE], or CHANNEL=none", text);
    }
    return find_actuator(machine, text, (size_t)(equals - text), &assignment->channel, error) == 0
               ? read_driver(text, equals + 1, assignment, error)
               : -1;
}

int output_assignments_read(const fcsl_machine_t *machine, const char *const *texts, uint32_t count,
                            output_assignment_t *assignments, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < count; i++) {
        if (read_assignment(machine, texts[i], &assignments[i], error) != 0) {
            return -1;
        }
        for (uint32_t j = 0; j < i; j++) {
            if (assignments[j].channel == assignments[i].channel) {
                return fcsl_fail(error, "channel '%s' has two --actuator",
                                 machine->channels[assignments[i].channel].name);
            }
        }
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        uint32_t at = 0;
        while (at < count && assignments[at].channel != i) {
            at++;
        }
        if (machine->channels[i].direction == FCSL_ACTUATOR && at == count) {
            const char *name = machine->channels[i].name;
            return fcsl_fail(error,
                             "channel '%.100s' has no driver: give it one with --actuator %.100s=DRIVER:DEVICE, or "
                             "leave it without with --actuator %.100s=none",
                             name, name, name);
        }
    }
    return 0;
}
