/* SPDX-License-Identifier: Apache-2.0
 *
 * Properties of messages: what goes in comes out, and nothing but a valid message changes anything. What the bytes are, the
 * Python implementation checks (simclient/test/test_message_peer.py).
 */
#include <string.h>

#include "channel_fixture.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl_check.h"
#include "messages.h"

enum { PACKET_BYTES = 5, REPLY_BYTES = 2 };
enum { MESSAGE_BYTES = 1024, ROUNDS = 2000, HEAD_BYTES = 18, ARMED_AT = 21, TIME_AT = 21, CRC_BYTES = 7 };

static const fcsl_message_kind_t KINDS[] = {FCSL_SENSOR_MESSAGE, FCSL_ACTUATOR_MESSAGE, FCSL_TIME_MESSAGE};

static uint64_t random_state = 1;

static uint64_t random_u64(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

/* A blob of any bytes, up to the capacity. */
static void fill_blob(uint32_t *blob, uint32_t capacity)
{
    blob[0] = (uint32_t)(random_u64() % (capacity + 1u));
    for (uint32_t i = 1; i <= capacity; i++) {
        blob[i] = i <= blob[0] ? (uint8_t)random_u64() : 0u;
    }
}

/* Any bits in every field, but valid ones where a type has invalid bits. */
static void fill(data_t *data)
{
    uint8_t *bytes = (uint8_t *)data;
    memset(data, 0, sizeof *data);
    for (uint32_t i = 0; i < FIELD_COUNT; i++) {
        const fcsl_field_t *field = &FIELDS[i];
        for (uint32_t j = 0; j < field->size; j++) {
            bytes[field->offset + j] = field->type == FCSL_BOOL ? random_u64() & 1u : (uint8_t)random_u64();
        }
    }
    data->health = (int32_t)(random_u64() % 4u);
    fill_blob(data->packet, PACKET_BYTES);
    fill_blob(data->reply, REPLY_BYTES);
}

static int is_fresh(const data_t *data, uint32_t channel)
{
    return ((const uint8_t *)data)[CHANNELS[channel].fresh_offset];
}

/* What a message brings has no age and no stamp; what it does not bring keeps them. */
static int is_of_now(const data_t *data, const data_t *before, uint32_t channel, int carried)
{
    static const uint8_t zero[8] = {0};
    const fcsl_channel_t *sensor = &CHANNELS[channel];
    const uint8_t *now = (const uint8_t *)data;
    const uint8_t *then = (const uint8_t *)before;
    return memcmp(now + sensor->sample_age_offset, carried ? zero : then + sensor->sample_age_offset, 4) == 0 &&
           memcmp(now + sensor->stamp_offset, carried ? zero : then + sensor->stamp_offset, 8) == 0;
}

/* Equal once NaNs are canonical. */
static int same_field(const data_t *a, const data_t *b, const fcsl_field_t *field)
{
    uint8_t left[128];
    uint8_t right[128];
    fcsl_scalars_export(left, (const uint8_t *)a + field->offset, field->type, field->count);
    fcsl_scalars_export(right, (const uint8_t *)b + field->offset, field->type, field->count);
    return memcmp(left, right, field->size) == 0;
}

static void test_crc(void)
{
    CHECK(fcsl_crc32(0, "123456789", 9) == 0xcbf43926u);
    CHECK(fcsl_crc32(fcsl_crc32(0, "1234", 4), "56789", 5) == 0xcbf43926u);
    CHECK(fcsl_crc32(0, "", 0) == 0);
}

static fcsl_direction_t direction_of(fcsl_message_kind_t kind)
{
    return kind == FCSL_SENSOR_MESSAGE ? FCSL_SENSOR : FCSL_ACTUATOR;
}

static void test_round_trip(void)
{
    uint8_t message[MESSAGE_BYTES];
    for (int round = 0; round < ROUNDS; round++) {
        data_t sent;
        data_t received;
        uint8_t select[CHANNEL_COUNT];
        fill(&sent);
        fill(&received);
        memset(received.fresh, 0, sizeof received.fresh);
        const data_t before = received;
        const fcsl_message_kind_t kind = KINDS[round % 3];
        for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
            select[i] = kind == FCSL_ACTUATOR_MESSAGE || (random_u64() & 1u);
        }
        const uint64_t tick = random_u64();
        const size_t size = encode_message(&MACHINE, &sent, kind, tick, select, message, sizeof message);
        CHECK(size > 0 && size <= fcsl_message_capacity(&MACHINE, kind));
        uint64_t got = 0;
        CHECK(decode_message(&MACHINE, &received, kind, message, size, &got) == FCSL_MESSAGE_OK);
        CHECK(got == tick);
        for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
            const int carried =
                kind != FCSL_TIME_MESSAGE && select[i] != 0 && CHANNELS[i].direction == direction_of(kind);
            CHECK(same_field(&received, carried ? &sent : &before, &FIELDS[CHANNELS[i].field]));
            if (CHANNELS[i].direction == FCSL_SENSOR) {
                CHECK(is_fresh(&received, i) == (carried && kind == FCSL_SENSOR_MESSAGE));
                CHECK(is_of_now(&received, &before, i, carried));
            }
        }
    }
}

