/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_codec.h: channel frames. Input: how, then the frame. Bit 0 of how puts head and checksum right, bit 1 says for which
 * direction. What is accepted is encoded again to a frame that says the same.
 */
#include "channel_fixture.h"
#include "frames.h"
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
    fcsl_put_u32(frame + 16, fcsl_channel_table(&MACHINE).hash);
    fcsl_put_u16(frame + 22, 0);
    fcsl_put_u32(frame + size - CRC_BYTES, fcsl_crc32(0, frame, size - CRC_BYTES));
}

static void check_accepted(const fcsl_frame_t *frame, const data_t *decoded)
{
    const fcsl_direction_t direction = frame->direction;
    const size_t size = frame->size;
    const uint64_t tick = frame->tick;
    uint8_t select[CHANNEL_COUNT] = {0};
    fcsl_frame_entry_t entry = {0};
    while (fcsl_frame_next(&MACHINE, frame, &entry)) {
        FUZZ_CHECK(entry.channel < CHANNEL_COUNT && select[entry.channel] == 0);
        FUZZ_CHECK(entry.payload >= frame->bytes && entry.payload + entry.size <= frame->bytes + size - CRC_BYTES);
        select[entry.channel] = 1;
    }
    uint8_t *again = malloc(size);
    FUZZ_CHECK(again != NULL && encode_frame(&MACHINE, decoded, direction, tick, select, again, size - 1u) == 0);
    FUZZ_CHECK(encode_frame(&MACHINE, decoded, direction, tick, select, again, size) == size);
    data_t twice;
    uint64_t tick_again = 0;
    memset(&twice, MISSING, sizeof twice);
    FUZZ_CHECK(decode_frame(&MACHINE, &twice, direction, again, size, &tick_again) == FCSL_FRAME_OK);
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
    data_t after;
    memset(&after, MISSING, sizeof after);
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    fcsl_frame_t accepted;
    const fcsl_frame_status_t checked = fcsl_frame_check(&table, direction, frame, length, &accepted);
    FUZZ_CHECK(fcsl_frame_status_text(checked)[0] != '\0');
    if (checked == FCSL_FRAME_OK) {
        FUZZ_CHECK(accepted.bytes == frame && accepted.size == length && accepted.direction == direction);
        fcsl_frame_apply(&MACHINE, &after, &accepted);
        check_accepted(&accepted, &after);
    }
    free(frame);
    return 0;
}
