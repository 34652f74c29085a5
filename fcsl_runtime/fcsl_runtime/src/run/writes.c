/* SPDX-License-Identifier: Apache-2.0
 *
 * What a host writes between two ticks: fields, states, injected verdicts, samples. All of it ends up in the record at the
 * tick that is the first to see it.
 */
#include "writes.h"

#include <inttypes.h>
#include <stdio.h>

#include "fcsl/fcsl_scalar.h"
#include "machine/scalar_text.h"
#include "range.h"
#include "record/write_queue.h"
#include "record/recorder.h"

enum { RANGE_BYTES = 64 };

void fcsl_note_write_at(fcsl_run_t *run, uint64_t tick, const fcsl_write_t *write)
{
    if (run->recorder != NULL) {
        fcsl_recorder_write(run->recorder, fcsl_run_stamp(run, tick), write);
    }
    if (fcsl_write_queue_is_enabled(run->write_queue)) {
        fcsl_write_queue_put(run->write_queue, tick, write);
    }
}

void fcsl_note_write(fcsl_run_t *run, const fcsl_write_t *write)
{
    fcsl_note_write_at(run, fcsl_run_tick(run), write);
}

/* `[-1, 1]`, `[0, inf]`: the fewest digits that tell the bounds from other values of the type. */
static const char *range_text(const fcsl_field_t *field, char text[RANGE_BYTES])
{
    const double bounds[2] = {field->minimum, field->maximum};
    char shown[2][SCALAR_TEXT_BYTES];
    for (int i = 0; i < 2; i++) {
        if (field->type != FCSL_F32 && field->type != FCSL_F64) {
            (void)snprintf(shown[i], sizeof shown[i], "%.0f", bounds[i]);
            continue;
        }
        fcsl_float_text(bounds[i], field->type, shown[i]);
    }
    (void)snprintf(text, RANGE_BYTES, "[%.28s, %.28s]", shown[0], shown[1]);
    return text;
}

int fcsl_check_value(const fcsl_machine_t *machine, const fcsl_field_t *field, const void *bytes, uint32_t size,
                     fcsl_error_t *error)
{
    const uint32_t scalar = fcsl_scalar_size(field->type);
    for (uint32_t at = 0; at < size; at += scalar) {
        uint8_t exported[8] = {0};
        fcsl_scalars_export(exported, (const uint8_t *)bytes + at, field->type, 1);
        if (!fcsl_scalars_valid(machine, exported, field->type, 1)) {
            return fcsl_fail(error, "cannot hold this value: %s",
                             field->type == FCSL_BOOL ? "a bool is 0 or 1" : "no such enumerator");
        }
        if (!fcsl_scalars_within(exported, field, 1)) {
            char text[RANGE_BYTES];
            return fcsl_fail(error, "lies in %s", range_text(field, text));
        }
    }
    return 0;
}

int fcsl_run_check_set(const fcsl_run_t *run, uint32_t field, uint32_t element, const void *bytes, uint32_t size,
                       fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (field >= machine->field_count) {
        return fcsl_fail(error, "no field number %" PRIu32, field);
    }
    const fcsl_field_t *target = &machine->fields[field];
    if ((target->flags & FCSL_FIELD_FROZEN) != 0) {
        return fcsl_fail(error, "'%s' is frozen: the compiler folded its value into the code", target->path);
    }
    if ((target->flags & FCSL_FIELD_WRITABLE) == 0) {
        return fcsl_fail(error, "'%s' cannot be set: the machine itself computes it", target->path);
    }
    const uint32_t scalar = fcsl_scalar_size(target->type);
    if (size == 0 || size % scalar != 0 || element >= target->count || size / scalar > target->count - element) {
        return fcsl_fail(error,
                         "'%s' has %" PRIu32 " scalars of %" PRIu32 " bytes: %" PRIu32 " bytes from scalar %" PRIu32
                         " on do not fit",
                         target->path, target->count, scalar, size, element);
    }
    fcsl_error_t problem;
    if (fcsl_check_value(machine, target, bytes, size, &problem) != 0) {
        return fcsl_fail(error, "'%s' %.400s", target->path, problem.text);
    }
    return 0;
}

