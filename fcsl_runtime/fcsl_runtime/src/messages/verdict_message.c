/* SPDX-License-Identifier: Apache-2.0
 *
 * Writes the verdicts on requirements as CDR.
 */
#include "verdict_message.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_cdr.h"
#include "machine/enumerators.h"

/* Of a message: what comes once, and for each requirement beside its texts, with all padding; of the text of a value. */
enum { HEAD_BYTES = 64, ROW_BYTES = 48, VALUE_BYTES = 256, VALUES_BYTES = 1024 };

static void put_value(const fcsl_field_t *field, const fcsl_machine_t *machine, const uint8_t *bytes,
                      char text[VALUE_BYTES])
{
    char made[VALUE_BYTES];
    int64_t whole = 0;
    float f32 = 0.0f;
    double f64 = 0.0;
    switch (field->type) {
    case FCSL_BOOL:
        (void)snprintf(text, VALUE_BYTES, "%s", bytes[0] != 0 ? "true" : "false");
        return;
    case FCSL_F32:
        memcpy(&f32, bytes, sizeof f32);
        (void)snprintf(text, VALUE_BYTES, "%.7g", (double)f32);
        return;
    case FCSL_F64:
        memcpy(&f64, bytes, sizeof f64);
        (void)snprintf(text, VALUE_BYTES, "%.9g", f64);
        return;
    case FCSL_I64:
        memcpy(&whole, bytes, sizeof whole);
        (void)snprintf(text, VALUE_BYTES, "%" PRId64, whole);
        return;
    case FCSL_U64:
        (void)snprintf(text, VALUE_BYTES, "%" PRIu64, fcsl_get_u64(bytes));
        return;
    case FCSL_U32:
        (void)snprintf(text, VALUE_BYTES, "%" PRIu32, fcsl_get_u32(bytes));
        return;
    case FCSL_I32:
        (void)snprintf(text, VALUE_BYTES, "%" PRId32, (int32_t)fcsl_get_u32(bytes));
        return;
    default:
        (void)snprintf(text, VALUE_BYTES, "%s",
                       fcsl_enumerator_name(machine, field->type, (int32_t)fcsl_get_u32(bytes), made, sizeof made));
    }
}

/* "filter.outputs.vel_z = -6.2, machine.state = DESCENT", as many of the values as find room. */
static void put_values(const fcsl_verdict_table_t *table, const fcsl_machine_t *machine, uint32_t index,
                       const uint8_t *values, char text[VALUES_BYTES])
{
    size_t at = 0;
    text[0] = '\0';
    for (uint32_t i = table->kept_begin[index]; i < table->kept_begin[index + 1u]; i++) {
        char value[VALUE_BYTES];
        put_value(&table->kept[i], machine, values + (size_t)i * FCSL_VERDICT_VALUE_BYTES, value);
        const int size =
            snprintf(text + at, VALUES_BYTES - at, "%s%s = %s", at > 0 ? ", " : "", table->kept[i].path, value);
        if (size < 0 || (size_t)size >= VALUES_BYTES - at) {
            text[at] = '\0';
            return;
        }
        at += (size_t)size;
    }
}

size_t fcsl_verdict_message(const fcsl_verdict_table_t *table, const fcsl_machine_t *machine, const uint8_t *rows,
                            fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity)
{
    const fcsl_monitor_t *monitor = table->monitor;
    const uint32_t count = monitor->requirement_count;
    const fcsl_verdict_row_t *row = (const void *)rows; /* records of the ring are aligned */
    const uint8_t *values = rows + count * sizeof *row;
    fcsl_cdr_t cdr;
    fcsl_tick_message_begin(&cdr, stamp, bytes, capacity);
    fcsl_cdr_u32(&cdr, count);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_cdr_string(&cdr, monitor->requirements[i].id);
    }
    fcsl_cdr_u32(&cdr, count);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_cdr_string(&cdr, monitor->requirements[i].text);
    }
    fcsl_cdr_u32(&cdr, count);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_cdr_u8(&cdr, row[i].verdict);
    }
    fcsl_cdr_u32(&cdr, count);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_cdr_u8(&cdr, row[i].holds);
    }
    fcsl_cdr_u32(&cdr, count);
    for (uint32_t i = 0; i < count; i++) {
        char text[VALUES_BYTES] = "";
        if (row[i].violations > 0) {
            put_values(table, machine, i, values, text);
        }
        fcsl_cdr_string(&cdr, text);
    }
    fcsl_cdr_u32(&cdr, count);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_cdr_u64(&cdr, row[i].violations);
    }
    return fcsl_cdr_end(&cdr);
}

size_t fcsl_verdict_message_capacity(const fcsl_verdict_table_t *table)
{
    size_t bytes = HEAD_BYTES;
    for (uint32_t i = 0; table->monitor != NULL && i < table->monitor->requirement_count; i++) {
        const fcsl_requirement_t *requirement = &table->monitor->requirements[i];
        bytes += strlen(requirement->id) + strlen(requirement->text) + VALUES_BYTES + ROW_BYTES;
    }
    return table->monitor != NULL ? bytes : 0;
}
