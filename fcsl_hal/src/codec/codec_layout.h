/* SPDX-License-Identifier: Apache-2.0
 *
 * Where what stands in a message (docs/reference/transports.md).
 */
#ifndef FCSL_CODEC_LAYOUT_H
#define FCSL_CODEC_LAYOUT_H

#include "codec_blob.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"

enum {
    SENSORS_ID = 0xff00, /* the tick, and thereby the kind: SENSORS_ID + fcsl_message_kind_t */
    TABLE_ID = 0xff03,
    ARMED_ID = 0xff04,
    TIME_ID = 0xff05,
    CRC_ID = 0xffff,

    ENTRY_BYTES = 3, /* id and type */
    COUNT_BYTES = 2, /* of an array or blob */
    TABLE_AT = ENTRY_BYTES + 8,
    EXTRA_AT = TABLE_AT + ENTRY_BYTES + 4, /* what only this kind has */
    CRC_BYTES = ENTRY_BYTES + 4,
};

/* The upper four bits of a type; the lower four are the scalar's fcsl_type_t, at most FCSL_F64. */
enum { SCALAR = 0, VECTOR = 1, QUATERNION = 2, ARRAY = 3, BLOB = 4 };

static inline int is_array(uint8_t type)
{
    return type >> 4 >= ARRAY;
}

/* Whether the bytes end with the sum of those before it, as messages of channels do. */
int message_is_whole(const uint8_t *bytes, size_t size);

/* The type of the channel's entry. `field`: the channel's. */
static inline uint8_t entry_type(const fcsl_channel_t *channel, const fcsl_field_t *field)
{
    if (channel->as == FCSL_AS_BLOB) {
        return BLOB << 4;
    }
    const uint8_t scalar = field->type <= FCSL_F64 ? field->type : (uint8_t)FCSL_I32;
    const unsigned shape = channel->as == FCSL_AS_QUATERNION        ? QUATERNION
                           : field->rank == 0                       ? SCALAR
                           : field->rank == 1 && field->count == 3u ? VECTOR
                                                                    : ARRAY;
    return (uint8_t)(shape << 4 | scalar);
}

/* Values of the channel's entry; of a blob: bytes at most. */
static inline uint32_t entry_count(const fcsl_channel_t *channel, const fcsl_field_t *field)
{
    return channel->as == FCSL_AS_BLOB ? blob_capacity(field) : field->count;
}

/* Bytes of the channel's entry; of a blob: at most. */
static inline size_t entry_bytes(const fcsl_channel_t *channel, const fcsl_field_t *field)
{
    const size_t count_bytes = is_array(entry_type(channel, field)) ? (size_t)COUNT_BYTES : 0u;
    return ENTRY_BYTES + count_bytes + (channel->as == FCSL_AS_BLOB ? blob_capacity(field) : field->size);
}

static inline size_t head_bytes(fcsl_message_kind_t kind)
{
    static const uint8_t extra[] = {0, ENTRY_BYTES + 1, ENTRY_BYTES + 8};
    return EXTRA_AT + (size_t)extra[kind];
}

/* No message carries a report. */
static inline int carries(fcsl_message_kind_t kind, const fcsl_channel_t *channel)
{
    return (kind == FCSL_SENSOR_MESSAGE && channel->direction == FCSL_SENSOR) ||
           (kind == FCSL_ACTUATOR_MESSAGE && channel->direction == FCSL_ACTUATOR);
}

#endif /* FCSL_CODEC_LAYOUT_H */
