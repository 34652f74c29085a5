/* SPDX-License-Identifier: Apache-2.0
 *
 * Readers: a plan, checked, and what a message looks like through it.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_ros.h"
#include "ros_number.h"
#include "ros_walk.h"

struct fcsl_ros_reader {
    const fcsl_ros_reader_plan_t *plan;
    fcsl_ros_walk_t walk;
};

static int range_fits(uint32_t first, uint32_t count, uint32_t whole)
{
    return count <= whole && first <= whole - count;
}

/* Bytes behind each anchor, from the part or pick that sets it; 0 while nothing does. Fails where two do. */
static int anchor_sizes(const fcsl_ros_reader_plan_t *plan, uint32_t *sizes)
{
    memset(sizes, 0, plan->anchor_count * sizeof *sizes);
    for (uint32_t i = 0; i < plan->part_count; i++) {
        const fcsl_ros_part_t *part = &plan->parts[i];
        if (part->code == FCSL_ROS_BLOCK && part->first != FCSL_ROS_NONE) {
            if (part->first >= plan->anchor_count || sizes[part->first] != 0) {
                return 0;
            }
            sizes[part->first] = part->size;
        }
        for (uint32_t j = 0; part->code == FCSL_ROS_SEQUENCE && j < part->count; j++) {
            const fcsl_ros_pick_t *pick = &plan->picks[part->first + j];
            if (pick->anchor >= plan->anchor_count || sizes[pick->anchor] != 0) {
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

static int values_valid(const fcsl_ros_reader_plan_t *plan)
{
    for (uint32_t i = 0; i < plan->value_count; i++) {
        const fcsl_ros_value_t *value = &plan->values[i];
        if (!range_fits(value->offset, value->size, plan->size) ||
            !range_fits(value->first_row, value->row_count, plan->row_count) ||
            !range_fits(value->first_guard, value->guard_count, plan->guard_count)) {
            return 0;
        }
    }
    return fcsl_ros_rows_valid(plan->rows, plan->row_count, plan->term_count, plan->size);
}

/* Whether every number that valid rows and the guards read lies behind an anchor that the walk sets. */
static int reads_valid(const fcsl_ros_reader_plan_t *plan)
{
    uint32_t sizes[FCSL_ROS_ANCHORS_MAX];
    if (plan->anchor_count > FCSL_ROS_ANCHORS_MAX || !anchor_sizes(plan, sizes)) {
        return 0;
    }
    for (uint32_t i = 0; i < plan->row_count; i++) {
        const fcsl_ros_row_t *row = &plan->rows[i];
        for (uint32_t j = 0; j < row->term_count; j++) {
            if (!term_valid(&plan->terms[row->first_term + j], row->more + 1u, sizes, plan->anchor_count)) {
                return 0;
            }
        }
    }
    for (uint32_t i = 0; i < plan->guard_count; i++) {
        if (!term_valid(&plan->guards[i].at, 1, sizes, plan->anchor_count)) {
            return 0;
        }
    }
    return plan->stamp_anchor == FCSL_ROS_NONE ||
           (plan->stamp_anchor < plan->anchor_count && range_fits(plan->stamp_offset, 8u, sizes[plan->stamp_anchor]));
}

fcsl_ros_reader_t *fcsl_ros_reader_new(const fcsl_ros_reader_plan_t *plan, fcsl_error_t *error)
{
    if (!fcsl_ros_walk_valid(plan) || !values_valid(plan) || !reads_valid(plan)) {
        (void)fcsl_fail(error, "this plan of a message does not hold together");
        return NULL;
    }
    fcsl_ros_reader_t *reader = calloc(1, sizeof *reader);
    if (reader == NULL) {
        (void)fcsl_fail(error, "out of memory for the plan of a message");
        return NULL;
    }
    reader->plan = plan;
    return reader;
}

void fcsl_ros_reader_free(fcsl_ros_reader_t *reader)
{
    free(reader);
}

const fcsl_ros_reader_plan_t *fcsl_ros_reader_plan(const fcsl_ros_reader_t *reader)
{
    return reader->plan;
}

size_t fcsl_ros_reader_end(const fcsl_ros_reader_t *reader)
{
    return reader->walk.end;
}

static fcsl_ros_status_t read_stamp(const fcsl_ros_reader_t *reader, int64_t *stamp_ns)
{
    const fcsl_ros_reader_plan_t *plan = reader->plan;
    *stamp_ns = 0;
    if (plan->stamp_anchor == FCSL_ROS_NONE) {
        return FCSL_ROS_TAKEN;
    }
    int32_t seconds = 0;
    uint32_t nanoseconds = 0;
    const uint8_t *at = reader->walk.anchors[plan->stamp_anchor];
    if (at == NULL) {
        return FCSL_ROS_STAMP;
    }
    memcpy(&seconds, at + plan->stamp_offset, sizeof seconds);
    memcpy(&nanoseconds, at + plan->stamp_offset + sizeof seconds, sizeof nanoseconds);
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
    const fcsl_ros_reader_plan_t *plan = reader->plan;
    for (uint32_t i = 0; i < value->guard_count; i++) {
        if (fcsl_ros_guard_holds(&plan->guards[value->first_guard + i], reader->walk.anchors)) {
            return FCSL_ROS_UNMEASURED;
        }
    }
    for (uint32_t i = 0; i < value->row_count; i++) {
        const fcsl_ros_row_t *number = &plan->rows[value->first_row + i];
        const fcsl_ros_status_t status =
            fcsl_ros_row_apply(number, plan->terms, reader->walk.anchors, plan->nan_allowed, row);
        if (status != FCSL_ROS_TAKEN) {
            memset(row + value->offset, 0, value->size);
            return status;
        }
    }
    if (value->rotation != 0u && plan->nan_allowed == 0u && value->row_count > 0u &&
        is_null(value, plan->rows[value->first_row].type, row)) {
        memset(row + value->offset, 0, value->size);
        return FCSL_ROS_ROTATION;
    }
    return FCSL_ROS_TAKEN;
}

fcsl_ros_status_t fcsl_ros_read(fcsl_ros_reader_t *reader, const uint8_t *cdr, size_t size, uint8_t *row,
                                uint8_t *status, int64_t *stamp_ns)
{
    const fcsl_ros_reader_plan_t *plan = reader->plan;
    memset(row, 0, plan->size);
    *stamp_ns = 0;
    fcsl_ros_status_t whole = fcsl_ros_walk(plan, &reader->walk, cdr, size);
    if (whole == FCSL_ROS_TAKEN) {
        whole = read_stamp(reader, stamp_ns);
    }
    for (uint32_t i = 0; i < plan->value_count; i++) {
        status[i] = (uint8_t)(whole == FCSL_ROS_TAKEN ? read_value(reader, &plan->values[i], row) : whole);
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
        rows += reader->plan->size;
        status += reader->plan->value_count;
    }
}
