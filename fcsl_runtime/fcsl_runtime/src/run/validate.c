/* SPDX-License-Identifier: Apache-2.0
 *
 * Checks the descriptor of a machine before a host trusts it.
 */
#define _GNU_SOURCE
#include "validate.h"

#include <math.h>
#include <string.h>

#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_ros.h"
#include "fcsl/fcsl_scalar.h"
#include "range.h"

enum { RANK_MAX = 8, NAME_MAX_BYTES = 255, FILE_MAX_BYTES = 1023 };
/* Generous against any vehicle, small enough that a damaged descriptor cannot make a host allocate without bound. */
static const uint32_t STRUCT_BYTES_MAX = 256u << 20;
static const uint32_t ENTRIES_MAX = 1u << 20;
static const uint64_t TICK_HZ_MAX = 1000000000u;

static int is_name(const char *text)
{
    return text != NULL && text[0] != '\0' && strlen(text) <= NAME_MAX_BYTES;
}

static int in_struct(const fcsl_machine_t *machine, uint32_t offset, uint32_t size, uint32_t alignment)
{
    return offset <= machine->size && size <= machine->size - offset && offset % alignment == 0;
}

static int in_range(int32_t index, uint32_t count)
{
    return index >= 0 && (uint32_t)index < count;
}

/* No range, or one that values of the type can be compared with. A forgotten one is 0 to 0, which is none for an output. */
static int is_bounded(const fcsl_field_t *field)
{
    if (field->minimum == -INFINITY && field->maximum == INFINITY) {
        return 1;
    }
    const int number = field->type >= FCSL_I32 && field->type <= FCSL_F64;
    return field->role == FCSL_ROLE_PARAMETER && number && field->minimum <= field->maximum &&
           fcsl_bound_fits(field->minimum, field->type) && fcsl_bound_fits(field->maximum, field->type);
}

static int check_field(const fcsl_machine_t *machine, const fcsl_field_t *field)
{
    const uint32_t scalar = fcsl_scalar_size(field->type);
    if (!is_name(field->path) || field->unit == NULL || field->doc == NULL || scalar == 0 ||
        field->role > FCSL_ROLE_CHANNEL || field->rank > RANK_MAX || (field->rank > 0 && field->shape == NULL)) {
        return -1;
    }
    uint64_t count = 1;
    for (uint32_t i = 0; i < field->rank; i++) {
        count *= field->shape[i];
        if (count == 0 || count > machine->size) {
            return -1;
        }
    }
    const int placed = count == field->count && (uint64_t)field->size == count * scalar &&
                       in_struct(machine, field->offset, field->size, scalar);
    const int linked = (field->instance == FCSL_NONE || in_range(field->instance, machine->instance_count)) &&
                       (field->connected_from == FCSL_NONE || field->connected_from == FCSL_FROM_MACHINE ||
                        in_range(field->connected_from, machine->field_count));
    return placed && linked && is_bounded(field) ? 0 : -1;
}

static int check_instance(const fcsl_machine_t *machine, const fcsl_instance_t *instance)
{
    const int named = is_name(instance->name) && instance->algorithm != NULL && instance->source_file != NULL &&
                      is_name(instance->message_type) && instance->message_text != NULL;
    const int placed =
        instance->first_field <= machine->field_count &&
        instance->field_count <= machine->field_count - instance->first_field &&
        in_struct(machine, instance->request_offset, 4, 4) && in_struct(machine, instance->health_offset, 4, 4) &&
        in_struct(machine, instance->faults_offset, 8, 8) && in_struct(machine, instance->overruns_offset, 8, 8) &&
        in_struct(machine, instance->fault_place_offset, 4, 4);
    const int timed = instance->max_wcet_us == 0 || in_struct(machine, instance->inject_overrun_offset, 1, 1);
    const int injectable =
        instance->inject_fault_offset == FCSL_NO_OFFSET || in_struct(machine, instance->inject_fault_offset, 1, 1);
    return named && placed && timed && injectable && instance->published <= 1u ? 0 : -1;
}

static int check_state(const fcsl_machine_t *machine, const fcsl_state_t *state)
{
    if (!is_name(state->name) || (state->schedule_count > 0 && state->schedule == NULL) ||
        state->schedule_count > ENTRIES_MAX) {
        return -1;
    }
    for (uint32_t i = 0; i < state->schedule_count; i++) {
        const fcsl_schedule_t *entry = &state->schedule[i];
        if (entry->instance >= machine->instance_count || entry->divisor == 0 || entry->phase >= entry->divisor) {
            return -1;
        }
    }
    return 0;
}