static void test_room(void)
{
    uint8_t message[MESSAGE_BYTES];
    data_t data;
    fill(&data);
    data.packet[0] = PACKET_BYTES;
    data.reply[0] = REPLY_BYTES;
    for (size_t i = 0; i < 3; i++) {
        const size_t size = encode_message(&MACHINE, &data, KINDS[i], 3, NULL, message, sizeof message);
        CHECK(size + FCSL_UNKNOWN_BYTES == fcsl_message_capacity(&MACHINE, KINDS[i]));
        for (size_t less = 0; less < size; less++) {
            CHECK(encode_message(&MACHINE, &data, KINDS[i], 3, NULL, message, less) == 0);
        }
        CHECK(encode_message(&MACHINE, &data, KINDS[i], 3, NULL, message, size) == size);
    }
}

/* What a machine must never see, such as a bool of 2 that a plant model has written, is in no message. */
static void test_impossible_values(void)
{
    uint8_t bytes[MESSAGE_BYTES];
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    fcsl_message_t message = {.size = 77};
    data_t data;
    fill(&data);
    data.flag = 2;
    CHECK(fcsl_message_encode_sensors(&table, &data, 1, NULL, bytes, sizeof bytes, &message) == FCSL_MESSAGE_VALUE);
    data.flag = 1;
    data.health = 4;
    CHECK(fcsl_message_encode_sensors(&table, &data, 1, NULL, bytes, sizeof bytes, &message) == FCSL_MESSAGE_VALUE);
    CHECK(message.size == 77);
    data.health = 3;
    CHECK(fcsl_message_encode_sensors(&table, &data, 1, NULL, bytes, sizeof bytes, &message) == FCSL_MESSAGE_OK);
    CHECK(message.bytes == bytes && message.tick == 1 && message.kind == FCSL_SENSOR_MESSAGE);
}

/* Every content of a blob's field is one: of a number above the capacity the capacity counts, of an element its lower byte. */
static void test_blobs_of_any_content(void)
{
    static const uint32_t expected[] = {PACKET_BYTES, 0xff, 0, 1, 0x80, 0x34};
    const uint32_t content[] = {UINT32_MAX, 0xffu, 0x100u, 0x101u, 0x80u, 0x1234u};
    uint8_t bytes[MESSAGE_BYTES];
    data_t data;
    data_t received;
    uint64_t tick = 0;
    fill(&data);
    fill(&received);
    memcpy(data.packet, content, sizeof content);
    const size_t size = encode_message(&MACHINE, &data, FCSL_SENSOR_MESSAGE, 1, NULL, bytes, sizeof bytes);
    CHECK(decode_message(&MACHINE, &received, FCSL_SENSOR_MESSAGE, bytes, size, &tick) == FCSL_MESSAGE_OK);
    CHECK(memcmp(received.packet, expected, sizeof expected) == 0);
}

static void seal(uint8_t *message, size_t size)
{
    fcsl_put_u32(message + size - 4, fcsl_crc32(0, message, size - 4));
}

