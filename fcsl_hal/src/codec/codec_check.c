/* SPDX-License-Identifier: Apache-2.0
 *
 * Checks messages of channels, and takes their values.
 *
 * `//@ split` is for scripts/verify/codec: from there on it analyses each channel by itself.
 */
#include "codec_layout.h"

/* An entry as it stands in a message, of a known type. */
typedef struct {
    uint16_t id;
    uint8_t type;
    size_t values; /* offset in the message */
    size_t end;    /* offset behind them */
} raw_entry_t;

/* Reads the entry at `at`, which must end at `end` or before. */
static fcsl_message_status_t read_entry(const uint8_t *bytes, size_t at, size_t end, raw_entry_t *entry)
{
    if (end - at < ENTRY_BYTES) {
        return FCSL_MESSAGE_SHORT;
    }
    entry->id = fcsl_get_u16(bytes + at);
    entry->type = bytes[at + 2];
    at += ENTRY_BYTES;
    const unsigned shape = entry->type >> 4;
    const uint8_t scalar = entry->type & 15u;
    if (shape > BLOB || scalar > FCSL_F64 || (shape == BLOB && scalar != 0u)) {
        return FCSL_MESSAGE_TYPE;
    }
    size_t count = 0;
    if (is_array(entry->type)) {
        if (end - at < COUNT_BYTES) {
            return FCSL_MESSAGE_SHORT;
        }
        count = fcsl_get_u16(bytes + at);
        at += COUNT_BYTES;
    } else {
        count = shape == SCALAR ? 1u : shape == VECTOR ? 3u : 4u;
    }
    const size_t behind =
        at + count * fcsl_scalar_size(scalar); /* half a MiB more than a message has: it does not wrap */
    if (behind > end) {
        return FCSL_MESSAGE_SHORT;
    }
    entry->values = at;
    entry->end = behind;
    return FCSL_MESSAGE_OK;
}

/* The index of the channel with this id, looked for from `first` on and then from the beginning; channel_count if none. */
static uint32_t find_channel(const fcsl_machine_t *machine, uint16_t id, uint32_t first)
{
    for (uint32_t i = first; i < machine->channel_count; i++) {
        if (machine->channels[i].id == id) {
            return i;
        }
    }
    for (uint32_t i = 0; i < first && i < machine->channel_count; i++) {
        if (machine->channels[i].id == id) {
            return i;
        }
    }
    return machine->channel_count;
}

/* True when an entry with this id stands in [at, end), which was checked. */
static int stands_before(const uint8_t *bytes, size_t at, size_t end, uint16_t id)
{
    raw_entry_t entry = {0};
    while (at < end && read_entry(bytes, at, end, &entry) == FCSL_MESSAGE_OK) {
        if (entry.id == id) {
            return 1;
        }
        at = entry.end;
    }
    return 0;
}

/* The values of the entry, and how many bytes they have; null unless it is one of this channel in a message of this kind. */
static const uint8_t *values_of(const fcsl_machine_t *machine, fcsl_message_kind_t kind, uint32_t index,
                                const uint8_t *bytes, const raw_entry_t *entry, size_t *size)
{
    //@ split index;
    const fcsl_channel_t *channel = &machine->channels[index];
    const fcsl_field_t *field = &machine->fields[channel->field];
    if (!carries(kind, channel) || entry->type != entry_type(channel, field)) {
        return NULL;
    }
    const int is_blob = channel->as == FCSL_AS_BLOB;
    *size = is_blob ? entry->end - entry->values : field->size;
    if (is_blob && *size > blob_capacity(field)) {
        return NULL;
    }
    //@ split *size;
    /* Of a blob it holds, too; it ties the three together for scripts/verify/codec. */
    return entry->values + *size == entry->end ? bytes + entry->values : NULL;
}

/* Whether these are the values of a sensor that measures a rotation, and are none: all are zero, of either sign. */
static int is_no_rotation(const fcsl_channel_t *channel, const fcsl_field_t *field, const uint8_t *values)
{
    if (channel->direction != FCSL_SENSOR || channel->as != FCSL_AS_QUATERNION) {
        return 0;
    }
    const uint32_t scalar = field->size / field->count;
    uint32_t bits = 0;
    for (uint32_t i = 0; i < field->size; i++) {
        bits |= i % scalar == scalar - 1u ? values[i] & 0x7Fu : values[i];
    }
    return bits == 0u;
}