void fcsl_run_set_checked(fcsl_run_t *run, uint32_t field, uint32_t element, const void *bytes, uint32_t size)
{
    const fcsl_field_t *target = &run->machine->fields[field];
    const uint32_t scalar = fcsl_scalar_size(target->type);
    /* Out and in again, so that what is recorded and what is stored are the same bits. */
    fcsl_scalars_export(run->staging, bytes, target->type, size / scalar);
    fcsl_scalars_import(run->data + target->offset + (size_t)element * scalar, run->staging, target->type,
                        size / scalar);
    fcsl_note_write(
        run, &(fcsl_write_t){
                 .kind = FCSL_WRITE_SET, .path = target->path, .element = element, .data = run->staging, .size = size});
}

int fcsl_run_set(fcsl_run_t *run, uint32_t field, uint32_t element, const void *bytes, uint32_t size,
                 fcsl_error_t *error)
{
    if (fcsl_run_check_set(run, field, element, bytes, size, error) != 0) {
        return -1;
    }
    fcsl_run_set_checked(run, field, element, bytes, size);
    return 0;
}

int fcsl_run_set_state(fcsl_run_t *run, int32_t state, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (state < 0 || (uint32_t)state >= machine->state_count) {
        return fcsl_fail(error, "no state number %" PRId32, state);
    }
    const int32_t before = fcsl_read_i32(run->data, machine->next_state_offset);
    machine->force_state(run->data, state);
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_SET_STATE, .path = machine->states[state].name});
    if (run->recorder != NULL && before != state && before >= 0 && (uint32_t)before < machine->state_count) {
        fcsl_recorder_forced(run->recorder, fcsl_run_stamp(run, fcsl_run_tick(run)), &machine->states[before],
                             &machine->states[state]);
    }
    return 0;
}

int fcsl_run_inject_overrun(fcsl_run_t *run, uint32_t instance, fcsl_error_t *error)
{
    if (instance >= run->machine->instance_count) {
        return fcsl_fail(error, "no instance number %" PRIu32, instance);
    }
    const fcsl_instance_t *target = &run->machine->instances[instance];
    if (target->max_wcet_us == 0) {
        return fcsl_fail(error, "instance '%s' has no max_wcet_us, so it cannot overrun", target->name);
    }
    run->data[target->inject_overrun_offset] = 1u;
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_OVERRUN, .path = target->name});
    return 0;
}

/* The instance whose next execute a host may make something of; null with `error` filled. */
static const fcsl_instance_t *injectable(const fcsl_run_t *run, uint32_t instance, fcsl_error_t *error)
{
    if (instance >= run->machine->instance_count) {
        (void)fcsl_fail(error, "no instance number %" PRIu32, instance);
        return NULL;
    }
    const fcsl_instance_t *target = &run->machine->instances[instance];
    if (target->inject_fault_offset == FCSL_NO_OFFSET) {
        (void)fcsl_fail(error, "instance '%s' was built without injected faults", target->name);
        return NULL;
    }
    return target;
}

/* Adds to what is injected into the next execute: the worst counts, and a fault (1) is worse than a health (2, 3). */
static void inject(fcsl_run_t *run, const fcsl_instance_t *target, uint8_t what)
{
    uint8_t *injected = &run->data[target->inject_fault_offset];
    if (*injected != 1u && (what == 1u || what > *injected)) {
        *injected = what;
    }
}

int fcsl_run_inject_fault(fcsl_run_t *run, uint32_t instance, fcsl_error_t *error)
{
    const fcsl_instance_t *target = injectable(run, instance, error);
    if (target == NULL) {
        return -1;
    }
    inject(run, target, 1u);
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_FAULT, .path = target->name});
    return 0;
}

int fcsl_run_inject_health(fcsl_run_t *run, uint32_t instance, fcsl_health_t health, fcsl_error_t *error)
{
    const fcsl_instance_t *target = injectable(run, instance, error);
    if (target == NULL) {
        return -1;
    }
    if (health != FCSL_DEGRADED && health != FCSL_FAILED) {
        return fcsl_fail(error, "instance '%s' can be made degraded or failed, no other health", target->name);
    }
    inject(run, target, (uint8_t)(1u + (unsigned)health));
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_HEALTH, .path = target->name, .element = health});
    return 0;
}