/* Refused, and not one byte of the data or of *tick has changed. FCSL_MESSAGE_OK expects any refusal. */
static void check_refused(fcsl_message_kind_t kind, const uint8_t *message, size_t size, fcsl_message_status_t expected)
{
    data_t data;
    uint64_t tick = 77;
    random_state = 99;
    fill(&data);
    memset(data.fresh, 0, sizeof data.fresh);
    const data_t before = data;
    const fcsl_message_status_t status = decode_message(&MACHINE, &data, kind, message, size, &tick);
    CHECK(status != FCSL_MESSAGE_OK && (expected == FCSL_MESSAGE_OK || status == expected));
    CHECK(memcmp(&before, &data, sizeof data) == 0 && tick == 77);
    CHECK(fcsl_message_status_text(status)[0] != '\0');
}

static void test_damage(void)
{
    uint8_t message[MESSAGE_BYTES];
    uint8_t damaged[MESSAGE_BYTES];
    data_t data;
    fill(&data);
    for (size_t i = 0; i < 3; i++) {
        const size_t size = encode_message(&MACHINE, &data, KINDS[i], 5, NULL, message, sizeof message);
        for (size_t cut = 0; cut < size; cut++) {
            check_refused(KINDS[i], message, cut, FCSL_MESSAGE_OK);
        }
        memcpy(damaged, message, size);
        damaged[size] = 0;
        check_refused(KINDS[i], damaged, size + 1, FCSL_MESSAGE_SHORT);
        for (size_t bit = 0; bit < 8 * size; bit++) {
            memcpy(damaged, message, size);
            damaged[bit / 8] ^= (uint8_t)(1u << bit % 8);
            check_refused(KINDS[i], damaged, size, FCSL_MESSAGE_OK);
        }
        for (size_t other = 0; other < 3; other++) {
            if (other != i) {
                check_refused(KINDS[other], message, size, size < 29 ? FCSL_MESSAGE_OK : FCSL_MESSAGE_KIND);
            }
        }
    }
}

/* A message of which one byte is another one, with a right checksum. */
static void check_changed(fcsl_message_kind_t kind, size_t at, uint8_t value, fcsl_message_status_t status)
{
    uint8_t message[MESSAGE_BYTES];
    data_t data;
    fill(&data);
    const size_t size = encode_message(&MACHINE, &data, kind, 5, NULL, message, sizeof message);
    CHECK(message[at] != value);
    message[at] = value;
    seal(message, size);
    check_refused(kind, message, size, status);
}

/* Messages whose checksum is right and whose content is not. */
static void test_wrong_content(void)
{
    const fcsl_message_kind_t sensors = FCSL_SENSOR_MESSAGE;
    const uint8_t other = (uint8_t)(fcsl_channel_table(&MACHINE).hash + 1u);
    check_changed(sensors, 0, 9, FCSL_MESSAGE_KIND);
    check_changed(sensors, 2, FCSL_I64, FCSL_MESSAGE_KIND);
    check_changed(sensors, 11, 9, FCSL_MESSAGE_ENTRY);
    check_changed(sensors, 14, other, FCSL_MESSAGE_TABLE);
    check_changed(FCSL_ACTUATOR_MESSAGE, 18, 5, FCSL_MESSAGE_ENTRY);
    check_changed(FCSL_ACTUATOR_MESSAGE, ARMED_AT, 2, FCSL_MESSAGE_VALUE);
    check_changed(FCSL_TIME_MESSAGE, 18, 4, FCSL_MESSAGE_ENTRY);
    /* The first entry: channel 900, a bool. */
    check_changed(sensors, HEAD_BYTES + 2, 7, FCSL_MESSAGE_TYPE);
    check_changed(sensors, HEAD_BYTES + 2, 0x50, FCSL_MESSAGE_TYPE);
    check_changed(sensors, HEAD_BYTES + 2, 0x41, FCSL_MESSAGE_TYPE);
    check_changed(sensors, HEAD_BYTES + 3, 2, FCSL_MESSAGE_VALUE);
    /* The second one: channel 800, a vector of i32; then 700, an i64. */
    check_changed(sensors, HEAD_BYTES + 6, 0x15, FCSL_MESSAGE_TYPE);
    check_changed(sensors, HEAD_BYTES + 6, 0x21, FCSL_MESSAGE_OK);
}

