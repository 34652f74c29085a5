/* SPDX-License-Identifier: Apache-2.0
 *
 * Readers: a conversion, checked, and what a message looks like through it.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_ros.h"
#include "ros_number.h"
#include "ros_walk.h"

struct fcsl_ros_reader {
    const fcsl_ros_reader_plan_t *conversion;
    fcsl_ros_walk_t walk;
};

static int range_fits(uint32_t first, uint32_t count, uint32_t whole)
{
    return count <= whole && first <= whole - count;
}

/* Bytes behind each anchor, from the part or pick that sets it; 0 while nothing does. Fails where two do. */
static int anchor_sizes(const fcsl_ros_reader_plan_t *conversion, uint32_t *sizes)
{
    memset(sizes, 0, conversion->anchor_count * sizeof *sizes);
    for (uint32_t i = 0; i < conversion->part_count; i++) {
        const fcsl_ros_part_t *part = &conversion->parts[i];
        if (part->code == FCSL_ROS_BLOCK && part->first != FCSL_ROS_NONE) {
            if (part->first >= conversion->anchor_count || sizes[part->first] != 0) {
                return 0;
            }
            sizes[part->first] = part->size;
        }
        for (uint32_t j = 0; part->code == FCSL_ROS_SEQUENCE && j < part->count; j++) {
            const fcsl_ros_pick_t *pick = &conversion->picks[part->first + j];
            if (pick->anchor >= conversion->anchor_count || sizes[pick->anchor] != 0) {
                return 0;
            }
            sizes[pick->anchor] = (pick->count > 0 ? pick->count : 1u) * part->size;
        }
    }
    return 1;
}

/* Whether `count` numbers of a term lie behind its anchor. */
static int term_valid(const fcsl_ros_term_t *term, uint32_t count, const uint32_t *sizes, uint32_t anchor_count)
{
    const uint64_t bytes = (uint64_t)count * fcsl_ros_scalar_size(term->type);
    return bytes > 0 && bytes <= UINT32_MAX && term->anchor < anchor_count &&
           range_fits(term->offset, (uint32_t)bytes, sizes[term->anchor]);
}

static int values_valid(const fcsl_ros_reader_plan_t *conversion)
{
    for (uint32_t i = 0; i < conversion->value_count; i++) {
        const fcsl_ros_value_t *value = &conversion->values[i];
        if (!range_fits(value->offset, value->size, conversion->size) ||
            !range_fits(value->first_row, value->row_count, conversion->row_count) ||
            !range_fits(value->first_guard, value->guard_count, conversion->guard_count)) {
            return 0;
        }
    }
    return fcsl_ros_rows_valid(conversion->rows, conversion->row_count, conversion->term_count, conversion->size);
}

/* Whether every number that valid rows and the guards read lies behind an anchor that the walk sets. */
static int reads_valid(const fcsl_ros_reader_plan_t *conversion)
{
    uint32_t sizes[FCSL_ROS_ANCHORS_MAX];
    if (conversion->anchor_count > FCSL_ROS_ANCHORS_MAX || !anchor_sizes(conversion, sizes)) {
        return 0;
    }
    for (uint32_t i = 0; i < conversion->row_count; i++) {
        const fcsl_ros_row_t *row = &conversion->rows[i];
        for (uint32_t j = 0; j < row->term_count; j++) {
            if (!term_valid(&conversion->terms[row->first_term + j], row->more + 1u, sizes, conversion->anchor_count)) {
                return 0;
            }
        }
    }
    for (uint32_t i = 0; i < conversion->guard_count; i++) {
        if (!term_valid(&conversion->guards[i].at, 1, sizes, conversion->anchor_count)) {
            return 0;
        }
    }
    return conversion->stamp_anchor == FCSL_ROS_NONE ||
           (conversion->stamp_anchor < conversion->anchor_count &&
            range_fits(conversion->stamp_offset, 8u, sizes[conversion->stamp_anchor]));
}

fcsl_ros_reader_t *fcsl_ros_reader_new(const fcsl_ros_reader_plan_t *conversion, fcsl_error_t *error)
{
    if (!fcsl_ros_walk_valid(conversion) || !values_valid(conversion) || !reads_valid(conversion)) {
        (void)fcsl_fail(error, "this plan of a message does not hold together");
        return NULL;
    }
    fcsl_ros_reader_t *reader = calloc(1, sizeof *reader);
    if (reader == NULL) {
        (void)fcsl_fail(error, "out of memory for the plan of a message");
        return NULL;
    }
    reader->conversion = conversion;
    return reader;
}

void fcsl_ros_reader_free(fcsl_ros_reader_t *reader)
{
    free(reader);
}

const fcsl_ros_reader_plan_t *fcsl_ros_reader_conversion(const fcsl_ros_reader_t *reader)
{
    return reader->conversion;
}

