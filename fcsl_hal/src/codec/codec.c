/* SPDX-License-Identifier: Apache-2.0
 *
 * Encodes messages of channels, and computes the hash of a channel table.
 *
 * `//@ split` is for scripts/verify/codec: from there on it analyses each count by itself.
 */
#include "codec_layout.h"

fcsl_channel_table_t fcsl_channel_table(const fcsl_machine_t *machine)
{
    uint32_t crc = 0;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        const fcsl_field_t *field = &machine->fields[channel->field];
        uint8_t row[8] = {0};
        fcsl_put_u16(row, channel->id);
        row[2] = channel->direction;
        row[3] = entry_type(channel, field);
        fcsl_put_u32(row + 4, entry_count(channel, field));
        crc = fcsl_crc32(crc, row, sizeof row);
    }
    return (fcsl_channel_table_t){.machine = machine, .hash = crc};
}

size_t fcsl_message_capacity(const fcsl_machine_t *machine, fcsl_message_kind_t kind)
{
    size_t bytes = head_bytes(kind) + FCSL_UNKNOWN_BYTES + CRC_BYTES;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        if (carries(kind, channel)) {
            bytes += entry_bytes(channel, &machine->fields[channel->field]);
        }
    }
    return bytes;
}

/* Writes id and type, and returns the place behind them. */
static uint8_t *put_entry(uint8_t *at, uint16_t id, uint8_t type)
{
    fcsl_put_u16(at, id);
    at[2] = type;
    return at + ENTRY_BYTES;
}

/* Writes the entry of a channel behind *at, and moves *at behind it. */
static fcsl_message_status_t put_channel(const fcsl_machine_t *machine, const fcsl_channel_t *channel,
                                         const uint8_t *data, uint8_t *bytes, size_t capacity, size_t *at)
{
    const fcsl_field_t *field = &machine->fields[channel->field];
    const uint8_t *from = data + field->offset;
    const uint8_t type = entry_type(channel, field);
    const int is_blob = channel->as == FCSL_AS_BLOB;
    const uint32_t count = is_blob ? blob_count(from, blob_capacity(field)) : field->count;
    const size_t head = ENTRY_BYTES + (is_array(type) ? (size_t)COUNT_BYTES : 0u);
    size_t size = head + field->size;
    //@ split count;
    if (is_blob) {
        size = head + count;
    }
    if (capacity - *at < size + CRC_BYTES) {
        return FCSL_MESSAGE_SHORT;
    }
    uint8_t *values = put_entry(bytes + *at, channel->id, type);
    if (is_array(type)) {
        fcsl_put_u16(values, (uint16_t)count);
        values += COUNT_BYTES;
    }
    if (is_blob) {
        blob_export(values, from, count);
    } else {
        fcsl_scalars_export(values, from, field->type, count);
        if (!fcsl_scalars_valid(machine, values, field->type, count)) {
            return FCSL_MESSAGE_VALUE;
        }
    }
    *at += size;
    return FCSL_MESSAGE_OK;
}

/* Writes the channels of *message from `data` behind *at, and moves *at behind them. */
static fcsl_message_status_t put_channels(const fcsl_machine_t *machine, const uint8_t *data, const uint8_t *select,
                                          const fcsl_message_t *message, uint8_t *bytes, size_t capacity, size_t *at)
{
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        if (!carries(message->kind, channel) || (select != NULL && select[i] == 0u)) {
            continue;
        }
        const fcsl_message_status_t status = put_channel(machine, channel, data, bytes, capacity, at);
        if (status != FCSL_MESSAGE_OK) {
            return status;
        }
    }
    return FCSL_MESSAGE_OK;
}

/* Writes what *wanted says, with the channels of `data`, and sets *message. */
static fcsl_message_status_t encode(const fcsl_channel_table_t *table, const uint8_t *data, const uint8_t *select,
                                    const fcsl_message_t *wanted, uint8_t *bytes, size_t capacity,
                                    fcsl_message_t *message)
{
    size_t at = head_bytes(wanted->kind);
    if (capacity < at + CRC_BYTES) {
        return FCSL_MESSAGE_SHORT;
    }
    fcsl_put_u64(put_entry(bytes, (uint16_t)(SENSORS_ID + (unsigned)wanted->kind), FCSL_U64), wanted->tick);
    fcsl_put_u32(put_entry(bytes + TABLE_AT, TABLE_ID, FCSL_U32), table->hash);
    if (wanted->kind == FCSL_ACTUATOR_MESSAGE) {
        *put_entry(bytes + EXTRA_AT, ARMED_ID, FCSL_BOOL) = wanted->armed;
    } else if (wanted->kind == FCSL_TIME_MESSAGE) {
        fcsl_put_u64(put_entry(bytes + EXTRA_AT, TIME_ID, FCSL_U64), wanted->time_ns);
    }
    const fcsl_message_status_t status = put_channels(table->machine, data, select, wanted, bytes, capacity, &at);
    if (status != FCSL_MESSAGE_OK) {
        return status;
    }
    uint8_t *crc = put_entry(bytes + at, CRC_ID, FCSL_U32);
    fcsl_put_u32(crc, fcsl_crc32(0, bytes, at + ENTRY_BYTES));
    *message = *wanted;
    message->bytes = bytes;
    message->size = at + CRC_BYTES;
    return FCSL_MESSAGE_OK;
}

fcsl_message_status_t fcsl_message_encode_sensors(const fcsl_channel_table_t *table, const void *data, uint64_t tick,
                                                  const uint8_t *select, uint8_t *bytes, size_t capacity,
                                                  fcsl_message_t *message)
{
    const fcsl_message_t wanted = {.kind = FCSL_SENSOR_MESSAGE, .tick = tick};
    return encode(table, data, select, &wanted, bytes, capacity, message);
}

fcsl_message_status_t fcsl_message_encode_actuators(const fcsl_channel_table_t *table, const void *data, uint64_t tick,
                                                    int armed, uint8_t *bytes, size_t capacity, fcsl_message_t *message)
{
    const fcsl_message_t wanted = {.kind = FCSL_ACTUATOR_MESSAGE, .tick = tick, .armed = armed != 0};
    return encode(table, data, NULL, &wanted, bytes, capacity, message);
}

fcsl_message_status_t fcsl_message_encode_time(const fcsl_channel_table_t *table, uint64_t tick, uint64_t time_ns,
                                               uint8_t *bytes, size_t capacity, fcsl_message_t *message)
{
    const fcsl_message_t wanted = {.kind = FCSL_TIME_MESSAGE, .tick = tick, .time_ns = time_ns};
    return encode(table, NULL, NULL, &wanted, bytes, capacity, message);
}

const char *fcsl_message_status_text(fcsl_message_status_t status)
{
    switch (status) {
    case FCSL_MESSAGE_OK:
        return "ok";
    case FCSL_MESSAGE_SHORT:
        return "truncated, or longer than its entries";
    case FCSL_MESSAGE_KIND:
        return "it does not begin as a message of this kind";
    case FCSL_MESSAGE_CRC:
        return "checksum mismatch";
    case FCSL_MESSAGE_TABLE:
        return "made for another channel table";
    case FCSL_MESSAGE_ENTRY:
        return "an entry is missing, repeated or misplaced";
    case FCSL_MESSAGE_TYPE:
        return "an entry of an unknown type, or of another type than its channel's";
    case FCSL_MESSAGE_VALUE:
        return "a value that its type does not have";
    }
    return "unknown message status";
}