/* Writes head and end of a sensor message around the `size` bytes of entries at its offset 18; returns its size. */
static size_t close_message(uint8_t *message, size_t size)
{
    uint8_t nothing[CHANNEL_COUNT] = {0};
    data_t data;
    uint8_t whole[MESSAGE_BYTES];
    memset(&data, 0, sizeof data);
    CHECK(encode_message(&MACHINE, &data, FCSL_SENSOR_MESSAGE, 5, nothing, whole, sizeof whole) ==
          HEAD_BYTES + CRC_BYTES);
    memcpy(message, whole, HEAD_BYTES);
    memcpy(message + HEAD_BYTES + size, whole + HEAD_BYTES, CRC_BYTES);
    seal(message, HEAD_BYTES + size + CRC_BYTES);
    return HEAD_BYTES + size + CRC_BYTES;
}

typedef struct {
    const uint8_t *bytes;
    size_t size;
    fcsl_message_status_t status;
    uint32_t skipped;
} entries_case_t;

#define ENTRIES(status_, skipped_, ...)                                                                                \
    {(const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__}), status_, skipped_}
#define FLAG 0x84, 3, 0, 1                         /* channel 900 */
#define U32  0xff, 0xfe, 3, 1, 2, 3, 4              /* channel 65279 */
#define U64  0xf4, 1, 0x34, 2, 0, 1, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0 /* channel 500 */

