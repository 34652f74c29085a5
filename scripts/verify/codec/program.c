/* SPDX-License-Identifier: Apache-2.0
 *
 * What main.py gives to EVA: the codec, COBS and frames of the link on any bytes of every size up to a bound. Bytes lie at the
 * end of their memory, so that a read or a write behind them is an alarm. The machine is by hand, because fcslc leaves no gaps
 * between fields.
 */
#include <stddef.h>

#include "fcsl/fcsl_cobs.h"
#include "fcsl/fcsl_codec.h"
#include "link/link_frame.h"

/* Bytes: of messages, capacities and frames. Each entry below fits into the longest message. */
#ifndef SMALLEST
#define SMALLEST 0
#endif
#ifndef LARGEST
#define LARGEST 44
#endif
enum { STREAM_MAX = 12 }; /* in one piece */

volatile uint8_t any_u8;
volatile uint32_t any_u32;

/* A channel of every way in which values are read, checked and stored. Nothing writes what lies between the fields. */
enum { GAPS = 13, GAP_BYTES = 8 };
typedef struct {
    uint8_t flags[3];
    uint8_t gap0[GAP_BYTES];
    uint8_t fresh[10];
    uint8_t gap1[GAP_BYTES];
    uint32_t age[10];
    uint8_t gap2[GAP_BYTES];
    int64_t stamp[10];
    uint8_t gap3[GAP_BYTES];
    int32_t health;
    uint8_t gap4[GAP_BYTES];
    float rate[3];
    uint8_t gap5[GAP_BYTES];
    double position[1];
    uint8_t gap6[GAP_BYTES];
    uint64_t count;
    uint8_t gap7[GAP_BYTES];
    uint32_t packet[4];
    uint8_t gap10[GAP_BYTES];
    uint32_t reply[3];
    uint8_t gap11[GAP_BYTES];
    float command[1];
    uint8_t gap8[GAP_BYTES];
    uint8_t enable;
    uint8_t gap9[GAP_BYTES];
    float attitude[4];
    uint8_t gap12[GAP_BYTES];
} data_t;

#define FIELD(type_, member_, count_, rank_)                                                                           \
    {.path = #member_,                                                                                                 \
     .type = (type_),                                                                                                  \
     .rank = (rank_),                                                                                                  \
     .count = (count_),                                                                                                \
     .offset = offsetof(data_t, member_),                                                                              \
     .size = sizeof(((data_t *)0)->member_)}
#define SENSOR(id_, field_, as_)                                                                                       \
    {.name = "",                                                                                                       \
     .id = (id_),                                                                                                      \
     .direction = FCSL_SENSOR,                                                                                         \
     .field = (field_),                                                                                                \
     .fresh_offset = offsetof(data_t, fresh) + (field_),                                                               \
     .sample_age_offset = offsetof(data_t, age) + 4u * (field_),                                                       \
     .stamp_offset = offsetof(data_t, stamp) + 8u * (field_),                                                          \
     .as = (as_)}
#define ACTUATOR(id_, field_, as_)                                                                                     \
    {.name = "",                                                                                                       \
     .id = (id_),                                                                                                      \
     .direction = FCSL_ACTUATOR,                                                                                       \
     .field = (field_),                                                                                                \
     .fresh_offset = FCSL_NO_OFFSET,                                                                                   \
     .sample_age_offset = FCSL_NO_OFFSET,                                                                              \
     .stamp_offset = FCSL_NO_OFFSET,                                                                                   \
     .as = (as_)}

static const fcsl_field_t FIELDS[] = {
    FIELD(FCSL_BOOL, flags, 3, 1),   FIELD(FCSL_HEALTH, health, 1, 0), FIELD(FCSL_F32, rate, 3, 1),
    FIELD(FCSL_F64, position, 1, 1), FIELD(FCSL_U64, count, 1, 0),     FIELD(FCSL_U32, packet, 4, 1),
    FIELD(FCSL_F32, command, 1, 1),  FIELD(FCSL_BOOL, enable, 1, 0),   FIELD(FCSL_U32, reply, 3, 1),
    FIELD(FCSL_F32, attitude, 4, 1),
};
static const fcsl_channel_t CHANNELS[] = {SENSOR(900, 0, FCSL_AS_FIELD), ACTUATOR(1, 6, FCSL_AS_FIELD),
                                          SENSOR(800, 1, FCSL_AS_FIELD), SENSOR(3, 2, FCSL_AS_FIELD),
                                          SENSOR(700, 3, FCSL_AS_FIELD), SENSOR(4, 4, FCSL_AS_FIELD),
                                          SENSOR(5, 5, FCSL_AS_BLOB),    ACTUATOR(2, 7, FCSL_AS_FIELD),
                                          ACTUATOR(6, 8, FCSL_AS_BLOB),  SENSOR(7, 9, FCSL_AS_QUATERNION)};
