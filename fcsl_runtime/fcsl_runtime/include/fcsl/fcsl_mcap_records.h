/* SPDX-License-Identifier: Apache-2.0
 *
 * Where the records of an MCAP chunk lie, for readers in other languages that would have to look for them one by one.
 */
#ifndef FCSL_MCAP_RECORDS_H
#define FCSL_MCAP_RECORDS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint64_t begin;   /* of its content; of a message (opcode 5) that of its data, behind the message's own head */
    uint64_t end;
    int64_t log_ns;   /* messages only, as is channel */
    uint32_t channel;
    uint32_t opcode;
} fcsl_mcap_record_t;

/* Lists the records that follow one another in `bytes` from `begin` on, `capacity` of them at most, and returns how many.
 * Ends before one that does not fit. */
size_t fcsl_mcap_records(const uint8_t *bytes, size_t size, size_t begin, fcsl_mcap_record_t *records, size_t capacity);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_MCAP_RECORDS_H */
