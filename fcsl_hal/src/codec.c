/* SPDX-License-Identifier: Apache-2.0
 *
 * Channel frames: encodes samples, decodes and checks frames, and computes the hash of a channel table.
 */
#include "fcsl/fcsl_codec.h"

#include "fcsl/fcsl_scalar.h"

enum {
    HEADER_BYTES = 24,
    ENTRY_BYTES = 4,
    CRC_BYTES = 4,
    VERSION = 1,
    DIRECTION_AT = 6,
    TICK_AT = 8,
    TABLE_AT = 16,
    ENTRIES_AT = 20,
};

static const uint8_t MAGIC[4] = {'F', 'C', 'S', 'F'};

fcsl_channel_table_t fcsl_channel_table(const fcsl_machine_t *machine)
{
    uint32_t crc = 0;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        const fcsl_field_t *field = &machine->fields[channel->field];
        uint8_t row[8] = {0};
        fcsl_put_u16(row, channel->id);
        row[2] = channel->direction;
        row[3] = field->type;
        fcsl_put_u32(row + 4, field->count);
        crc = fcsl_crc32(crc, row, sizeof row);
    }
    return (fcsl_channel_table_t){.machine = machine, .hash = crc};
}

size_t fcsl_frame_capacity(const fcsl_machine_t *machine, fcsl_direction_t direction)
{
    size_t bytes = HEADER_BYTES + CRC_BYTES;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        if (machine->channels[i].direction == (uint8_t)direction) {
            bytes += ENTRY_BYTES + (size_t)machine->fields[machine->channels[i].field].size;
        }
    }
    return bytes;
}

fcsl_frame_status_t fcsl_frame_encode(const fcsl_channel_table_t *table, const void *data, fcsl_direction_t direction,
                                      uint64_t tick, const uint8_t *select, uint8_t *bytes, size_t capacity,
                                      fcsl_frame_t *frame)
{
    const fcsl_machine_t *machine = table->machine;
    if (capacity < HEADER_BYTES + CRC_BYTES) {
        return FCSL_FRAME_SHORT;
    }
    const uint8_t *base = (const uint8_t *)data;
    size_t at = HEADER_BYTES;
    uint16_t entries = 0;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        if (channel->direction != (uint8_t)direction || (select != NULL && select[i] == 0u)) {
            continue;
        }
        const fcsl_field_t *field = &machine->fields[channel->field];
        if (capacity - at < ENTRY_BYTES + (size_t)field->size + CRC_BYTES) {
            return FCSL_FRAME_SHORT;
        }
        fcsl_put_u16(bytes + at, channel->id);
        fcsl_put_u16(bytes + at + 2, (uint16_t)field->size);
        fcsl_scalars_export(bytes + at + ENTRY_BYTES, base + field->offset, field->type, field->count);
        if (!fcsl_scalars_valid(machine, bytes + at + ENTRY_BYTES, field->type, field->count)) {
            return FCSL_FRAME_VALUE;
        }
        at += ENTRY_BYTES + (size_t)field->size;
        entries++;
    }
    memset(bytes, 0, HEADER_BYTES);
    memcpy(bytes, MAGIC, sizeof MAGIC);
    fcsl_put_u16(bytes + 4, VERSION);
    bytes[DIRECTION_AT] = (uint8_t)direction;
    fcsl_put_u64(bytes + TICK_AT, tick);
    fcsl_put_u32(bytes + TABLE_AT, table->hash);
    fcsl_put_u16(bytes + ENTRIES_AT, entries);
    fcsl_put_u32(bytes + at, fcsl_crc32(0, bytes, at));
    *frame = (fcsl_frame_t){.bytes = bytes, .size = at + CRC_BYTES, .tick = tick, .direction = direction};
    return FCSL_FRAME_OK;
}

/* Finds the channel of this id and direction at or after *index; *index moves behind it. */
static const fcsl_channel_t *next_channel(const fcsl_machine_t *machine, fcsl_direction_t direction, uint16_t id,
                                          uint32_t *index)
{
    while (*index < machine->channel_count) {
        const fcsl_channel_t *channel = &machine->channels[(*index)++];
        if (channel->id == id && channel->direction == (uint8_t)direction) {
            return channel;
        }
    }
    return NULL;
}