enum { CHANNEL_COUNT = sizeof CHANNELS / sizeof CHANNELS[0] };
static const fcsl_machine_t MACHINE = {
    .name = "any",
    .size = sizeof(data_t),
    .fields = FIELDS,
    .field_count = sizeof FIELDS / sizeof FIELDS[0],
    .channels = CHANNELS,
    .channel_count = CHANNEL_COUNT,
};

static uint8_t memory[LARGEST];
static data_t data;     /* what is sent: any bytes */
static data_t received; /* zero, but for what a message brings */

static void any_bytes(uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        bytes[i] = any_u8;
    }
}

static void check_gaps(void)
{
    const uint8_t *const gaps[GAPS] = {received.gap0,  received.gap1,  received.gap2, received.gap3, received.gap4,
                                       received.gap5,  received.gap6,  received.gap7, received.gap8, received.gap9,
                                       received.gap10, received.gap11, received.gap12};
    for (int i = 0; i < GAPS; i++) {
        for (int j = 0; j < GAP_BYTES; j++) {
            //@ assert gaps[i][j] == 0;
            (void)gaps[i][j];
        }
    }
}

/* A message of any bytes is checked, and taken if it fits; meanwhile its bytes may become any others. */
static void receive(const fcsl_channel_table_t *table, fcsl_message_kind_t kind, size_t size)
{
    const uint8_t *bytes = memory + (LARGEST - size);
    fcsl_message_t message = {.bytes = bytes, .size = size, .kind = kind};
    fcsl_message_entry_t entry = {0};
    any_bytes(memory, sizeof memory);
    if (fcsl_message_check(table, kind, bytes, size, &message) != FCSL_MESSAGE_OK) {
        return;
    }
    any_bytes(memory, sizeof memory);
    fcsl_message_apply(&MACHINE, &received, &message);
    check_gaps();
    while (fcsl_message_next(&MACHINE, &message, &entry) != 0) {
        //@ assert entry.channel < CHANNEL_COUNT;
    }
}

/* Any data, any choice of sensors, into memory of any size. */
static void encode(const fcsl_channel_table_t *table, size_t capacity)
{
    uint8_t select[CHANNEL_COUNT];
    uint8_t *bytes = memory + (LARGEST - capacity);
    fcsl_message_t message = {0};
    any_bytes((uint8_t *)&data, sizeof data);
    any_bytes(select, sizeof select);
    (void)fcsl_message_encode_sensors(table, &data, any_u32, select, bytes, capacity, &message);
    (void)fcsl_message_encode_actuators(table, &data, any_u32, any_u8, bytes, capacity, &message);
    (void)fcsl_message_encode_time(table, any_u32, any_u32, bytes, capacity, &message);
}

/* From any state that a decoder may be in, any bytes lead to such a state again: so a stream may have any length. */
static void decode_stream(size_t count)
{
    static fcsl_cobs_decoder_t decoder;
    static uint8_t chunk[STREAM_MAX];
    size_t size = 0;
    any_bytes(chunk, sizeof chunk);
    any_bytes(decoder.frame, sizeof decoder.frame);
    decoder.size = any_u32 % (FCSL_LINK_FRAME_MAX + 1u);
    decoder.left = any_u8;
    decoder.zero = any_u8 % 2u;
    decoder.refused = any_u8 % 2u;
    decoder.garbage = any_u32;
    const size_t taken = fcsl_cobs_decode(&decoder, chunk + (STREAM_MAX - count), count, &size);
    //@ assert decoder.size <= FCSL_LINK_FRAME_MAX;
    //@ assert decoder.zero <= 1;
    //@ assert decoder.refused <= 1;
    //@ assert size <= FCSL_LINK_FRAME_MAX;
    //@ assert taken <= count;
}

static void frames(size_t size)
{
    static uint8_t frame[FCSL_LINK_FRAME_MAX];
    static uint8_t bytes[FCSL_COBS_BYTES_MAX];
    fcsl_link_header_t header = {.kind = FCSL_LINK_HELLO};
    const uint8_t *payload = frame;
    size_t payload_size = 0;
    any_bytes(frame, sizeof frame);
    const uint8_t *at = frame + (FCSL_LINK_FRAME_MAX - size);
    (void)fcsl_cobs_encode(at, size, bytes);
    (void)fcsl_link_frame_read(at, size, &header, &payload, &payload_size);
}

int main(void)
{
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    for (size_t size = SMALLEST; size <= LARGEST; size++) {
        receive(&table, FCSL_SENSOR_MESSAGE, size);
        receive(&table, FCSL_ACTUATOR_MESSAGE, size);
        receive(&table, FCSL_TIME_MESSAGE, size);
        encode(&table, size);
        frames(size);
    }
    for (size_t count = 0; count <= STREAM_MAX; count++) {
        decode_stream(count);
    }
    frames(FCSL_LINK_FRAME_MAX);
    return 0;
}
