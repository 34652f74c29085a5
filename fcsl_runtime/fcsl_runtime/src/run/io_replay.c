/* SPDX-License-Identifier: Apache-2.0
 *
 * Notes what instances with I/O left in a tick, and puts it in place in a replay.
 */
#include "io_replay.h"

#include <inttypes.h>
#include <stdlib.h>

#include "events.h"
#include "fcsl/fcsl_fp_mode.h"
#include "fcsl/fcsl_scalar.h"
#include "writes.h"

/* Whether an execute may change this field: outputs, state, the count of faults and the place of the last one. */
static int is_left(const fcsl_instance_t *instance, const fcsl_field_t *field)
{
    return field->role == FCSL_ROLE_OUTPUT || field->role == FCSL_ROLE_STATE ||
           (field->role == FCSL_ROLE_COUNTER &&
            (field->offset == instance->faults_offset || field->offset == instance->fault_place_offset));
}

static int is_impure(const fcsl_machine_t *machine, const fcsl_instance_t *instance)
{
    for (uint32_t i = 0; i < instance->field_count; i++) {
        if ((machine->fields[instance->first_field + i].flags & FCSL_FIELD_IMPURE) != 0) {
            return 1;
        }
    }
    return 0;
}

int fcsl_io_replay_open(fcsl_run_t *run, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    uint32_t size = 0;
    run->impure = calloc(machine->instance_count + 1u, sizeof *run->impure);
    if (run->impure == NULL) {
        return fcsl_fail(error, "out of memory for machine '%s'", machine->name);
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_instance_t *instance = &machine->instances[i];
        run->impure[i].offset = size;
        for (uint32_t j = 0; is_impure(machine, instance) && j < instance->field_count; j++) {
            const fcsl_field_t *field = &machine->fields[instance->first_field + j];
            run->impure[i].size += is_left(instance, field) ? field->size : 0;
        }
        size += run->impure[i].size;
        run->impure_count += run->impure[i].size != 0;
    }
    run->left = calloc(size + 1u, 1);
    return run->left != NULL ? 0 : fcsl_fail(error, "out of memory for machine '%s'", machine->name);
}

void fcsl_io_replay_free(fcsl_run_t *run)
{
    free(run->impure);
    free(run->left);
}

/* Copies what an instance leaves between its fields and their little-endian form. */
static void move(fcsl_run_t *run, uint32_t index, uint8_t *bytes, int out)
{
    const fcsl_machine_t *machine = run->machine;
    const fcsl_instance_t *instance = &machine->instances[index];
    for (uint32_t i = 0; i < instance->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[instance->first_field + i];
        if (!is_left(instance, field)) {
            continue;
        }
        if (out) {
            fcsl_scalars_export(bytes, run->data + field->offset, field->type, field->count);
        } else {
            fcsl_scalars_import(run->data + field->offset, bytes, field->type, field->count);
        }
        bytes += field->size;
    }
}

int fcsl_run_substitute(fcsl_run_t *run, uint32_t instance, const void *bytes, uint32_t size, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (instance >= machine->instance_count || run->impure[instance].size == 0) {
        return fcsl_fail(error, "instance number %" PRIu32 " neither reads hardware nor calls externs", instance);
    }
    const fcsl_instance_t *target = &machine->instances[instance];
    if (size != run->impure[instance].size) {
        return fcsl_fail(error, "what instance '%s' leaves has %" PRIu32 " bytes, not %" PRIu32, target->name,
                         run->impure[instance].size, size);
    }
    const uint8_t *at = bytes;
    for (uint32_t i = 0; i < target->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[target->first_field + i];
        if (is_left(target, field)) {
            if (!fcsl_scalars_valid(machine, at, field->type, field->count)) {
                return fcsl_fail(error, "'%s' cannot hold this value", field->path);
            }
            at += field->size;
        }
    }
    memcpy(run->left + run->impure[instance].offset, bytes, size);
    run->impure[instance].substituted = 1;
    return 0;
}

/* C code that an instance calls may leave another floating-point mode. What follows has the right one. */
void fcsl_io_replay_executed(void *ctx, uint32_t instance)
{
    fcsl_run_t *run = ctx;
    if (fcsl_fp_enter() != FCSL_FP_DEFAULT && instance < run->machine->instance_count) {
        run->mode_changes++;
        run->mode_changed_by = run->machine->instances[instance].name;
    }
}

uint64_t fcsl_run_mode_changes(const fcsl_run_t *run, const char **by)
{
    *by = run->mode_changed_by;
    return run->mode_changes;
}

int32_t fcsl_io_replay_apply(void *ctx, uint32_t instance)
{
    fcsl_run_t *run = ctx;
    if (instance >= run->machine->instance_count || run->impure[instance].substituted == 0) {
        run->impure_executes++;
        return 0;
    }
    run->impure[instance].substituted = 0;
    move(run, instance, run->left + run->impure[instance].offset, 0);
    if (run->events != NULL) {
        fcsl_events_substitute(run, instance);
    }
    return 1;
}

uint64_t fcsl_run_impure_executes(const fcsl_run_t *run)
{
    return run->impure_executes;
}

void fcsl_io_replay_settle(fcsl_run_t *run)
{
    for (uint32_t i = 0; i < run->machine->instance_count; i++) {
        run->impure[i].substituted = 0;
    }
    if (run->events != NULL) {
        fcsl_events_settle(run);
    }
}

/* What the execute of an instance has told, if anything. */
static void note_events(fcsl_run_t *run, uint32_t instance, uint64_t tick)
{
    uint8_t bytes[FCSL_EVENTS_LEFT_MAX];
    const uint32_t size = fcsl_events_left(run, instance, bytes);
    if (size > 0) {
        fcsl_note_write_at(run, tick,
                           &(fcsl_write_t){.kind = FCSL_WRITE_EVENTS,
                                           .path = run->machine->instances[instance].name,
                                           .data = bytes,
                                           .size = size});
    }
}

void fcsl_io_replay_note(fcsl_run_t *run, uint64_t tick)
{
    const fcsl_machine_t *machine = run->machine;
    const int32_t number = fcsl_read_i32(run->data, machine->state_offset);
    const fcsl_state_t *state = &machine->states[number];
    for (uint32_t i = 0; i < state->schedule_count; i++) {
        const fcsl_schedule_t *entry = &state->schedule[i];
        const fcsl_substitute_t *impure = &run->impure[entry->instance];
        if (impure->size != 0 && tick % entry->divisor == entry->phase) {
            uint8_t *bytes = run->left + impure->offset;
            move(run, entry->instance, bytes, 1);
            fcsl_note_write_at(run, tick,
                               &(fcsl_write_t){.kind = FCSL_WRITE_IMPURE,
                                               .path = machine->instances[entry->instance].name,
                                               .data = bytes,
                                               .size = impure->size});
            if (run->events != NULL) {
                note_events(run, entry->instance, tick);
            }
        }
    }
}
