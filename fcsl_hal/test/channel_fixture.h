/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine that consists of channels of every type: all that the HAL reads. By hand, because fcslc makes no channel of a health,
 * and none without the offsets that a HAL leaves alone.
 */
#ifndef CHANNEL_FIXTURE_H
#define CHANNEL_FIXTURE_H

#include <stddef.h>

#include "fcsl/fcsl_machine.h"

typedef struct {
    uint8_t flag;
    uint8_t fresh[10];
    uint32_t sample_age[10];
    int64_t stamp[10];
    int32_t i32[3];
    int64_t i64;
    uint32_t u32;
    uint64_t u64[2];
    float f32[4];
    double f64[9];
    int32_t health;
    double command[2];
    uint8_t enable[3];
    uint32_t packet[6];
    uint32_t reply[3];
} data_t;

/* Scalars, and arrays of one axis. */
#define FIELD(path_, type_, count_, member_, size_)                                                                    \
    {.path = path_,                                                                                                    \
     .role = FCSL_ROLE_OUTPUT,                                                                                         \
     .type = type_,                                                                                                    \
     .flags = FCSL_FIELD_WRITABLE,                                                                                     \
     .rank = (count_) > 1,                                                                                             \
     .shape = (const uint32_t[]){count_},                                                                              \
     .count = count_,                                                                                                  \
     .offset = offsetof(data_t, member_),                                                                              \
     .size = size_}

static const fcsl_field_t FIELDS[] = {
    FIELD("flag", FCSL_BOOL, 1, flag, 1),       FIELD("i32", FCSL_I32, 3, i32, 12),
    FIELD("i64", FCSL_I64, 1, i64, 8),          FIELD("u32", FCSL_U32, 1, u32, 4),
    FIELD("u64", FCSL_U64, 2, u64, 16),         FIELD("f32", FCSL_F32, 4, f32, 16),
    FIELD("f64", FCSL_F64, 9, f64, 72),         FIELD("health", FCSL_HEALTH, 1, health, 4),
    FIELD("command", FCSL_F64, 2, command, 16), FIELD("enable", FCSL_BOOL, 3, enable, 3),
    FIELD("packet", FCSL_U32, 6, packet, 24),   FIELD("reply", FCSL_U32, 3, reply, 12),
};

#define SENSOR(name_, id_, field_, slot_, as_)                                                                         \
    {.name = name_,                                                                                                    \
     .id = id_,                                                                                                        \
     .direction = FCSL_SENSOR,                                                                                         \
     .field = field_,                                                                                                  \
     .attached_offset = FCSL_NO_OFFSET,                                                                                \
     .fresh_offset = (uint32_t)offsetof(data_t, fresh) + slot_,                                                        \
     .valid_offset = FCSL_NO_OFFSET,                                                                                   \
     .waiting_offset = FCSL_NO_OFFSET,                                                                                 \
     .age_offset = FCSL_NO_OFFSET,                                                                                     \
     .sample_age_offset = (uint32_t)offsetof(data_t, sample_age) + 4u * slot_,                                         \
     .stamp_offset = (uint32_t)offsetof(data_t, stamp) + 8u * slot_,                                                   \
     .as = as_}
#define ACTUATOR(name_, id_, field_, as_)                                                                              \
    {.name = name_,                                                                                                    \
     .id = id_,                                                                                                        \
     .direction = FCSL_ACTUATOR,                                                                                       \
     .field = field_,                                                                                                  \
     .fresh_offset = FCSL_NO_OFFSET,                                                                                   \
     .sample_age_offset = FCSL_NO_OFFSET,                                                                              \
     .stamp_offset = FCSL_NO_OFFSET,                                                                                   \
     .as = as_}

/* Ids fall, and directions mix: neither order means anything. */
static const fcsl_channel_t CHANNELS[] = {
    SENSOR("flag", 900, 0, 0, FCSL_AS_FIELD),   ACTUATOR("command", 1, 8, FCSL_AS_FIELD),
    SENSOR("i32", 800, 1, 1, FCSL_AS_FIELD),    SENSOR("i64", 700, 2, 2, FCSL_AS_FIELD),
    SENSOR("u32", 65279, 3, 3, FCSL_AS_FIELD),  SENSOR("u64", 500, 4, 4, FCSL_AS_FIELD),
    SENSOR("f32", 0, 5, 5, FCSL_AS_QUATERNION), SENSOR("f64", 300, 6, 6, FCSL_AS_FIELD),
    SENSOR("health", 200, 7, 7, FCSL_AS_FIELD), ACTUATOR("enable", 2, 9, FCSL_AS_FIELD),
    SENSOR("packet", 150, 10, 8, FCSL_AS_BLOB), ACTUATOR("reply", 3, 11, FCSL_AS_BLOB),
};

enum { FIELD_COUNT = sizeof FIELDS / sizeof FIELDS[0], CHANNEL_COUNT = sizeof CHANNELS / sizeof CHANNELS[0] };

static const fcsl_machine_t MACHINE = {
    .abi_version = FCSL_ABI_VERSION,
    .name = "channels",
    .tick_hz = 100,
    .size = sizeof(data_t),
    .align = _Alignof(data_t),
    .fields = FIELDS,
    .field_count = FIELD_COUNT,
    .channels = CHANNELS,
    .channel_count = CHANNEL_COUNT,
    .arm_field = FCSL_NONE,
};

#endif /* CHANNEL_FIXTURE_H */