static fcsl_frame_status_t check_entries(const fcsl_machine_t *machine, fcsl_direction_t direction,
                                         const uint8_t *bytes, size_t end)
{
    const uint16_t entries = fcsl_get_u16(bytes + ENTRIES_AT);
    size_t at = HEADER_BYTES;
    uint32_t index = 0;
    for (uint32_t i = 0; i < entries; i++) {
        if (end - at < ENTRY_BYTES) {
            return FCSL_FRAME_SHORT;
        }
        const size_t size = fcsl_get_u16(bytes + at + 2);
        if (end - at - ENTRY_BYTES < size) {
            return FCSL_FRAME_SHORT;
        }
        const fcsl_channel_t *channel = next_channel(machine, direction, fcsl_get_u16(bytes + at), &index);
        if (channel == NULL || machine->fields[channel->field].size != size) {
            return FCSL_FRAME_CHANNEL;
        }
        const fcsl_field_t *field = &machine->fields[channel->field];
        if (!fcsl_scalars_valid(machine, bytes + at + ENTRY_BYTES, field->type, field->count)) {
            return FCSL_FRAME_VALUE;
        }
        at += ENTRY_BYTES + size;
    }
    return at == end ? FCSL_FRAME_OK : FCSL_FRAME_SHORT;
}

fcsl_frame_status_t fcsl_frame_check(const fcsl_channel_table_t *table, fcsl_direction_t direction,
                                     const uint8_t *bytes, size_t size, fcsl_frame_t *frame)
{
    if (size < HEADER_BYTES + CRC_BYTES) {
        return FCSL_FRAME_SHORT;
    }
    if (memcmp(bytes, MAGIC, sizeof MAGIC) != 0 || fcsl_get_u16(bytes + 4) != VERSION) {
        return FCSL_FRAME_MAGIC;
    }
    const size_t end = size - CRC_BYTES;
    if (fcsl_get_u32(bytes + end) != fcsl_crc32(0, bytes, end)) {
        return FCSL_FRAME_CRC;
    }
    if (bytes[7] != 0u || fcsl_get_u16(bytes + 22) != 0u) {
        return FCSL_FRAME_MAGIC;
    }
    if (fcsl_get_u32(bytes + TABLE_AT) != table->hash) {
        return FCSL_FRAME_TABLE;
    }
    if (bytes[DIRECTION_AT] != (uint8_t)direction) {
        return FCSL_FRAME_DIRECTION;
    }
    const fcsl_frame_status_t status = check_entries(table->machine, direction, bytes, end);
    if (status == FCSL_FRAME_OK) {
        *frame =
            (fcsl_frame_t){.bytes = bytes, .size = size, .tick = fcsl_get_u64(bytes + TICK_AT), .direction = direction};
    }
    return status;
}

int fcsl_frame_next(const fcsl_machine_t *machine, const fcsl_frame_t *frame, fcsl_frame_entry_t *entry)
{
    if (entry->number >= fcsl_get_u16(frame->bytes + ENTRIES_AT)) {
        return 0;
    }
    const uint8_t *at = entry->number == 0 ? frame->bytes + HEADER_BYTES : entry->payload + entry->size;
    uint32_t index = entry->number == 0 ? 0 : entry->channel + 1u;
    if (next_channel(machine, frame->direction, fcsl_get_u16(at), &index) == NULL) {
        return 0; /* not a frame of this machine */
    }
    entry->number++;
    entry->channel = index - 1u;
    entry->size = fcsl_get_u16(at + 2);
    entry->payload = at + ENTRY_BYTES;
    return 1;
}

void fcsl_frame_apply(const fcsl_machine_t *machine, void *data, const fcsl_frame_t *frame)
{
    uint8_t *base = (uint8_t *)data;
    fcsl_frame_entry_t entry = {0};
    while (fcsl_frame_next(machine, frame, &entry) != 0) {
        const fcsl_channel_t *channel = &machine->channels[entry.channel];
        const fcsl_field_t *field = &machine->fields[channel->field];
        fcsl_scalars_import(base + field->offset, entry.payload, field->type, field->count);
        if (frame->direction == FCSL_SENSOR) { /* of the coming tick: its samples are not old, and have no stamp */
            base[channel->fresh_offset] = 1u;
            memset(base + channel->sample_age_offset, 0, sizeof(uint32_t));
            memset(base + channel->stamp_offset, 0, sizeof(int64_t));
        }
    }
}

const char *fcsl_frame_status_text(fcsl_frame_status_t status)
{
    switch (status) {
    case FCSL_FRAME_OK:
        return "ok";
    case FCSL_FRAME_SHORT:
        return "truncated, or longer than its entries";
    case FCSL_FRAME_MAGIC:
        return "not a channel frame of this version";
    case FCSL_FRAME_CRC:
        return "checksum mismatch";
    case FCSL_FRAME_TABLE:
        return "made for another channel table";
    case FCSL_FRAME_DIRECTION:
        return "wrong direction";
    case FCSL_FRAME_CHANNEL:
        return "unknown, repeated or misplaced channel, or a payload of the wrong size";
    case FCSL_FRAME_VALUE:
        return "a value that its type does not have";
    }
    return "unknown frame status";
}
