/* SPDX-License-Identifier: Apache-2.0
 *
 * Readers: a conversion, checked, and what a message looks like through it.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_ros.h"
#include "fcsl/fcsl_scalar.h"
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

/* What is behind an anchor. */
typedef struct {
    uint32_t bytes; /* 0 while no part or pick sets it */
    uint8_t limited; /* perhaps fewer: only a value that is limited may read them */
} extent_t;

static int set_extent(extent_t *extents, uint32_t anchor_count, uint32_t anchor, uint32_t bytes, int limited)
{
    if (anchor >= anchor_count || extents[anchor].bytes != 0) {
        return 0;
    }
    extents[anchor] = (extent_t){.bytes = bytes, .limited = (uint8_t)limited};
    return 1;
}

/* What is behind each anchor. Fails where two parts or picks set one. */
static int find_extents(const fcsl_ros_reader_plan_t *conversion, extent_t *extents)
{
    const uint32_t anchors = conversion->anchor_count;
    int valid = 1;
    memset(extents, 0, anchors * sizeof *extents);
    for (uint32_t i = 0; i < conversion->part_count && valid; i++) {
        const fcsl_ros_part_t *part = &conversion->parts[i];
        if ((part->code == FCSL_ROS_BLOCK || part->code == FCSL_ROS_COUNT) && part->first != FCSL_ROS_NONE) {
            const uint32_t bytes = part->code == FCSL_ROS_BLOCK ? part->size : (uint32_t)sizeof(uint32_t);
            valid = set_extent(extents, anchors, part->first, bytes, 0);
        } else if (part->code == FCSL_ROS_CHOICE) {
            valid = set_extent(extents, anchors, part->size, sizeof(uint32_t), 0);
        }
        for (uint32_t j = 0; part->code == FCSL_ROS_SEQUENCE && j < part->count && valid; j++) {
            const fcsl_ros_pick_t *pick = &conversion->picks[part->first + j];
            const uint32_t bytes = fcsl_ros_pick_is_length(pick) ? (uint32_t)sizeof(uint32_t)
                                                                 : (pick->count > 0 ? pick->count : 1u) * part->size;
            valid = set_extent(extents, anchors, pick->anchor, bytes, fcsl_ros_pick_is_limited(pick));
        }
    }
    return valid;
}

/* Whether `count` numbers of a term lie behind its anchor. */
static int term_valid(const fcsl_ros_term_t *term, uint32_t count, const extent_t *extents, uint32_t anchor_count)
{
    const uint64_t bytes = (uint64_t)count * fcsl_ros_scalar_size(term->type);
    return bytes > 0 && bytes <= UINT32_MAX && term->anchor < anchor_count &&
           range_fits(term->offset, (uint32_t)bytes, extents[term->anchor].bytes);
}

/* Whether the rows of each value read what is always there, or of a limited one the only numbers that are perhaps not. */
static int limits_valid(const fcsl_ros_reader_plan_t *conversion, const extent_t *extents)
{
    for (uint32_t i = 0; i < conversion->value_count; i++) {
        const fcsl_ros_value_t *value = &conversion->values[i];
        for (uint32_t j = 0; j < value->row_count; j++) {
            const fcsl_ros_row_t *row = &conversion->rows[value->first_row + j];
            if (value->limited != 0u && row->term_count != 1u) {
                return 0;
            }
            for (uint32_t k = 0; k < row->term_count; k++) {
                const fcsl_ros_term_t *term = &conversion->terms[row->first_term + k];
                if (extents[term->anchor].limited != value->limited) {
                    return 0;
                }
            }
        }
    }
    return 1;
}

/* A choice is of integers, each a u32 or an i32 of the row. */
static int choices_valid(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_value_t *value)
{
    if (value->choice_count == 0u) {
        return 1;
    }
    for (uint32_t i = 0; i < value->row_count; i++) {
        const uint8_t type = conversion->rows[value->first_row + i].type;
        if (type != FCSL_ROS_I32 && type != FCSL_ROS_U32) {
            return 0;
        }
    }
    return value->size % sizeof(uint32_t) == 0 &&
           (value->first_choice == FCSL_ROS_NONE ||
            range_fits(value->first_choice, value->choice_count, conversion->choice_count));
}

