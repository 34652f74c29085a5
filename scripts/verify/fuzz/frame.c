/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_codec.h: channel frames. Input: how, then the frame. Bit 0 of how puts head and checksum right, bit 1 says for which
 * direction. What is refused changes nothing; what is accepted is encoded again to a frame that says the same.
 */
#include "channel_fixture.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"
#include "fuzz.h"

enum { HEAD_BYTES = 24, CRC_BYTES = 4, MISSING = 0xa5 };

static void repair(uint8_t *frame, size_t size, fcsl_direction_t direction)
{
    if (size < HEAD_BYTES + CRC_BYTES) {
        return;
    }
    memcpy(frame, "FCSF\1\0", 6);
    frame[6] = (uint8_t)direction;
    frame[7] = 0;
    fcsl_put_u32(frame + 16, fcsl_channel_table_hash(&MACHINE));
    fcsl_put_u16(frame + 22, 0);
    fcsl_put_u32(frame + size - CRC_BYTES, fcsl_crc32(0, frame, size - CRC_BYTES));
}

static void check_accepted(fcsl_direction_t direction, const uint8_t *frame, size_t size, uint64_t tick,
                           const data_t *decoded)
{
    uint8_t select[CHANNEL_COUNT] = {0};
    fcsl_frame_entry_t entry = {0};
    while (fcsl_frame_next(&MACHINE, frame, &entry)) {
        FUZZ_CHECK(entry.channel < CHANNEL_COUNT && select[entry.channel] == 0);
        FUZZ_CHECK(entry.payload >= frame && entry.payload + entry.size <= frame + size - CRC_BYTES);
        select[entry.channel] = 1;
    }
    uint8_t *again = malloc(size);
    FUZZ_CHECK(again != NULL && fcsl_frame_encode(&MACHINE, decoded, direction, tick, select, again, size - 1u) == 0);
    FUZZ_CHECK(fcsl_frame_encode(&MACHINE, decoded, direction, tick, select, again, size) == size);
    data_t twice;
    uint64_t tick_again = 0;
    memset(&twice, MISSING, sizeof twice);
    FUZZ_CHECK(fcsl_frame_decode(&MACHINE, &twice, direction, again, size, &tick_again) == FCSL_FRAME_OK);
    FUZZ_CHECK(tick_again == tick && memcmp(&twice, decoded, sizeof twice) == 0);
    free(again);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    const uint64_t how = take_number(&bytes, 1);
    const fcsl_direction_t direction = (how & 2u) != 0 ? FCSL_ACTUATOR : FCSL_SENSOR;
    size_t length = bytes.left;
    uint8_t *frame = take_copy(&bytes, &length);
    if ((how & 1u) != 0) {
        repair(frame, length, direction);
    }
    data_t before;
    data_t after;
    memset(&before, MISSING, sizeof before);
    memset(&after, MISSING, sizeof after);
    uint64_t tick = 0;
    const fcsl_frame_status_t checked = fcsl_frame_check(&MACHINE, direction, frame, length, &tick);
    FUZZ_CHECK(fcsl_frame_decode(&MACHINE, &after, direction, frame, length, &tick) == checked);
    FUZZ_CHECK(fcsl_frame_status_text(checked)[0] != '\0');
    if (checked == FCSL_FRAME_OK) {
        check_accepted(direction, frame, length, tick, &after);
    } else {
        FUZZ_CHECK(memcmp(&before, &after, sizeof before) == 0);
    }
    free(frame);
    return 0;
}
