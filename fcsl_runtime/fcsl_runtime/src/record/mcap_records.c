/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds the records in an MCAP chunk.
 */
#include "fcsl/fcsl_mcap_records.h"

enum { HEAD_BYTES = 9, MESSAGE_HEAD_BYTES = 22, MESSAGE = 5 };

/* `size` bytes (at most 8), little-endian. */
static uint64_t read_le(const uint8_t *bytes, int size)
{
    uint64_t value = 0;
    for (int i = size - 1; i >= 0; i--) {
        value = value << 8 | bytes[i];
    }
    return value;
}

size_t fcsl_mcap_records(const uint8_t *bytes, size_t size, size_t begin, fcsl_mcap_record_t *records, size_t capacity)
{
    size_t count = 0;
    size_t at = begin;
    while (count < capacity && at <= size && size - at >= HEAD_BYTES) {
        fcsl_mcap_record_t record = {.opcode = bytes[at], .begin = at + HEAD_BYTES};
        const uint64_t length = read_le(bytes + at + 1, 8);
        if (length > size - record.begin || (record.opcode == MESSAGE && length < MESSAGE_HEAD_BYTES)) {
            break;
        }
        record.end = record.begin + length;
        if (record.opcode == MESSAGE) {
            const uint8_t *head = bytes + record.begin;
            record.channel = (uint32_t)read_le(head, 2);
            record.log_ns = (int64_t)read_le(head + 6, 8);
            record.begin += MESSAGE_HEAD_BYTES;
        }
        at = record.end;
        records[count++] = record;
    }
    return count;
}