/* Entries in any order, of unknown ids, and wrong ones. */
static void test_entries(void)
{
    const entries_case_t cases[] = {
        ENTRIES(FCSL_MESSAGE_OK, 0, FLAG),
        ENTRIES(FCSL_MESSAGE_OK, 0, U64, FLAG, U32),
        ENTRIES(FCSL_MESSAGE_OK, 0, U32, U64, FLAG),
        ENTRIES(FCSL_MESSAGE_OK, 1, 7, 0, 0x26, [34] = 0, FLAG), /* an unknown quaternion of f64 */
        ENTRIES(FCSL_MESSAGE_OK, 4, 7, 0, 0, 9, U64, 8, 0, 0x40, 2, 0, 'h', 'i', 7, 0, 0x31, 0, 0, 6, 0xff, 0, 1),
        ENTRIES(FCSL_MESSAGE_ENTRY, 0, FLAG, FLAG),
        ENTRIES(FCSL_MESSAGE_ENTRY, 0, U64, U32, U64),
        ENTRIES(FCSL_MESSAGE_ENTRY, 0, U64, FLAG, U32, FLAG),
        ENTRIES(FCSL_MESSAGE_ENTRY, 0, 2, 0, 0x10, 1, 1, 1),                     /* an actuator's */
        ENTRIES(FCSL_MESSAGE_ENTRY, 0, FLAG, 3, 0xff, 3, 0, 0, 0, 0),            /* a second hash */
        ENTRIES(FCSL_MESSAGE_ENTRY, 0, FLAG, 5, 0xff, 4, 0, 0, 0, 0, 0, 0, 0, 0), /* a time */
        ENTRIES(FCSL_MESSAGE_ENTRY, 0, 0xff, 0xff, 3, 0, 0, 0, 0),
        ENTRIES(FCSL_MESSAGE_TYPE, 0, 0xf4, 1, 0x34, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0), /* fewer elements */
        ENTRIES(FCSL_MESSAGE_TYPE, 0, 0xff, 0xfe, 1, 1, 2, 3, 4),                   /* an i32 */
        ENTRIES(FCSL_MESSAGE_TYPE, 0, FLAG, 7, 0, 0x0f, 1),
        ENTRIES(FCSL_MESSAGE_TYPE, 0, FLAG, 7, 0, 0x46, 1, 0, 1),
        ENTRIES(FCSL_MESSAGE_OK, 0, 150, 0, 0x40, 0, 0),                   /* an empty blob */
        ENTRIES(FCSL_MESSAGE_OK, 0, 150, 0, 0x40, 5, 0, 1, 2, 3, 4, 0xff),    /* one that is full */
        ENTRIES(FCSL_MESSAGE_TYPE, 0, 150, 0, 0x40, 6, 0, 1, 2, 3, 4, 5, 6),  /* one that is too long */
        ENTRIES(FCSL_MESSAGE_TYPE, 0, 150, 0, 0x33, 1, 0, 1, 2, 3, 4),        /* not a blob */
        ENTRIES(FCSL_MESSAGE_TYPE, 0, 0, 0, 0x35, 4, 0, [20] = 0),            /* not a quaternion */
        ENTRIES(FCSL_MESSAGE_OK, 0, 0, 0, 0x25, [3] = 1, [18] = 0),
        ENTRIES(FCSL_MESSAGE_OK, 1, 0, 0, 0x25, [18] = 0),              /* a quaternion of length zero */
        ENTRIES(FCSL_MESSAGE_OK, 1, 0, 0, 0x25, [6] = 0x80, [18] = 0x80), /* of two negative zeros */
        ENTRIES(FCSL_MESSAGE_OK, 0, 0, 0, 0x25, [6] = 0x80, [18] = 0x81),
        ENTRIES(FCSL_MESSAGE_SHORT, 0, 150, 0, 0x40, 3, 0, 1, 2),
        ENTRIES(FCSL_MESSAGE_SHORT, 0, FLAG, 7),
        ENTRIES(FCSL_MESSAGE_SHORT, 0, FLAG, 7, 0, 4, 1, 2, 3, 4, 5, 6, 7),
        ENTRIES(FCSL_MESSAGE_SHORT, 0, FLAG, 7, 0, 0x36, 1),
        ENTRIES(FCSL_MESSAGE_SHORT, 0, FLAG, 7, 0, 0x40, 0xff, 0xff, 1),
        ENTRIES(FCSL_MESSAGE_VALUE, 0, U64, 0x84, 3, 0, 2),
        ENTRIES(FCSL_MESSAGE_VALUE, 0, 200, 0, 1, 4, 0, 0, 0), /* a health that does not exist */
    };
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        uint8_t bytes[MESSAGE_BYTES];
        memcpy(bytes + HEAD_BYTES, cases[i].bytes, cases[i].size);
        const size_t size = close_message(bytes, cases[i].size);
        fcsl_message_t message;
        const fcsl_message_status_t status = fcsl_message_check(&table, FCSL_SENSOR_MESSAGE, bytes, size, &message);
        CHECK(status == cases[i].status);
        CHECK(status != FCSL_MESSAGE_OK || message.skipped == cases[i].skipped);
        if (status != FCSL_MESSAGE_OK) {
            check_refused(FCSL_SENSOR_MESSAGE, bytes, size, status);
        }
    }
}

/* In another order an entry has the same meaning. */
static void test_order(void)
{
    static const uint8_t entries[] = {U32, U64, FLAG};
    uint8_t bytes[MESSAGE_BYTES];
    data_t data;
    uint64_t tick = 0;
    memset(&data, 0, sizeof data);
    memcpy(bytes + HEAD_BYTES, entries, sizeof entries);
    const size_t size = close_message(bytes, sizeof entries);
    CHECK(decode_message(&MACHINE, &data, FCSL_SENSOR_MESSAGE, bytes, size, &tick) == FCSL_MESSAGE_OK && tick == 5);
    CHECK(data.u32 == 0x04030201u && data.flag == 1 && data.u64[0] == 1 && data.u64[1] == 2);
    CHECK(is_fresh(&data, 0) && is_fresh(&data, 4) && is_fresh(&data, 5) && !is_fresh(&data, 3));
}

/* A command that lacks an actuator would leave it where it is: it is refused. */
static void test_all_actuators(void)
{
    uint8_t message[MESSAGE_BYTES];
    data_t data;
    fill(&data);
    const size_t size = encode_message(&MACHINE, &data, FCSL_ACTUATOR_MESSAGE, 5, NULL, message, sizeof message);
    const size_t last = 5u + data.reply[0]; /* a blob */
    memmove(message + size - CRC_BYTES - last, message + size - CRC_BYTES, CRC_BYTES);
    seal(message, size - last);
    check_refused(FCSL_ACTUATOR_MESSAGE, message, size - last, FCSL_MESSAGE_ENTRY);
}

