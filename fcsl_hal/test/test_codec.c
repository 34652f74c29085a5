/* SPDX-License-Identifier: Apache-2.0
 *
 * Properties of channel frames: what goes in comes out, and nothing but a valid frame changes anything.
 */
#include <string.h>

#include "channel_fixture.h"
#include "frames.h"
#include "fcsl/fcsl_check.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"

enum { FRAME_BYTES = 512, ROUNDS = 2000 };

static uint64_t random_state = 1;

static uint64_t random_u64(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
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
}

static int is_fresh(const data_t *data, uint32_t channel)
{
    return ((const uint8_t *)data)[CHANNELS[channel].fresh_offset];
}

/* What a frame brings has no age and no stamp; what it does not bring keeps them. */
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

static void test_round_trip(void)
{
    uint8_t frame[FRAME_BYTES];
    for (int round = 0; round < ROUNDS; round++) {
        data_t sent;
        data_t received;
        uint8_t select[CHANNEL_COUNT];
        fill(&sent);
        fill(&received);
        memset(received.fresh, 0, sizeof received.fresh);
        const data_t before = received;
        for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
            select[i] = random_u64() & 1u;
        }
        const fcsl_direction_t direction = round % 2 == 0 ? FCSL_SENSOR : FCSL_ACTUATOR;
        const uint64_t tick = random_u64();
        const size_t size = encode_frame(&MACHINE, &sent, direction, tick, select, frame, sizeof frame);
        CHECK(size > 0 && size <= fcsl_frame_capacity(&MACHINE, direction));
        uint64_t got = 0;
        CHECK(decode_frame(&MACHINE, &received, direction, frame, size, &got) == FCSL_FRAME_OK);
        CHECK(got == tick);
        for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
            const int carried = select[i] != 0 && CHANNELS[i].direction == (uint8_t)direction;
            CHECK(same_field(&received, carried ? &sent : &before, &FIELDS[CHANNELS[i].field]));
            if (CHANNELS[i].direction == FCSL_SENSOR) {
                CHECK(is_fresh(&received, i) == (carried && direction == FCSL_SENSOR));
                CHECK(is_of_now(&received, &before, i, carried));
            }
        }
    }
}

static void test_all_fit_exactly(void)
{
    uint8_t frame[FRAME_BYTES];
    data_t data;
    fill(&data);
    for (int direction = FCSL_SENSOR; direction <= FCSL_ACTUATOR; direction++) {
        const size_t capacity = fcsl_frame_capacity(&MACHINE, (fcsl_direction_t)direction);
        CHECK(encode_frame(&MACHINE, &data, (fcsl_direction_t)direction, 3, NULL, frame, capacity) == capacity);
        for (size_t less = 0; less < capacity; less++) {
            CHECK(encode_frame(&MACHINE, &data, (fcsl_direction_t)direction, 3, NULL, frame, less) == 0);
        }
    }
}

/* What a machine must never see, such as a bool of 2 that a plant model has written, is in no frame. */
static void test_impossible_values(void)
{
    uint8_t bytes[FRAME_BYTES];
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    fcsl_frame_t frame = {.size = 77};
    data_t data;
    fill(&data);
    data.flag = 2;
    CHECK(fcsl_frame_encode(&table, &data, FCSL_SENSOR, 1, NULL, bytes, sizeof bytes, &frame) == FCSL_FRAME_VALUE);
    data.flag = 1;
    data.health = 4;
    CHECK(fcsl_frame_encode(&table, &data, FCSL_SENSOR, 1, NULL, bytes, sizeof bytes, &frame) == FCSL_FRAME_VALUE);
    CHECK(frame.size == 77);
    data.health = 3;
    CHECK(fcsl_frame_encode(&table, &data, FCSL_SENSOR, 1, NULL, bytes, sizeof bytes, &frame) == FCSL_FRAME_OK);
    CHECK(frame.bytes == bytes && frame.tick == 1 && frame.direction == FCSL_SENSOR);
}