static int check_transition(const fcsl_machine_t *machine, const fcsl_transition_t *edge)
{
    return in_range(edge->from, machine->state_count) && in_range(edge->to, machine->state_count) &&
                   (edge->request == FCSL_NONE || in_range(edge->request, machine->request_count)) &&
                   (edge->guard_instance == FCSL_NONE || in_range(edge->guard_instance, machine->instance_count))
               ? 0
               : -1;
}

/* True when the field can be what the channel says. */
static int is_kind(const fcsl_channel_t *channel, const fcsl_field_t *field)
{
    switch (channel->as) {
    case FCSL_AS_FIELD:
        return 1;
    case FCSL_AS_QUATERNION:
        return (field->type == FCSL_F32 || field->type == FCSL_F64) && field->count == 4;
    case FCSL_AS_BLOB:
        return field->type == FCSL_U32 && field->count > 1;
    default:
        return 0;
    }
}

static int check_channel(const fcsl_machine_t *machine, uint32_t index)
{
    const fcsl_channel_t *channel = &machine->channels[index];
    if (!is_name(channel->name) || channel->direction > FCSL_REPORT || channel->field >= machine->field_count ||
        machine->fields[channel->field].size > UINT16_MAX || channel->id >= FCSL_RESERVED_ID_FIRST ||
        !is_kind(channel, &machine->fields[channel->field])) {
        return -1;
    }
    for (uint32_t i = 0; i < index; i++) {
        if (machine->channels[i].id == channel->id) {
            return -1;
        }
    }
    if (channel->ros_type == NULL || channel->ros_field == NULL || channel->ros_topic == NULL ||
        channel->ros_frame == NULL || channel->ros_child_frame == NULL || channel->ros_axes == NULL) {
        return -1;
    }
    if (channel->direction == FCSL_REPORT) {
        return channel->safe == NULL ? 0 : -1;
    }
    if (channel->direction == FCSL_ACTUATOR) {
        const int gated = machine->arm_field != FCSL_NONE || machine->command_timeout_ns > 0;
        return gated && channel->safe == NULL ? -1 : 0;
    }
    return in_struct(machine, channel->attached_offset, 1, 1) && in_struct(machine, channel->fresh_offset, 1, 1) &&
                   in_struct(machine, channel->valid_offset, 1, 1) &&
                   in_struct(machine, channel->waiting_offset, 1, 1) && in_struct(machine, channel->age_offset, 4, 4) &&
                   in_struct(machine, channel->sample_age_offset, 4, 4) &&
                   in_struct(machine, channel->stamp_offset, 8, 8)
               ? 0
               : -1;
}

/* Whether a composer, whose memory is the struct, reads in it alone. */
static int reads_in_struct(const fcsl_machine_t *machine, const fcsl_ros_composer_plan_t *conversion)
{
    for (uint32_t i = 0; i < conversion->row_count; i++) {
        const fcsl_ros_row_t *row = &conversion->rows[i];
        if (row->term_count > conversion->term_count || row->first_term > conversion->term_count - row->term_count ||
            row->more > machine->size) {
            return 0;
        }
        for (uint32_t j = 0; j < row->term_count; j++) {
            const fcsl_ros_term_t *term = &conversion->terms[row->first_term + j];
            if (!in_struct(machine, term->offset, (row->more + 1u) * fcsl_ros_scalar_size(term->type), 1)) {
                return 0;
            }
        }
    }
    for (uint32_t i = 0; i < conversion->choice_count; i++) {
        if (!in_struct(machine, conversion->choices[i].index.offset, sizeof(uint32_t), 1)) {
            return 0;
        }
    }
    return 1;
}

/* A message's channels are of one direction, and its numbers lie in the struct. Readers and composers check the rest of a conversion. */
static int check_ros_message(const fcsl_machine_t *machine, const fcsl_ros_message_t *message, uint32_t value_count)
{
    if (message->topic == NULL || !is_name(message->type) || !is_name(message->type_hash) ||
        message->channels == NULL || message->channel_count == 0 || message->channel_count > machine->channel_count ||
        message->composer == NULL || message->composer->memory_count != 1 ||
        !reads_in_struct(machine, message->composer) || message->reader == NULL ||
        message->reader->value_count != value_count) {
        return -1;
    }
    for (uint32_t i = 0; i < message->channel_count; i++) {
        if (message->channels[i] >= machine->channel_count ||
            machine->channels[message->channels[i]].direction != message->direction) {
            return -1;
        }
    }
    return 0;
}