int fcsl_run_attach_channel(fcsl_run_t *run, uint32_t channel, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (channel >= machine->channel_count || machine->channels[channel].direction != FCSL_SENSOR) {
        return fcsl_fail(error, "no sensor channel number %" PRIu32, channel);
    }
    run->data[machine->channels[channel].attached_offset] = 1u;
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_ATTACH, .path = machine->channels[channel].name});
    return 0;
}

int fcsl_run_attach(fcsl_run_t *run, fcsl_error_t *error)
{
    (void)error;
    for (uint32_t i = 0; i < run->machine->channel_count; i++) {
        if (run->machine->channels[i].direction == FCSL_SENSOR) {
            run->data[run->machine->channels[i].attached_offset] = 1u;
        }
    }
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_ATTACH, .path = ""});
    return 0;
}

/* Notes each channel that a sensor message brought, as its field holds it now. */
static void note_channels(fcsl_run_t *run, const fcsl_message_t *message)
{
    fcsl_message_entry_t entry = {0};
    while (fcsl_message_next(run->machine, message, &entry) != 0) {
        const fcsl_channel_t *channel = &run->machine->channels[entry.channel];
        const fcsl_field_t *field = &run->machine->fields[channel->field];
        fcsl_scalars_export(run->staging, run->data + field->offset, field->type, field->count);
        fcsl_note_write(
            run, &(fcsl_write_t){
                     .kind = FCSL_WRITE_CHANNEL, .path = channel->name, .data = run->staging, .size = field->size});
    }
}

int fcsl_run_sense_message(fcsl_run_t *run, const fcsl_message_t *message, fcsl_error_t *error)
{
    const uint64_t due = fcsl_run_tick(run);
    if (message->tick != due) {
        run->messages_refused++;
        return fcsl_fail(error, "sensor message refused: it is of tick %" PRIu64 ", tick %" PRIu64 " is due",
                         message->tick, due);
    }
    fcsl_message_apply(run->machine, run->data, message);
    if (fcsl_writes_noted(run)) {
        note_channels(run, message);
    }
    return 0;
}

int fcsl_run_sense(fcsl_run_t *run, const uint8_t *bytes, size_t size, fcsl_error_t *error)
{
    fcsl_message_t message;
    const fcsl_message_status_t status = fcsl_message_check(&run->channels, FCSL_SENSOR_MESSAGE, bytes, size, &message);
    if (status != FCSL_MESSAGE_OK) {
        run->messages_refused++;
        return fcsl_fail(error, "sensor message refused: %s", fcsl_message_status_text(status));
    }
    return fcsl_run_sense_message(run, &message, error);
}

uint64_t fcsl_run_messages_refused(const fcsl_run_t *run)
{
    return run->messages_refused;
}

int fcsl_run_write_channel(fcsl_run_t *run, uint32_t channel, const void *bytes, uint32_t size, uint32_t age_ticks,
                           int64_t stamp_ns, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (channel >= machine->channel_count || machine->channels[channel].direction != FCSL_SENSOR) {
        return fcsl_fail(error, "no sensor channel number %" PRIu32, channel);
    }
    const fcsl_channel_t *target = &machine->channels[channel];
    const fcsl_field_t *field = &machine->fields[target->field];
    if (size != field->size) {
        return fcsl_fail(error, "a sample of channel '%s' has %" PRIu32 " bytes, not %" PRIu32, target->name,
                         field->size, size);
    }
    if (!fcsl_scalars_valid(machine, bytes, field->type, field->count)) {
        return fcsl_fail(error, "channel '%s' cannot hold this value", target->name);
    }
    fcsl_scalars_import(run->data + field->offset, bytes, field->type, field->count);
    memcpy(run->data + target->sample_age_offset, &age_ticks, sizeof age_ticks);
    memcpy(run->data + target->stamp_offset, &stamp_ns, sizeof stamp_ns);
    run->data[target->fresh_offset] = 1u;
    if (!fcsl_writes_noted(run)) {
        return 0;
    }
    /* Out again, so that the record has canonical NaNs whatever the caller had. */
    fcsl_scalars_export(run->staging, run->data + field->offset, field->type, field->count);
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_CHANNEL,
                                         .path = target->name,
                                         .data = run->staging,
                                         .size = size,
                                         .age_ticks = age_ticks,
                                         .stamp_ns = stamp_ns});
    return 0;
}
