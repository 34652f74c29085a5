/* SPDX-License-Identifier: Apache-2.0
 *
 * Conversions of ROS 2 messages that are not generated from the machine (sensor_msgs/Imu and its like): which numbers are picked out of
 * them and put into them. The compiler makes them of a machine's mapped channels, and Python of other messages; fcsl_ros.h executes
 * both. Constant data.
 *
 * Each number is a *row* of the change of axes: the sum of its terms, factor * number, in their order; then, if scaled,
 * * scale + offset. A row of one term with factor 1 that is not scaled is exact: integers of 64 bits stay what they are.
 */
#ifndef FCSL_ROS_CONVERSION_H
#define FCSL_ROS_CONVERSION_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FCSL_ROS_NONE UINT32_MAX

/* Numbers as they lie in a message, and in memory. */
typedef enum {
    FCSL_ROS_BOOL = 0,
    FCSL_ROS_I8 = 1,
    FCSL_ROS_U8 = 2,
    FCSL_ROS_I16 = 3,
    FCSL_ROS_U16 = 4,
    FCSL_ROS_I32 = 5,
    FCSL_ROS_U32 = 6,
    FCSL_ROS_I64 = 7,
    FCSL_ROS_U64 = 8,
    FCSL_ROS_F32 = 9,
    FCSL_ROS_F64 = 10,
    FCSL_ROS_TEXT = 11 /* of a choice: a string */
} fcsl_ros_scalar_t;

/* One step of the walk through a message. */
typedef enum {
    FCSL_ROS_BLOCK = 0, /* `size` bytes, aligned to `align`; anchor `first` is where they begin (or FCSL_ROS_NONE) */
    FCSL_ROS_STRING = 1, /* a string; it must be names[first] (or FCSL_ROS_NONE) */
    FCSL_ROS_NAMES = 2, /* a sequence of strings, in which names[first .. first + count) are looked up */
    FCSL_ROS_SEQUENCE = 3, /* a sequence of numbers of `size` bytes; picks[first .. first + count) are of it */
    FCSL_ROS_COUNT =
        4, /* the length of a sequence of messages, of which `count` are spelled out in the parts that follow;
                              behind those stands its REPEAT; anchor `first` is the length (or FCSL_ROS_NONE) */
    FCSL_ROS_REPEAT = 5, /* the parts up to part `first`, for each of the rest */
    FCSL_ROS_END = 6, /* back to part `first`, its REPEAT */
    FCSL_ROS_FIND =
        7, /* a sequence of messages: the parts up to part `first`, its FOUND, for each until a KEY fits, and
                          back to where it begins; anchors size .. size + count lie in the element, or are null */
    FCSL_ROS_KEY = 8, /* a string, which names[first] is in the element that is looked for */
    FCSL_ROS_FOUND = 9, /* back to part `first`, its FIND */
    FCSL_ROS_CHOICE = 10 /* a string; anchor `size` is its index in names[first .. first + count), a u32, or `count` */
} fcsl_ros_code_t;

typedef struct {
    uint8_t code; /* fcsl_ros_code_t */
    uint8_t align;
    uint32_t size;
    uint32_t first;
    uint32_t count;
} fcsl_ros_part_t;

/* Numbers of a sequence that anchor `anchor` points to, if they are there. */
typedef struct {
    uint32_t anchor;
    uint32_t count; /* all of them, and they must be as many, or with `element` 1 at most as many; 0: one */
    uint32_t element; /* the one: its index, or FCSL_ROS_NONE: the length itself, */
    uint32_t name; /* or that of names[name] in the NAMES before it (or FCSL_ROS_NONE) */
} fcsl_ros_pick_t;

/* A number to read: `offset` bytes from an anchor of the walk, or from the memory of that number. */
typedef struct {
    double factor;
    uint32_t anchor;
    uint32_t offset;
    uint8_t type; /* fcsl_ros_scalar_t */
} fcsl_ros_term_t;