/* Whether a payload is of another size than its channel's field; without a value it is a blob, whose size stands before its bytes. */
static int holds_another(const fcsl_machine_t *machine, const fcsl_ros_message_t *message, uint32_t values)
{
    const fcsl_field_t *field = &machine->fields[machine->channels[message->channels[0]].field];
    if (values == 0u) {
        return message->composer->size < 2u * sizeof(uint32_t);
    }
    return message->reader->values == NULL || message->reader->values[0].offset != 0u ||
           message->reader->values[0].size != field->size;
}

static int check_ros_messages(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const char *name = machine->name;
    for (uint32_t i = 0; i < machine->ros_message_count; i++) {
        const fcsl_ros_message_t *message = &machine->ros_messages[i];
        if (!is_name(message->topic) || check_ros_message(machine, message, message->channel_count) != 0) {
            return fcsl_fail(error, "machine '%s': ROS 2 message %u of its descriptor is inconsistent", name, i);
        }
    }
    for (uint32_t i = 0; machine->payloads != NULL && i < machine->channel_count; i++) {
        const fcsl_ros_message_t *message = &machine->payloads[i];
        const uint32_t values = machine->channels[i].as == FCSL_AS_BLOB ? 0u : 1u;
        if (check_ros_message(machine, message, values) != 0 || message->channel_count != 1u ||
            message->channels[0] != i || holds_another(machine, message, values)) {
            return fcsl_fail(error, "machine '%s': the payload of channel %u of its descriptor is inconsistent", name,
                             i);
        }
    }
    return 0;
}

/* A service's channel is a bool that the world writes. */
static int check_service(const fcsl_machine_t *machine, const fcsl_service_t *service)
{
    if (!is_name(service->name) || service->kind > FCSL_SET_BOOL || service->channel >= machine->channel_count ||
        !is_name(service->accepted) || service->refused == NULL || service->within_ticks == 0) {
        return -1;
    }
    const fcsl_channel_t *channel = &machine->channels[service->channel];
    const fcsl_field_t *field = &machine->fields[channel->field];
    return channel->direction == FCSL_SENSOR && field->type == FCSL_BOOL && field->count == 1u ? 0 : -1;
}

/* No field, or a bool output. */
static int is_arm_field(const fcsl_machine_t *machine)
{
    if (machine->arm_field == FCSL_NONE) {
        return 1;
    }
    if (!in_range(machine->arm_field, machine->field_count)) {
        return 0;
    }
    const fcsl_field_t *field = &machine->fields[machine->arm_field];
    return field->role == FCSL_ROLE_OUTPUT && field->type == FCSL_BOOL && field->count == 1;
}

static int check_fault_place(const fcsl_fault_place_t *place)
{
    return is_name(place->cause) && place->file != NULL && strlen(place->file) <= FILE_MAX_BYTES ? 0 : -1;
}

/* Sites are in the order of their instances. */
static int check_event_site(const fcsl_machine_t *machine, uint32_t index)
{
    const fcsl_event_site_t *site = &machine->event_sites[index];
    if (site->instance >= machine->instance_count || site->file == NULL || strlen(site->file) > FILE_MAX_BYTES ||
        !is_name(site->text) || site->severity > FCSL_ERROR || site->value_count > FCSL_EVENT_VALUES ||
        (index > 0 && machine->event_sites[index - 1u].instance > site->instance)) {
        return -1;
    }
    for (uint32_t i = 0; i < site->value_count; i++) {
        if (site->types[i] > FCSL_F64 && site->types[i] != FCSL_HEALTH) {
            return -1;
        }
    }
    return 0;
}