/* Checks the entry of a channel. */
static fcsl_message_status_t check_channel(const fcsl_machine_t *machine, fcsl_message_kind_t kind, uint32_t index,
                                           const uint8_t *bytes, const raw_entry_t *entry, uint32_t *skipped)
{
    //@ split index;
    const fcsl_channel_t *channel = &machine->channels[index];
    const fcsl_field_t *field = &machine->fields[channel->field];
    size_t size = 0;
    const uint8_t *values = values_of(machine, kind, index, bytes, entry, &size);
    if (values == NULL) {
        return carries(kind, channel) ? FCSL_MESSAGE_TYPE : FCSL_MESSAGE_ENTRY;
    }
    if (channel->as == FCSL_AS_BLOB || fcsl_scalars_valid(machine, values, field->type, field->count)) {
        *skipped += (uint32_t)is_no_rotation(channel, field, values);
        return FCSL_MESSAGE_OK;
    }
    return FCSL_MESSAGE_VALUE;
}

static uint32_t actuators(const fcsl_machine_t *machine)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        count += machine->channels[i].direction == FCSL_ACTUATOR;
    }
    return count;
}

/* Checks the entries in [first, end): those of channels, and those to skip. */
static fcsl_message_status_t check_entries(const fcsl_machine_t *machine, fcsl_message_kind_t kind,
                                           const uint8_t *bytes, size_t first, size_t end, uint32_t *skipped)
{
    uint32_t next = 0;   /* behind the channel of the last entry: the place of the next one in table order */
    uint32_t behind = 0; /* behind the last channel in the table that was found */
    uint32_t found = 0;
    for (size_t at = first; at < end;) {
        raw_entry_t entry = {0};
        fcsl_message_status_t status = read_entry(bytes, at, end, &entry);
        if (status != FCSL_MESSAGE_OK) {
            return status;
        }
        const uint32_t index = find_channel(machine, entry.id, next);
        if (index < machine->channel_count) {
            status = check_channel(machine, kind, index, bytes, &entry, skipped);
            if (status != FCSL_MESSAGE_OK) {
                return status;
            }
            if (index < behind && stands_before(bytes, first, at, entry.id)) {
                return FCSL_MESSAGE_ENTRY;
            }
            next = index + 1u;
            behind = next > behind ? next : behind;
            found++;
        } else if ((entry.id >= SENSORS_ID && entry.id <= TIME_ID) || entry.id == CRC_ID) {
            return FCSL_MESSAGE_ENTRY;
        } else {
            (*skipped)++;
        }
        at = entry.end;
    }
    return kind == FCSL_ACTUATOR_MESSAGE && found < actuators(machine) ? FCSL_MESSAGE_ENTRY : FCSL_MESSAGE_OK;
}

/* True when an entry of this id and type begins at `at`. */
static int begins(const uint8_t *at, uint16_t id, uint8_t type)
{
    return fcsl_get_u16(at) == id && at[2] == type;
}

int message_is_whole(const uint8_t *bytes, size_t size)
{
    if (size < CRC_BYTES || !begins(bytes + size - CRC_BYTES, CRC_ID, FCSL_U32)) {
        return 0;
    }
    const size_t sum_at = size - CRC_BYTES + ENTRY_BYTES;
    return fcsl_get_u32(bytes + sum_at) == fcsl_crc32(0, bytes, sum_at);
}

/* Checks the reserved entries, which stand at fixed places, and sets what they say in *message. */
static fcsl_message_status_t check_reserved(const fcsl_channel_table_t *table, fcsl_message_kind_t kind,
                                            const uint8_t *bytes, size_t size, fcsl_message_t *message)
{
    if (size < head_bytes(kind) + CRC_BYTES) {
        return FCSL_MESSAGE_SHORT;
    }
    if (!begins(bytes, (uint16_t)(SENSORS_ID + (unsigned)kind), FCSL_U64)) {
        return FCSL_MESSAGE_KIND;
    }
    if (!begins(bytes + size - CRC_BYTES, CRC_ID, FCSL_U32)) {
        return FCSL_MESSAGE_SHORT;
    }
    if (!message_is_whole(bytes, size)) {
        return FCSL_MESSAGE_CRC;
    }
    if (!begins(bytes + TABLE_AT, TABLE_ID, FCSL_U32)) {
        return FCSL_MESSAGE_ENTRY;
    }
    if (fcsl_get_u32(bytes + TABLE_AT + ENTRY_BYTES) != table->hash) {
        return FCSL_MESSAGE_TABLE;
    }
    message->tick = fcsl_get_u64(bytes + ENTRY_BYTES);
    const uint8_t *extra = bytes + EXTRA_AT;
    if (kind == FCSL_ACTUATOR_MESSAGE) {
        if (!begins(extra, ARMED_ID, FCSL_BOOL)) {
            return FCSL_MESSAGE_ENTRY;
        }
        message->armed = extra[ENTRY_BYTES];
        return message->armed <= 1u ? FCSL_MESSAGE_OK : FCSL_MESSAGE_VALUE;
    }
    if (kind == FCSL_TIME_MESSAGE) {
        if (!begins(extra, TIME_ID, FCSL_U64)) {
            return FCSL_MESSAGE_ENTRY;
        }
        message->time_ns = fcsl_get_u64(extra + ENTRY_BYTES);
    }
    return FCSL_MESSAGE_OK;
}

