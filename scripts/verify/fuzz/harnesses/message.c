/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_codec.h: messages of channels. Input: how, then the message. Bit 0 of how puts the reserved entries and the checksum
 * right, bits 1 and 2 say for which kind. What is accepted is encoded again to a message that says the same.
 */
#include "channel_fixture.h"
#include "messages.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"
#include "fuzz.h"

enum { TICK_AT = 3, CRC_BYTES = 7, ARMED_AT = 21, MISSING = 0xa5, ROOM = 512 };

static const size_t HEAD_BYTES[] = {18, 22, 29};

static void repair(uint8_t *bytes, size_t size, fcsl_message_kind_t kind)
{
    uint8_t right[ROOM];
    data_t data;
    memset(&data, 0, sizeof data);
    if (size < HEAD_BYTES[kind] + CRC_BYTES) {
        return;
    }
    const uint8_t armed = bytes[ARMED_AT];
    const uint64_t tick = fcsl_get_u64(bytes + TICK_AT);
    const size_t made = encode_message(&MACHINE, &data, kind, tick, NULL, right, sizeof right);
    FUZZ_CHECK(made > 0);
    memcpy(bytes, right, HEAD_BYTES[kind]);
    if (kind == FCSL_ACTUATOR_MESSAGE) {
        bytes[ARMED_AT] = armed;
    }
    memcpy(bytes + size - CRC_BYTES, right + made - CRC_BYTES, CRC_BYTES);
    fcsl_put_u32(bytes + size - 4, fcsl_crc32(0, bytes, size - 4));
}

static void check_accepted(const fcsl_message_t *message, const data_t *decoded)
{
    uint8_t select[CHANNEL_COUNT] = {0};
    fcsl_message_entry_t entry = {0};
    while (fcsl_message_next(&MACHINE, message, &entry)) {
        FUZZ_CHECK(entry.channel < CHANNEL_COUNT && select[entry.channel] == 0);
        FUZZ_CHECK(entry.end > HEAD_BYTES[message->kind] && entry.end <= message->size - CRC_BYTES);
        select[entry.channel] = 1;
    }
    FUZZ_CHECK(message->armed <= 1u && (message->armed == 0 || message->kind == FCSL_ACTUATOR_MESSAGE));
    uint8_t again[ROOM];
    const size_t size = encode_message(&MACHINE, decoded, message->kind, message->tick, select, again, sizeof again);
    FUZZ_CHECK(size > 0 && (message->skipped == 0 ? size == message->size : size < message->size));
    FUZZ_CHECK(encode_message(&MACHINE, decoded, message->kind, message->tick, select, again, size - 1u) == 0);
    data_t twice;
    uint64_t tick_again = 0;
    memset(&twice, MISSING, sizeof twice);
    FUZZ_CHECK(encode_message(&MACHINE, decoded, message->kind, message->tick, select, again, size) == size);
    FUZZ_CHECK(decode_message(&MACHINE, &twice, message->kind, again, size, &tick_again) == FCSL_MESSAGE_OK);
    FUZZ_CHECK(tick_again == message->tick && memcmp(&twice, decoded, sizeof twice) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    const uint64_t how = take_number(&bytes, 1);
    const fcsl_message_kind_t kind = (fcsl_message_kind_t)((how >> 1 & 3u) % 3u);
    size_t length = bytes.left;
    uint8_t *message = take_copy(&bytes, &length);
    if ((how & 1u) != 0) {
        repair(message, length, kind);
    }
    data_t after;
    memset(&after, MISSING, sizeof after);
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    fcsl_message_t accepted;
    const fcsl_message_status_t checked = fcsl_message_check(&table, kind, message, length, &accepted);
    FUZZ_CHECK(fcsl_message_status_text(checked)[0] != '\0');
    if (checked == FCSL_MESSAGE_OK) {
        FUZZ_CHECK(accepted.bytes == message && accepted.size == length && accepted.kind == kind);
        fcsl_message_apply(&MACHINE, &after, &accepted);
        check_accepted(&accepted, &after);
    }
    free(message);
    return 0;
}