/* Refused, and not one byte of the data or of *tick has changed. */
static void check_refused(const uint8_t *frame, size_t size, fcsl_frame_status_t expected)
{
    data_t data;
    uint64_t tick = 77;
    random_state = 99;
    fill(&data);
    memset(data.fresh, 0, sizeof data.fresh);
    const data_t before = data;
    const fcsl_frame_status_t status = decode_frame(&MACHINE, &data, FCSL_SENSOR, frame, size, &tick);
    CHECK(status != FCSL_FRAME_OK && (expected == FCSL_FRAME_OK || status == expected));
    CHECK(memcmp(&before, &data, sizeof data) == 0 && tick == 77);
    CHECK(fcsl_frame_status_text(status)[0] != '\0');
}

static void seal(uint8_t *frame, size_t size)
{
    fcsl_put_u32(frame + size - 4, fcsl_crc32(0, frame, size - 4));
}

static void test_damage(void)
{
    uint8_t frame[FRAME_BYTES];
    uint8_t damaged[FRAME_BYTES];
    data_t data;
    fill(&data);
    const size_t size = encode_frame(&MACHINE, &data, FCSL_SENSOR, 5, NULL, frame, sizeof frame);
    for (size_t cut = 0; cut < size; cut++) {
        check_refused(frame, cut, FCSL_FRAME_OK);
    }
    memcpy(damaged, frame, size);
    damaged[size] = 0;
    check_refused(damaged, size + 1, FCSL_FRAME_CRC);
    for (size_t bit = 0; bit < 8 * size; bit++) {
        memcpy(damaged, frame, size);
        damaged[bit / 8] ^= (uint8_t)(1u << bit % 8);
        check_refused(damaged, size, FCSL_FRAME_OK);
    }
}

/* Frames whose checksum is right and whose content is not. */
static void test_wrong_content(void)
{
    uint8_t frame[FRAME_BYTES];
    uint8_t wrong[FRAME_BYTES];
    data_t data;
    fill(&data);
    const size_t size = encode_frame(&MACHINE, &data, FCSL_SENSOR, 5, NULL, frame, sizeof frame);
    const struct {
        size_t at;
        uint8_t value;
        fcsl_frame_status_t status;
    } cases[] = {
        {0, 'X', FCSL_FRAME_MAGIC},  {4, 2, FCSL_FRAME_MAGIC},    {6, FCSL_ACTUATOR, FCSL_FRAME_DIRECTION},
        {7, 1, FCSL_FRAME_MAGIC},    {22, 1, FCSL_FRAME_MAGIC},   {16, (uint8_t)(frame[16] + 1), FCSL_FRAME_TABLE},
        {20, 9, FCSL_FRAME_SHORT},   {20, 7, FCSL_FRAME_SHORT},   {24, 7, FCSL_FRAME_CHANNEL},
        {26, 2, FCSL_FRAME_CHANNEL}, {27, 255, FCSL_FRAME_SHORT}, {28, 2, FCSL_FRAME_VALUE},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        memcpy(wrong, frame, size);
        wrong[cases[i].at] = cases[i].value;
        seal(wrong, size);
        check_refused(wrong, size, cases[i].status);
    }
    /* The last entry is the health: an enumerator that does not exist. */
    memcpy(wrong, frame, size);
    wrong[size - 8] = 4;
    seal(wrong, size);
    check_refused(wrong, size, FCSL_FRAME_VALUE);
    /* Twice the same channel. */
    memcpy(wrong, frame, 24);
    memcpy(wrong + 24, frame + 24, 5);
    memcpy(wrong + 29, frame + 24, 5);
    wrong[20] = 2;
    seal(wrong, 38);
    check_refused(wrong, 38, FCSL_FRAME_CHANNEL);
}

static void test_nan_is_canonical(void)
{
    uint8_t frame[FRAME_BYTES];
    uint8_t other[FRAME_BYTES];
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
    const size_t size = encode_frame(&MACHINE, &a, FCSL_SENSOR, 1, NULL, frame, sizeof frame);
    CHECK(encode_frame(&MACHINE, &b, FCSL_SENSOR, 1, NULL, other, sizeof other) == size);
    CHECK(memcmp(frame, other, size) == 0);
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
    channels[3].name = "renamed";
    CHECK(fcsl_channel_table(&machine).hash == hash);
}

int main(void)
{
    test_crc();
    test_round_trip();
    test_all_fit_exactly();
    test_impossible_values();
    test_damage();
    test_wrong_content();
    test_nan_is_canonical();
    test_table_hash();
    return 0;
}
