/* SPDX-License-Identifier: Apache-2.0
 *
 * Values of channels as they lie on the bus.
 */
#include "payload.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "codec/codec_blob.h"
#include "ros/ros_walk.h"

enum {
    /* Of a message that another program made: strings may be longer than ours, or layouts of arrays be filled in, */
    TEXTS_BYTES = 256,
    /* and DDS may have aligned its end. */
    PADDING_BYTES = 7,
    OPTIONS_AT = 2, /* of an encapsulation; they say nothing */
    LENGTH_BYTES = 4, /* of a blob: the last member of its message is an empty sequence */
};

static const fcsl_field_t *field_of(const fcsl_machine_t *machine, uint32_t channel)
{
    return &machine->fields[machine->channels[channel].field];
}

static int is_blob(const fcsl_machine_t *machine, uint32_t channel)
{
    return machine->channels[channel].as == FCSL_AS_BLOB;
}

/* Whether all messages of a conversion have the same size. */
static int is_fixed(const fcsl_ros_reader_plan_t *conversion)
{
    int fixed = 1;
    for (uint32_t i = 0; i < conversion->part_count && fixed; i++) {
        fixed = conversion->parts[i].code == FCSL_ROS_BLOCK;
    }
    return fixed;
}

uint32_t payload_bytes(const fcsl_machine_t *machine, uint32_t channel)
{
    const fcsl_field_t *field = field_of(machine, channel);
    const uint32_t blob = is_blob(machine, channel) ? blob_capacity(field) : 0u;
    if (machine->payloads == NULL) {
        return blob > 0u ? blob : field->size;
    }
    return machine->payloads[channel].composer->size + blob;
}

uint32_t payload_most(const fcsl_machine_t *machine, uint32_t channel)
{
    const uint32_t bytes = payload_bytes(machine, channel);
    if (machine->payloads == NULL) {
        return bytes;
    }
    const int fixed = is_blob(machine, channel) || is_fixed(machine->payloads[channel].reader);
    return bytes + PADDING_BYTES + (fixed ? 0u : TEXTS_BYTES);
}

uint32_t payload_least(const fcsl_machine_t *machine, uint32_t channel)
{
    if (machine->payloads == NULL) {
        return is_blob(machine, channel) ? 0u : field_of(machine, channel)->size;
    }
    const fcsl_ros_message_t *message = &machine->payloads[channel];
    return is_blob(machine, channel) || is_fixed(message->reader) ? message->composer->size : 0u;
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

int payload_open(payload_t *payload, const fcsl_machine_t *machine, fcsl_error_t *error)
{
    *payload = (payload_t){.machine = machine};
    if (machine->payloads == NULL) {
        return 0;
    }
    uint32_t longest = 0;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const uint32_t row = machine->payloads[i].reader->size;
        longest = row > longest ? row : longest;
    }
    payload->composers = calloc((size_t)machine->channel_count + 1u, sizeof(fcsl_ros_composer_t *));
    payload->readers = calloc((size_t)machine->channel_count + 1u, sizeof(fcsl_ros_reader_t *));
    payload->row = calloc((size_t)longest + 1u, 1);
    int failed = payload->composers == NULL || payload->readers == NULL || payload->row == NULL;
    if (failed) {
        (void)fcsl_fail(error, "out of memory for the messages of channels");
    }
    for (uint32_t i = 0; i < machine->channel_count && !failed; i++) {
        payload->composers[i] = fcsl_ros_composer_new(machine->payloads[i].composer, error);
        payload->readers[i] = fcsl_ros_reader_new(machine->payloads[i].reader, error);
        failed = payload->composers[i] == NULL || payload->readers[i] == NULL;
    }
    if (failed) {
        payload_close(payload);
        return -1;
    }
    return 0;
}

