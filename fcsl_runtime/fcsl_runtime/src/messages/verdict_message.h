/* SPDX-License-Identifier: Apache-2.0
 *
 * The verdicts on requirements as fcsl_msgs/RequirementVerdicts.
 */
#ifndef FCSL_VERDICT_MESSAGE_H
#define FCSL_VERDICT_MESSAGE_H

#include "fcsl/fcsl_monitor.h"
#include "tick_messages.h"

/* What does not change from one message to the next. */
typedef struct {
    const fcsl_monitor_t *monitor; /* null: no requirements, and nothing below means anything */
    /* The values that requirements keep of their last violation; of requirement i those from begin[i] to before begin[i + 1].
     * Paths and types are those of the watched machine. */
    const fcsl_field_t *kept;
    const uint32_t *kept_begin;
} fcsl_verdict_table_t;

/* A requirement after a tick. */
typedef struct {
    uint64_t violations;
    uint8_t verdict; /* fcsl_verdict_status_t */
    uint8_t holds;
} fcsl_verdict_row_t;

enum { FCSL_VERDICT_VALUE_BYTES = 8 }; /* of a value that is kept, whatever its type */

/* Bytes of what is recorded of a tick: a row for each requirement, then the kept values. */
static inline uint32_t fcsl_verdict_rows_bytes(const fcsl_verdict_table_t *table)
{
    const uint32_t count = table->monitor->requirement_count;
    return count * (uint32_t)sizeof(fcsl_verdict_row_t) + table->kept_begin[count] * FCSL_VERDICT_VALUE_BYTES;
}

/* Returns the bytes of the message, or 0: it does not fit. */
size_t fcsl_verdict_message(const fcsl_verdict_table_t *table, const fcsl_machine_t *machine, const uint8_t *rows,
                            fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity);
/* At most so many bytes; 0 without requirements. */
size_t fcsl_verdict_message_capacity(const fcsl_verdict_table_t *table);

#endif /* FCSL_VERDICT_MESSAGE_H */