static void test_armed_and_time(void)
{
    uint8_t bytes[MESSAGE_BYTES];
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    fcsl_message_t message = {0};
    data_t data;
    fill(&data);
    for (int armed = 0; armed < 3; armed++) {
        CHECK(fcsl_message_encode_actuators(&table, &data, 1, armed, bytes, sizeof bytes, &message) == FCSL_MESSAGE_OK);
        CHECK(message.armed == (armed != 0) && bytes[ARMED_AT] == (armed != 0));
        message.armed = 9;
        CHECK(fcsl_message_check(&table, FCSL_ACTUATOR_MESSAGE, bytes, message.size, &message) == FCSL_MESSAGE_OK);
        CHECK(message.armed == (armed != 0) && message.time_ns == 0 && message.skipped == 0);
    }
    CHECK(fcsl_message_encode_time(&table, 7, UINT64_MAX - 1u, bytes, sizeof bytes, &message) == FCSL_MESSAGE_OK);
    CHECK(fcsl_message_check(&table, FCSL_TIME_MESSAGE, bytes, message.size, &message) == FCSL_MESSAGE_OK);
    CHECK(message.tick == 7 && message.time_ns == UINT64_MAX - 1u && message.armed == 0);
    CHECK(fcsl_get_u64(bytes + TIME_AT) == UINT64_MAX - 1u);
}

static void test_nan_is_canonical(void)
{
    uint8_t message[MESSAGE_BYTES];
    uint8_t other[MESSAGE_BYTES];
    data_t a;
    memset(&a, 0, sizeof a);
    data_t b = a;
    const uint64_t quiet = UINT64_C(0x7ff8000000000000);
    const uint64_t strange = UINT64_C(0xfff0000000000001);
    const uint32_t strange32 = 0xff800001u;
    const uint32_t quiet32 = 0x7fc00000u;
    memcpy(&a.f64[2], &quiet, 8);
    memcpy(&b.f64[2], &strange, 8);
    memcpy(&a.f32[1], &quiet32, 4);
    memcpy(&b.f32[1], &strange32, 4);
    const size_t size = encode_message(&MACHINE, &a, FCSL_SENSOR_MESSAGE, 1, NULL, message, sizeof message);
    CHECK(encode_message(&MACHINE, &b, FCSL_SENSOR_MESSAGE, 1, NULL, other, sizeof other) == size);
    CHECK(memcmp(message, other, size) == 0);
}

static void test_table_hash(void)
{
    fcsl_channel_t channels[CHANNEL_COUNT];
    fcsl_machine_t machine = MACHINE;
    machine.channels = channels;
    const uint32_t hash = fcsl_channel_table(&MACHINE).hash;
    memcpy(channels, CHANNELS, sizeof channels);
    CHECK(fcsl_channel_table(&machine).hash == hash);
    channels[3].id++;
    CHECK(fcsl_channel_table(&machine).hash != hash);
    memcpy(channels, CHANNELS, sizeof channels);
    channels[3].field = 1;
    CHECK(fcsl_channel_table(&machine).hash != hash);
    memcpy(channels, CHANNELS, sizeof channels);
    channels[6].as = FCSL_AS_FIELD; /* not a quaternion */
    CHECK(fcsl_channel_table(&machine).hash != hash);
    memcpy(channels, CHANNELS, sizeof channels);
    channels[3].name = "renamed";
    CHECK(fcsl_channel_table(&machine).hash == hash);
}

int main(void)
{
    test_crc();
    test_round_trip();
    test_room();
    test_impossible_values();
    test_blobs_of_any_content();
    test_damage();
    test_wrong_content();
    test_entries();
    test_order();
    test_all_actuators();
    test_armed_and_time();
    test_nan_is_canonical();
    test_table_hash();
    return 0;
}