/* A number to write: `offset` bytes into the row, or into the message. */
typedef struct {
    uint32_t first_term;
    uint32_t term_count;
    uint32_t offset;
    uint8_t type; /* fcsl_ros_scalar_t */
    uint8_t scaled;
    double scale;
    double bias;
    uint32_t more; /* further numbers, each behind the one before, of a row of one term */
} fcsl_ros_row_t;

/* A value is not taken while this number of the message is `value`. */
typedef struct {
    fcsl_ros_term_t at;
    double value;
} fcsl_ros_guard_t;

/* `size` bytes of the row from `offset` on. */
typedef struct {
    uint32_t offset;
    uint32_t size;
    uint32_t first_row;
    uint32_t row_count;
    uint32_t first_guard;
    uint32_t guard_count;
    uint8_t rotation; /* a quaternion, refused where all its numbers are 0 */
    uint8_t limited; /* of a sequence that may be shorter: the numbers behind its end stay 0 */
    /* Each number becomes its index among choices[first_choice .. + choice_count), or with FCSL_ROS_NONE it is one, below
     * choice_count. Any other is refused. A choice_count of 0: no choice. */
    uint32_t first_choice;
    uint32_t choice_count;
} fcsl_ros_value_t;

typedef struct {
    const fcsl_ros_part_t *parts;
    const fcsl_ros_pick_t *picks;
    const char *const *names; /* frames, and elements of sequences */
    const fcsl_ros_value_t *values;
    const fcsl_ros_row_t *rows;
    const fcsl_ros_term_t *terms;
    const fcsl_ros_guard_t *guards;
    const int64_t *choices;
    uint32_t part_count;
    uint32_t pick_count;
    uint32_t name_count;
    uint32_t value_count;
    uint32_t row_count;
    uint32_t term_count;
    uint32_t guard_count;
    uint32_t choice_count;
    uint32_t anchor_count;
    uint32_t size; /* bytes of a row of values */
    uint32_t stamp_anchor; /* of a header's stamp (int32 s, uint32 ns), or FCSL_ROS_NONE */
    uint32_t stamp_offset;
    uint8_t nan_allowed; /* a NaN is a value of a float, and any quaternion one; else they are refused */
} fcsl_ros_reader_plan_t;

/* A choice to write, by its index: of numbers[first .. first + count), or as FCSL_ROS_TEXT of names. A text has its length at
 * `at`, and room for the longest behind it. */
typedef struct {
    fcsl_ros_term_t index; /* u32 or i32 */
    uint32_t at;
    uint8_t type; /* fcsl_ros_scalar_t */
    uint32_t first;
    uint32_t count;
} fcsl_ros_choice_t;

/* Bytes that stay together where strings or sequences are shorter than the text: all of them, or with `element` as many
 * elements of so many bytes as the length before them says, which may not be more than they are. */
typedef struct {
    uint32_t offset; /* in the text */
    uint32_t size;
    uint8_t align;
    uint8_t element;
} fcsl_ros_segment_t;

typedef struct {
    const uint8_t *text; /* the message with every constant in place */
    const fcsl_ros_row_t *rows;
    const fcsl_ros_term_t *terms; /* their anchors are numbers of memories */
    const fcsl_ros_choice_t *choices;
    const char *const *names;
    const int64_t *numbers;
    const fcsl_ros_segment_t *segments;
    uint32_t size; /* of the longest message */
    uint32_t row_count;
    uint32_t term_count;
    uint32_t choice_count;
    uint32_t name_count;
    uint32_t number_count;
    uint32_t segment_count; /* 0: every message is as long */
    uint32_t memory_count;
    uint32_t stamp_offset; /* in the message, or FCSL_ROS_NONE */
} fcsl_ros_composer_plan_t;

#ifdef __cplusplus
}
#endif

#endif /* FCSL_ROS_CONVERSION_H */
