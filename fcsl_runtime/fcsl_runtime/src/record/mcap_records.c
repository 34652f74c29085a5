/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds the records in an MCAP chunk.
 */
#include "fcsl/fcsl_mcap_records.h"

#include "fcsl/fcsl_scalar.h"

enum { HEAD_BYTES = 9, MESSAGE_HEAD_BYTES = 22, MESSAGE = 5 };

size_t fcsl_mcap_records(const uint8_t *bytes, size_t size, size_t begin, fcsl_mcap_record_t *records, size_t capacity)
{
    size_t count = 0;
    size_t at = begin;
    while (count < capacity && at <= size && size - at >= HEAD_BYTES) {
        fcsl_mcap_record_t record = {.opcode = bytes[at], .begin = at + HEAD_BYTES};
        const uint64_t length = fcsl_get_u64(bytes + at + 1);
        if (length > size - record.begin || (record.opcode == MESSAGE && length < MESSAGE_HEAD_BYTES)) {
            break;
        }
        record.end = record.begin + length;
        if (record.opcode == MESSAGE) {
            const uint8_t *head = bytes + record.begin;
            record.channel = fcsl_get_u16(head);
            record.log_ns = (int64_t)fcsl_get_u64(head + 6);
            record.begin += MESSAGE_HEAD_BYTES;
        }
        at = record.end;
        records[count++] = record;
    }
    return count;
}
