/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_mcap_records.h: where the records of a chunk lie. Input: where to begin (1), how many records there is room for (1), a chunk.
 */
#include "fcsl/fcsl_mcap_records.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    const size_t begin = (size_t)take_number(&bytes, 1);
    const size_t capacity = (size_t)take_number(&bytes, 1);
    size_t length = bytes.left;
    uint8_t *chunk = take_copy(&bytes, &length);
    fcsl_mcap_record_t *records = malloc(capacity * sizeof *records);
    FUZZ_CHECK(records != NULL || capacity == 0);
    const size_t count = fcsl_mcap_records(chunk, length, begin, records, capacity);
    FUZZ_CHECK(count <= capacity);
    uint64_t end = begin;
    for (size_t i = 0; i < count; i++) {
        FUZZ_CHECK(records[i].begin >= end + 9u && records[i].end >= records[i].begin && records[i].end <= length);
        end = records[i].end;
    }
    free(records);
    free(chunk);
    return 0;
}
