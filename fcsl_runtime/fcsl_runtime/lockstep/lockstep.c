/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of a run in lock-step with a simulator, some at a time.
 */
#define _POSIX_C_SOURCE 200809L
#include "fcsl/fcsl_lockstep.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_monotonic.h"

enum { SPEC_BYTES = 512 };

struct fcsl_lockstep {
    fcsl_run_t *run;
    const fcsl_machine_t *machine;
    fcsl_topics_t *topics;
    fcsl_publish_queue_t *queue;
    fcsl_hal_t hal;
    int looks; /* for a simulator; it may be connected */
    int connected;
    uint8_t *sensor_bytes;
    uint8_t *actuator_bytes;
    size_t sensor_capacity;
    size_t actuator_capacity;
    int refused; /* a sensor message of this tick: `why` */
    fcsl_error_t why;
    uint32_t *missing; /* of each channel: ticks without a sample */
    int drops; /* some of them are not 0 */
    uint8_t *select;
    uint8_t *image; /* a struct of the machine: what is sensed while channels are missing */
    char address[SPEC_BYTES];
    char name_space[SPEC_BYTES];
};

__attribute__((format(printf, 2, 3))) static int fail(fcsl_error_t *error, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(error->text, sizeof error->text, format, arguments);
    va_end(arguments);
    return -1;
}

static void release(fcsl_lockstep_t *lockstep)
{
    free(lockstep->sensor_bytes);
    free(lockstep->actuator_bytes);
    free(lockstep->missing);
    free(lockstep->select);
    free(lockstep->image);
    free(lockstep);
}

fcsl_lockstep_t *fcsl_lockstep_new(fcsl_run_t *run, fcsl_topics_t *topics, fcsl_publish_queue_t *queue,
                                   const char *address, const char *name_space, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    fcsl_lockstep_t *lockstep = calloc(1, sizeof *lockstep);
    if (lockstep == NULL) {
        (void)fail(error, "out of memory for the lock-step");
        return NULL;
    }
    lockstep->run = run;
    lockstep->machine = machine;
    lockstep->topics = topics;
    lockstep->queue = queue;
    lockstep->sensor_capacity = fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE);
    lockstep->actuator_capacity = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    lockstep->sensor_bytes = malloc(lockstep->sensor_capacity);
    lockstep->actuator_bytes = malloc(lockstep->actuator_capacity);
    lockstep->missing = calloc(machine->channel_count + 1u, sizeof *lockstep->missing);
    lockstep->select = calloc(machine->channel_count + 1u, 1);
    lockstep->image = calloc(1, machine->size);
    if (lockstep->sensor_bytes == NULL || lockstep->actuator_bytes == NULL || lockstep->missing == NULL ||
        lockstep->select == NULL || lockstep->image == NULL || strlen(address) >= SPEC_BYTES ||
        strlen(name_space) >= SPEC_BYTES) {
        (void)fail(error, "out of memory for the lock-step, or an address of more than %d bytes", SPEC_BYTES - 1);
        release(lockstep);
        return NULL;
    }
    (void)snprintf(lockstep->address, SPEC_BYTES, "%s", address);
    (void)snprintf(lockstep->name_space, SPEC_BYTES, "%s", name_space);
    return lockstep;
}

void fcsl_lockstep_free(fcsl_lockstep_t *lockstep)
{
    fcsl_lockstep_leave(lockstep);
    release(lockstep);
}

/* ---- meeting and parting ------------------------------------------------------------------------------------------------ */

static int make_hal(fcsl_lockstep_t *lockstep, uint32_t wait_ms, uint32_t timeout_ms, fcsl_error_t *error)
{
    static const char WIRE[] = "wire:";
    const size_t prefix = sizeof WIRE - 1u;
    const char *address = lockstep->address;
    return strncmp(address, WIRE, prefix) == 0
               ? fcsl_hal_wire(address + prefix, lockstep->machine, wait_ms, timeout_ms, &lockstep->hal, error)
               : fcsl_hal_bus(address, lockstep->name_space, lockstep->machine, wait_ms, timeout_ms, &lockstep->hal,
                              error);
}

int fcsl_lockstep_connect(fcsl_lockstep_t *lockstep, uint32_t wait_ms, uint32_t timeout_ms, fcsl_error_t *error)
{
    fcsl_hal_t *hal = &lockstep->hal;
    if (lockstep->connected) {
        fcsl_lockstep_leave(lockstep);
    }
    if (!lockstep->looks && make_hal(lockstep, wait_ms, timeout_ms, error) != 0) {
        return -1;
    }
    lockstep->looks = 1;
    const int failed = hal->open(hal, error);
    if (failed < 0) {
        fcsl_lockstep_leave(lockstep);
    }
    lockstep->connected = !failed;
    return failed;
}

void fcsl_lockstep_keep_alive(fcsl_lockstep_t *lockstep)
{
    if (lockstep->connected) {
        lockstep->hal.alive(lockstep->hal.ctx);
    }
}

void fcsl_lockstep_leave(fcsl_lockstep_t *lockstep)
{
    if (lockstep->looks) {
        lockstep->looks = 0;
        lockstep->connected = 0;
        lockstep->hal.close(lockstep->hal.ctx);
    }
}

uint64_t fcsl_lockstep_count(const fcsl_lockstep_t *lockstep, const char *path)
{
    const fcsl_hal_t *hal = &lockstep->hal;
    uint64_t value = 0;
    if (!lockstep->connected) {
        return 0;
    }
    hal->count(hal->ctx);
    for (uint32_t i = 0; i < hal->field_count; i++) {
        if (strcmp(hal->fields[i].path, path) == 0 && hal->fields[i].type == FCSL_U64) {
            memcpy(&value, (const uint8_t *)hal->counters + hal->fields[i].offset, sizeof value);
        }
    }
    return value;
}