fcsl_message_status_t fcsl_message_check(const fcsl_channel_table_t *table, fcsl_message_kind_t kind,
                                         const uint8_t *bytes, size_t size, fcsl_message_t *message)
{
    fcsl_message_t checked = {.bytes = bytes, .size = size, .kind = kind};
    fcsl_message_status_t status = check_reserved(table, kind, bytes, size, &checked);
    if (status == FCSL_MESSAGE_OK) {
        status = check_entries(table->machine, kind, bytes, head_bytes(kind), size - CRC_BYTES, &checked.skipped);
    }
    if (status == FCSL_MESSAGE_OK) {
        *message = checked;
    }
    return status;
}

/* Finds the next entry of a channel from `at` on. Returns the channel, looked for in the table from `next` on; channel_count
 * if there is none. */
static uint32_t next_entry(const fcsl_machine_t *machine, const fcsl_message_t *message, size_t at, uint32_t next,
                           raw_entry_t *entry)
{
    const size_t end = message->size - CRC_BYTES;
    while (at < end && read_entry(message->bytes, at, end, entry) == FCSL_MESSAGE_OK) {
        const uint32_t channel = find_channel(machine, entry->id, next);
        if (channel < machine->channel_count) {
            return channel;
        }
        at = entry->end;
    }
    return machine->channel_count;
}

int fcsl_message_next(const fcsl_machine_t *machine, const fcsl_message_t *message, fcsl_message_entry_t *entry)
{
    const uint32_t next = entry->end == 0 ? 0 : entry->channel + 1u;
    raw_entry_t raw = {0};
    const uint32_t channel =
        next_entry(machine, message, entry->end == 0 ? head_bytes(message->kind) : entry->end, next, &raw);
    if (channel >= machine->channel_count) {
        return 0;
    }
    *entry = (fcsl_message_entry_t){.end = raw.end,
                                    .channel = channel,
                                    .size = (uint32_t)(raw.end - raw.values),
                                    .values = message->bytes + raw.values};
    return 1;
}

/* Takes the values of a channel's entry. It was checked; looked at again so that bytes changed since then cannot write beside
 * a field. */
static void take_channel(const fcsl_machine_t *machine, uint8_t *data, const fcsl_message_t *message, uint32_t index,
                         const raw_entry_t *entry)
{
    //@ split index;
    const fcsl_channel_t *channel = &machine->channels[index];
    const fcsl_field_t *field = &machine->fields[channel->field];
    size_t size = 0;
    const uint8_t *values = values_of(machine, message->kind, index, message->bytes, entry, &size);
    if (values == NULL || is_no_rotation(channel, field, values)) {
        return;
    }
    if (channel->as == FCSL_AS_BLOB) {
        blob_import(data + field->offset, values, (uint32_t)size, blob_capacity(field));
    } else {
        fcsl_scalars_import(data + field->offset, values, field->type, field->count);
    }
    if (message->kind == FCSL_SENSOR_MESSAGE) { /* of the coming tick: its samples are not old, and have no stamp */
        data[channel->fresh_offset] = 1u;
        memset(data + channel->sample_age_offset, 0, sizeof(uint32_t));
        memset(data + channel->stamp_offset, 0, sizeof(int64_t));
    }
}

void fcsl_message_apply(const fcsl_machine_t *machine, void *data, const fcsl_message_t *message)
{
    raw_entry_t entry = {0};
    uint32_t index = next_entry(machine, message, head_bytes(message->kind), 0, &entry);
    while (index < machine->channel_count) {
        take_channel(machine, (uint8_t *)data, message, index, &entry);
        index = next_entry(machine, message, entry.end, index + 1u, &entry);
    }
}