size_t fcsl_ros_reader_end(const fcsl_ros_reader_t *reader)
{
    return reader->walk.end;
}

static fcsl_ros_status_t read_stamp(const fcsl_ros_reader_t *reader, int64_t *stamp_ns)
{
    const fcsl_ros_reader_plan_t *conversion = reader->conversion;
    *stamp_ns = 0;
    if (conversion->stamp_anchor == FCSL_ROS_NONE) {
        return FCSL_ROS_TAKEN;
    }
    int32_t seconds = 0;
    uint32_t nanoseconds = 0;
    const uint8_t *at = reader->walk.anchors[conversion->stamp_anchor];
    if (at == NULL) {
        return FCSL_ROS_STAMP;
    }
    memcpy(&seconds, at + conversion->stamp_offset, sizeof seconds);
    memcpy(&nanoseconds, at + conversion->stamp_offset + sizeof seconds, sizeof nanoseconds);
    if (seconds < 0 || nanoseconds >= 1000000000u) {
        return FCSL_ROS_STAMP;
    }
    *stamp_ns = (int64_t)seconds * 1000000000 + (int64_t)nanoseconds;
    return FCSL_ROS_TAKEN;
}

/* Whether all numbers of a value are 0; that of an integer or a bool has no sign. */
static int is_null(const fcsl_ros_value_t *value, uint8_t type, const uint8_t *row)
{
    const uint32_t scalar = fcsl_ros_scalar_size(type);
    const int is_float = type == FCSL_ROS_F32 || type == FCSL_ROS_F64;
    uint8_t bits = 0;
    for (uint32_t i = 0; i < value->size; i++) {
        const int has_sign = is_float && i % scalar == scalar - 1u;
        bits |= row[value->offset + i] & (has_sign ? 0x7Fu : 0xFFu);
    }
    return bits == 0u;
}

static fcsl_ros_status_t read_value(const fcsl_ros_reader_t *reader, const fcsl_ros_value_t *value, uint8_t *row)
{
    const fcsl_ros_reader_plan_t *conversion = reader->conversion;
    for (uint32_t i = 0; i < value->guard_count; i++) {
        if (fcsl_ros_guard_holds(&conversion->guards[value->first_guard + i], reader->walk.anchors)) {
            return FCSL_ROS_UNMEASURED;
        }
    }
    for (uint32_t i = 0; i < value->row_count; i++) {
        const fcsl_ros_row_t *number = &conversion->rows[value->first_row + i];
        const fcsl_ros_status_t status =
            fcsl_ros_row_apply(number, conversion->terms, reader->walk.anchors, conversion->nan_allowed, row);
        if (status != FCSL_ROS_TAKEN) {
            memset(row + value->offset, 0, value->size);
            return status;
        }
    }
    if (value->rotation != 0u && conversion->nan_allowed == 0u && value->row_count > 0u &&
        is_null(value, conversion->rows[value->first_row].type, row)) {
        memset(row + value->offset, 0, value->size);
        return FCSL_ROS_ROTATION;
    }
    return FCSL_ROS_TAKEN;
}

fcsl_ros_status_t fcsl_ros_read(fcsl_ros_reader_t *reader, const uint8_t *cdr, size_t size, uint8_t *row,
                                uint8_t *status, int64_t *stamp_ns)
{
    const fcsl_ros_reader_plan_t *conversion = reader->conversion;
    memset(row, 0, conversion->size);
    *stamp_ns = 0;
    fcsl_ros_status_t whole = fcsl_ros_walk(conversion, &reader->walk, cdr, size);
    if (whole == FCSL_ROS_TAKEN) {
        whole = read_stamp(reader, stamp_ns);
    }
    for (uint32_t i = 0; i < conversion->value_count; i++) {
        status[i] = (uint8_t)(whole == FCSL_ROS_TAKEN ? read_value(reader, &conversion->values[i], row) : whole);
    }
    return whole;
}

void fcsl_ros_read_many(fcsl_ros_reader_t *reader, const uint8_t *buffer, size_t size, const int64_t *offsets,
                        const int64_t *sizes, size_t count, uint8_t *rows, uint8_t *status, int64_t *stamps_ns)
{
    for (size_t i = 0; i < count; i++) {
        const int inside = offsets[i] >= 0 && sizes[i] >= 0 && (uint64_t)offsets[i] <= size &&
                           (uint64_t)sizes[i] <= size - (uint64_t)offsets[i];
        (void)fcsl_ros_read(reader, buffer + (inside ? offsets[i] : 0), inside ? (size_t)sizes[i] : 0, rows, status,
                            &stamps_ns[i]);
        rows += reader->conversion->size;
        status += reader->conversion->value_count;
    }
}