static int check_tables(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const char *name = machine->name;
    for (uint32_t i = 0; i < machine->field_count; i++) {
        if (check_field(machine, &machine->fields[i]) != 0) {
            return fcsl_fail(error, "machine '%s': field %u of its descriptor is inconsistent", name, i);
        }
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        if (check_instance(machine, &machine->instances[i]) != 0) {
            return fcsl_fail(error, "machine '%s': instance %u of its descriptor is inconsistent", name, i);
        }
    }
    for (uint32_t i = 0; i < machine->state_count; i++) {
        if (check_state(machine, &machine->states[i]) != 0) {
            return fcsl_fail(error, "machine '%s': state %u of its descriptor is inconsistent", name, i);
        }
    }
    for (uint32_t i = 0; i < machine->request_count; i++) {
        if (!is_name(machine->requests[i])) {
            return fcsl_fail(error, "machine '%s': request %u of its descriptor has no name", name, i);
        }
    }
    for (uint32_t i = 0; i < machine->transition_count; i++) {
        if (check_transition(machine, &machine->transitions[i]) != 0) {
            return fcsl_fail(error, "machine '%s': transition %u of its descriptor is inconsistent", name, i);
        }
    }
    if (!is_arm_field(machine)) {
        return fcsl_fail(error, "machine '%s': the arm field of its descriptor is no bool output", name);
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        if (check_channel(machine, i) != 0) {
            return fcsl_fail(error, "machine '%s': channel %u of its descriptor is inconsistent", name, i);
        }
    }
    if (check_ros_messages(machine, error) != 0) {
        return -1;
    }
    for (uint32_t i = 0; i < machine->service_count; i++) {
        if (check_service(machine, &machine->services[i]) != 0) {
            return fcsl_fail(error, "machine '%s': service %u of its descriptor is inconsistent", name, i);
        }
    }
    for (uint32_t i = 0; i < machine->fault_place_count; i++) {
        if (check_fault_place(&machine->fault_places[i]) != 0) {
            return fcsl_fail(error, "machine '%s': fault place %u of its descriptor is inconsistent", name, i);
        }
    }
    for (uint32_t i = 0; i < machine->event_site_count; i++) {
        if (check_event_site(machine, i) != 0) {
            return fcsl_fail(error, "machine '%s': event %u of its descriptor is inconsistent", name, i);
        }
    }
    return 0;
}

int fcsl_validate(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    if (machine->abi_version != FCSL_ABI_VERSION) {
        return fcsl_fail(error, "the machine was built for ABI version %u, this host has version %u: build it again",
                         machine->abi_version, FCSL_ABI_VERSION);
    }
    if (!is_name(machine->name) || !is_name(machine->source_hash) || !is_name(machine->layout_hash) ||
        !is_name(machine->build_hash)) {
        return fcsl_fail(error, "the machine's descriptor lacks its name or a hash");
    }
    if (machine->views == NULL || strnlen(machine->views, FCSL_VIEWS_BYTES_MAX + 1u) > FCSL_VIEWS_BYTES_MAX) {
        return fcsl_fail(error, "machine '%s': its views are missing or have more than %u bytes", machine->name,
                         (unsigned)FCSL_VIEWS_BYTES_MAX);
    }
    const char *name = machine->name;
    if (machine->tick_hz == 0 || machine->tick_hz > TICK_HZ_MAX) {
        return fcsl_fail(error, "machine '%s': tick_hz must be 1 to 1000000000", name);
    }
    if (machine->size == 0 || machine->size > STRUCT_BYTES_MAX || machine->align == 0 || machine->align > 4096 ||
        (machine->align & (machine->align - 1u)) != 0) {
        return fcsl_fail(error, "machine '%s': its struct has an impossible size or alignment", name);
    }
    const int tables = machine->field_count <= ENTRIES_MAX && machine->instance_count <= ENTRIES_MAX &&
                       machine->state_count <= ENTRIES_MAX && machine->request_count <= ENTRIES_MAX &&
                       machine->transition_count <= ENTRIES_MAX && machine->channel_count <= UINT16_MAX &&
                       machine->fault_place_count <= ENTRIES_MAX &&
                       (machine->fault_place_count == 0 || machine->fault_places != NULL) &&
                       machine->event_site_count <= ENTRIES_MAX &&
                       (machine->event_site_count == 0 || machine->event_sites != NULL) &&
                       (machine->field_count == 0 || machine->fields != NULL) &&
                       (machine->instance_count == 0 || machine->instances != NULL) &&
                       (machine->request_count == 0 || machine->requests != NULL) &&
                       (machine->transition_count == 0 || machine->transitions != NULL) &&
                       (machine->channel_count == 0 || machine->channels != NULL) &&
                       machine->ros_message_count <= machine->channel_count &&
                       (machine->ros_message_count == 0 || machine->ros_messages != NULL) &&
                       machine->service_count <= machine->channel_count &&
                       (machine->service_count == 0 || machine->services != NULL) && machine->state_count > 0 &&
                       machine->states != NULL;
    const int code =
        machine->init != NULL && machine->start != NULL && machine->step != NULL && machine->force_state != NULL;
    const int places =
        in_struct(machine, machine->current_offset, 4, 4) && in_struct(machine, machine->tick_offset, 8, 8) &&
        in_struct(machine, machine->state_offset, 4, 4) && in_struct(machine, machine->next_state_offset, 4, 4);
    const int timed = machine->after_ticks == NULL || in_struct(machine, machine->ticks_in_state_offset, 8, 8);
    if (!tables || !code || !places || !timed) {
        return fcsl_fail(error, "machine '%s': its descriptor is incomplete", name);
    }
    return check_tables(machine, error);
}