/* ---- dropouts ----------------------------------------------------------------------------------------------------------- */

int fcsl_lockstep_drop(fcsl_lockstep_t *lockstep, uint32_t channel, uint32_t ticks, fcsl_error_t *error)
{
    if (channel >= lockstep->machine->channel_count || lockstep->machine->channels[channel].direction != FCSL_SENSOR) {
        return fail(error, "there is no sensor channel number %u", (unsigned)channel);
    }
    lockstep->missing[channel] = ticks;
    lockstep->drops = 1;
    return 0;
}

void fcsl_lockstep_drop_none(fcsl_lockstep_t *lockstep)
{
    memset(lockstep->missing, 0, lockstep->machine->channel_count * sizeof *lockstep->missing);
    lockstep->drops = 0;
}

/* The sensor message without the channels that are missing in its tick. 0, or -1. */
static int strip(fcsl_lockstep_t *lockstep, const fcsl_message_t *sensed, fcsl_message_t *left)
{
    const fcsl_machine_t *machine = lockstep->machine;
    fcsl_message_entry_t entry = {0};
    memset(lockstep->select, 0, machine->channel_count);
    while (fcsl_message_next(machine, sensed, &entry)) {
        lockstep->select[entry.channel] = lockstep->missing[entry.channel] == 0;
    }
    lockstep->drops = 0;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        lockstep->missing[i] -= lockstep->missing[i] > 0 ? 1u : 0u;
        lockstep->drops |= lockstep->missing[i] > 0;
    }
    fcsl_message_apply(machine, lockstep->image, sensed);
    return fcsl_message_encode_sensors(fcsl_run_channels(lockstep->run), lockstep->image, sensed->tick,
                                       lockstep->select, lockstep->sensor_bytes, lockstep->sensor_capacity,
                                       left) == FCSL_MESSAGE_OK
               ? 0
               : fail(&lockstep->why, "a sensor message without its missing channels has no room");
}

/* What the simulator sensed goes into the run. */
static void sensed(void *ctx, const fcsl_message_t *message)
{
    fcsl_lockstep_t *lockstep = ctx;
    fcsl_message_t left = *message;
    lockstep->refused = (lockstep->drops && strip(lockstep, message, &left) != 0) ||
                        fcsl_run_sense_message(lockstep->run, &left, &lockstep->why) != 0;
}

/* ---- ticks -------------------------------------------------------------------------------------------------------------- */

static int end_of(const fcsl_lockstep_t *lockstep, fcsl_hal_status_t status, fcsl_error_t *error)
{
    switch (status) {
    case FCSL_HAL_CLOSED:
        return FCSL_LOCKSTEP_ENDED;
    case FCSL_HAL_AGAIN:
        return FCSL_LOCKSTEP_AGAIN;
    default:
        (void)fail(error, "%s", lockstep->hal.explain(lockstep->hal.ctx));
        return fcsl_lockstep_count(lockstep, "connected") ? -1 : FCSL_LOCKSTEP_DISCONNECTED;
    }
}

/* What has been sampled becomes a tick. Returns a fcsl_lockstep_status_t, or -1. */
static int make_tick(fcsl_lockstep_t *lockstep, fcsl_error_t *error)
{
    fcsl_run_t *run = lockstep->run;
    fcsl_message_t command;
    if (lockstep->refused) {
        return fail(error, "%s", lockstep->why.text);
    }
    if (fcsl_run_step(run, 1, error) != 0) {
        return -1;
    }
    if (fcsl_run_actuate_message(run, lockstep->actuator_bytes, lockstep->actuator_capacity, &command) != 0) {
        return fail(error, "an actuator channel holds what its type does not have: there is no message of it");
    }
    const fcsl_hal_status_t sent = lockstep->hal.command(lockstep->hal.ctx, &command);
    if (lockstep->topics != NULL) {
        const uint64_t tick = fcsl_run_tick(run) - 1u;
        fcsl_topics_put(lockstep->topics, (int64_t)fcsl_run_tick_time_ns(run, tick));
    }
    return sent == FCSL_HAL_OK ? FCSL_LOCKSTEP_RUNNING : end_of(lockstep, sent, error);
}

int fcsl_lockstep_run(fcsl_lockstep_t *lockstep, uint32_t slice_ms, fcsl_error_t *error)
{
    fcsl_hal_t *hal = &lockstep->hal;
    const uint64_t end_ns = fcsl_monotonic_ns() + (uint64_t)slice_ms * FCSL_NS_PER_MS;
    const fcsl_sink_t to = {.ctx = lockstep, .sensed = sensed};
    int status = lockstep->connected ? FCSL_LOCKSTEP_RUNNING : fail(error, "no simulator is connected");
    while (status == FCSL_LOCKSTEP_RUNNING && fcsl_monotonic_ns() < end_ns) {
        lockstep->refused = 0;
        const fcsl_hal_status_t sampled = hal->sample(hal->ctx, fcsl_run_tick(lockstep->run), &to);
        if (sampled == FCSL_HAL_OK) {
            status = make_tick(lockstep, error);
        } else if (sampled != FCSL_HAL_WAITING) {
            status = end_of(lockstep, sampled, error);
        }
    }
    fcsl_publish_queue_wake(lockstep->queue);
    return status;
}