void payload_close(payload_t *payload)
{
    const uint32_t channels = payload->machine != NULL ? payload->machine->channel_count : 0u;
    for (uint32_t i = 0; i < channels && payload->composers != NULL; i++) {
        fcsl_ros_composer_free(payload->composers[i]);
    }
    for (uint32_t i = 0; i < channels && payload->readers != NULL; i++) {
        fcsl_ros_reader_free(payload->readers[i]);
    }
    free((void *)payload->composers);
    free((void *)payload->readers);
    free(payload->row);
    *payload = (payload_t){0};
}

/* ---- writing -------------------------------------------------------------------------------------------------------- */

int payload_write(const payload_t *payload, uint32_t channel, const uint8_t *data, int64_t time_ns, uint8_t *bytes,
                  uint32_t *size)
{
    const fcsl_machine_t *machine = payload->machine;
    const fcsl_field_t *field = field_of(machine, channel);
    uint32_t head = 0;
    if (payload->composers != NULL) {
        if (fcsl_ros_compose(payload->composers[channel], &data, time_ns, bytes, &head) != FCSL_ROS_TAKEN) {
            return -1;
        }
    }
    *size = head;
    if (is_blob(machine, channel)) {
        const uint32_t count = blob_count(data + field->offset, blob_capacity(field));
        if (head > 0u) {
            fcsl_put_u32(bytes + head - LENGTH_BYTES, count);
        }
        blob_export(bytes + head, data + field->offset, count);
        *size += count;
    } else if (head == 0u) {
        fcsl_scalars_export(bytes, data + field->offset, field->type, field->count);
        *size = field->size;
    }
    return 0;
}

/* ---- reading -------------------------------------------------------------------------------------------------------- */

/* A blob, in a message with an empty layout or as it is. */
static int read_blob(const payload_t *payload, uint32_t channel, const uint8_t *bytes, size_t size, uint8_t *place)
{
    const fcsl_machine_t *machine = payload->machine;
    const uint32_t capacity = blob_capacity(field_of(machine, channel));
    uint32_t head = 0;
    size_t count = size;
    if (payload->composers != NULL) {
        const fcsl_ros_composer_plan_t *conversion = machine->payloads[channel].composer;
        head = conversion->size;
        if (size < head || memcmp(bytes, conversion->text, OPTIONS_AT) != 0 ||
            memcmp(bytes + FCSL_ROS_ENCAPSULATION_BYTES, conversion->text + FCSL_ROS_ENCAPSULATION_BYTES,
                   head - FCSL_ROS_ENCAPSULATION_BYTES - LENGTH_BYTES) != 0) {
            return -1;
        }
        count = fcsl_get_u32(bytes + head - LENGTH_BYTES);
        if (count > size - head || size - head - count > PADDING_BYTES) {
            return -1;
        }
    }
    if (count > capacity) {
        return -1;
    }
    blob_import(place, bytes + head, (uint32_t)count, capacity);
    return 0;
}

int payload_read(payload_t *payload, uint32_t channel, const uint8_t *bytes, size_t size, uint8_t *data)
{
    const fcsl_machine_t *machine = payload->machine;
    const fcsl_field_t *field = field_of(machine, channel);
    const uint8_t *values = bytes;
    if (is_blob(machine, channel)) {
        return read_blob(payload, channel, bytes, size, data + field->offset);
    }
    if (payload->readers != NULL) {
        fcsl_ros_reader_t *reader = payload->readers[channel];
        uint8_t status = FCSL_ROS_TAKEN;
        int64_t stamp_ns = 0;
        (void)fcsl_ros_read(reader, bytes, size, payload->row, &status, &stamp_ns);
        if (status != FCSL_ROS_TAKEN || size - fcsl_ros_reader_end(reader) > PADDING_BYTES) {
            return -1;
        }
        values = payload->row;
    } else if (size != field->size) {
        return -1;
    }
    if (!fcsl_scalars_valid(machine, values, field->type, field->count)) {
        return -1;
    }
    fcsl_scalars_import(data + field->offset, values, field->type, field->count);
    return 0;
}