static int values_valid(const fcsl_ros_reader_plan_t *conversion)
{
    for (uint32_t i = 0; i < conversion->value_count; i++) {
        const fcsl_ros_value_t *value = &conversion->values[i];
        if (!range_fits(value->offset, value->size, conversion->size) ||
            !range_fits(value->first_row, value->row_count, conversion->row_count) ||
            !range_fits(value->first_guard, value->guard_count, conversion->guard_count) || value->limited > 1u) {
            return 0;
        }
    }
    return fcsl_ros_rows_valid(conversion->rows, conversion->row_count, conversion->term_count, conversion->size);
}

/* Whether every number that valid rows and the guards read lies behind an anchor that the walk sets. */
static int reads_valid(const fcsl_ros_reader_plan_t *conversion)
{
    extent_t extents[FCSL_ROS_ANCHORS_MAX];
    if (conversion->anchor_count > FCSL_ROS_ANCHORS_MAX || !find_extents(conversion, extents)) {
        return 0;
    }
    for (uint32_t i = 0; i < conversion->row_count; i++) {
        const fcsl_ros_row_t *row = &conversion->rows[i];
        for (uint32_t j = 0; j < row->term_count; j++) {
            if (!term_valid(&conversion->terms[row->first_term + j], row->more + 1u, extents,
                            conversion->anchor_count)) {
                return 0;
            }
        }
    }
    for (uint32_t i = 0; i < conversion->guard_count; i++) {
        const fcsl_ros_term_t *at = &conversion->guards[i].at;
        if (!term_valid(at, 1, extents, conversion->anchor_count) || extents[at->anchor].limited) {
            return 0;
        }
    }
    for (uint32_t i = 0; i < conversion->value_count; i++) {
        if (!choices_valid(conversion, &conversion->values[i])) {
            return 0;
        }
    }
    return limits_valid(conversion, extents) &&
           (conversion->stamp_anchor == FCSL_ROS_NONE ||
            (conversion->stamp_anchor < conversion->anchor_count && !extents[conversion->stamp_anchor].limited &&
             range_fits(conversion->stamp_offset, 8u, extents[conversion->stamp_anchor].bytes)));
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

/* The part of a row that a sequence of perhaps fewer numbers has. Returns 0 where there is none. */
static int cut_row(const fcsl_ros_reader_t *reader, fcsl_ros_row_t *row)
{
    const fcsl_ros_term_t *term = &reader->conversion->terms[row->first_term];
    const uint32_t first = term->offset / fcsl_ros_scalar_size(term->type);
    if (reader->walk.anchors[term->anchor] == NULL) {
        return 1; /* refused when it is read */
    }
    if (reader->walk.lengths[term->anchor] <= first) {
        return 0;
    }
    const uint32_t more = reader->walk.lengths[term->anchor] - first - 1u;
    row->more = more < row->more ? more : row->more;
    return 1;
}

/* Turns the numbers of a value into indices of choices. */
static fcsl_ros_status_t choose(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_value_t *value, uint8_t *row)
{
    const int is_signed = conversion->rows[value->first_row].type == FCSL_ROS_I32;
    for (uint32_t at = value->offset; at < value->offset + value->size; at += (uint32_t)sizeof(uint32_t)) {
        const uint32_t bits = fcsl_get_u32(row + at);
        const int64_t number = is_signed ? (int64_t)(int32_t)bits : (int64_t)bits;
        uint32_t index = value->choice_count;
        if (value->first_choice == FCSL_ROS_NONE) {
            index = number >= 0 && number < (int64_t)value->choice_count ? (uint32_t)number : index;
        } else {
            for (index = 0; index < value->choice_count; index++) {
                if (conversion->choices[value->first_choice + index] == number) {
                    break;
                }
            }
        }
        if (index == value->choice_count) {
            return FCSL_ROS_UNKNOWN;
        }
        fcsl_put_u32(row + at, index);
    }
    return FCSL_ROS_TAKEN;
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
        fcsl_ros_row_t number = conversion->rows[value->first_row + i];
        if (value->limited != 0u && !cut_row(reader, &number)) {
            continue;
        }
        const fcsl_ros_status_t status =
            fcsl_ros_row_apply(&number, conversion->terms, reader->walk.anchors, conversion->nan_allowed, row);
        if (status != FCSL_ROS_TAKEN) {
            memset(row + value->offset, 0, value->size);
            return status;
        }
    }
    if (value->choice_count > 0u && value->row_count > 0u) {
        const fcsl_ros_status_t status = choose(conversion, value, row);
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
