/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages of ROS 2 that are not generated from the machine (sensor_msgs/Imu and its like): numbers picked out of them and
 * put into them, along plans that the front end (simclient) makes from a message definition.
 *
 * A *reader* walks the CDR bytes of a message (little-endian, encapsulation included), whatever they hold: no byte is read
 * beyond the message, no loop runs longer than the message is. It fills *values*, each of one or more numbers, into a row of
 * memory. A *composer* does the opposite: it copies a message whose every constant is in place, and puts numbers from memory
 * and a stamp into it. Both allocate nothing once they are made.
 *
 * Each number is a *row* of the change of axes: the sum of its terms, factor * number, in their order; then, if scaled,
 * * scale + offset. A row of one term with factor 1 that is not scaled is exact: integers of 64 bits stay what they are.
 * A number that its target cannot hold is refused, never rounded to an integer or cut off; a float32 is rounded to nearest.
 */
#ifndef FCSL_ROS_H
#define FCSL_ROS_H

#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

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
    FCSL_ROS_F64 = 10
} fcsl_ros_scalar_t;

/* What became of a message, or of one value of it. */
typedef enum {
    FCSL_ROS_TAKEN = 0,
    /* of the message: no value is taken */
    FCSL_ROS_ENCODING = 1,  /* not little-endian CDR */
    FCSL_ROS_TRUNCATED = 2, /* ends before its type does */
    FCSL_ROS_MALFORMED = 3, /* a string without its final NUL */
    FCSL_ROS_STAMP = 4,     /* a header whose stamp is no time */
    FCSL_ROS_FRAME = 5,     /* of another frame than the one asked for */
    /* of the message or a value */
    FCSL_ROS_SHAPE = 6, /* a sequence without the element, or the name, that is asked for, or of another length */
    /* of a value */
    FCSL_ROS_RANGE = 7, /* a number that its target cannot hold; a bool other than 0 and 1 */
    FCSL_ROS_NAN = 8,
    FCSL_ROS_UNMEASURED = 9, /* the message itself says so (REP-145: a covariance that begins with -1) */
    /* of a message that comes in while the machine runs */
    FCSL_ROS_FUTURE = 10,   /* stamped more than FCSL_ROS_AHEAD_NS ahead of now */
    FCSL_ROS_OLDER = 11,    /* stamped before the last one taken */
    FCSL_ROS_REPEATED = 12, /* stamped as the last one taken */
    FCSL_ROS_STATUSES = 13
} fcsl_ros_status_t;

#define FCSL_ROS_NONE UINT32_MAX

/* Clocks of two computers are never quite equal, and /clock comes a little after what it is the time of: a message stamped
 * ahead of now by at most this is of now. */
#define FCSL_ROS_AHEAD_NS 50000000

/* One step of the walk through a message. */
typedef enum {
    FCSL_ROS_BLOCK = 0, /* `size` bytes, aligned to `align`; anchor `first` is where they begin (or FCSL_ROS_NONE) */
    FCSL_ROS_STRING = 1, /* a string; it must be names[first] (or FCSL_ROS_NONE) */
    FCSL_ROS_NAMES = 2, /* a sequence of strings, in which names[first .. first + count) are looked up */
    FCSL_ROS_SEQUENCE = 3, /* a sequence of numbers of `size` bytes; picks[first .. first + count) are of it */
    FCSL_ROS_COUNT =
        4, /* the length of a sequence of messages, of which `count` are spelled out in the parts that follow;
                              behind those stands its REPEAT */
    FCSL_ROS_REPEAT = 5, /* the parts up to part `first`, for each of the rest */
    FCSL_ROS_END = 6 /* back to part `first`, its REPEAT */
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
    uint32_t count; /* all of them, and they must be as many; 0: one */
    uint32_t element; /* the one: its index, */
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
} fcsl_ros_value_t;

typedef struct {
    const fcsl_ros_part_t *parts;
    const fcsl_ros_pick_t *picks;
    const char *const *names; /* frames, and elements of sequences */
    const fcsl_ros_value_t *values;
    const fcsl_ros_row_t *rows;
    const fcsl_ros_term_t *terms;
    const fcsl_ros_guard_t *guards;
    uint32_t part_count;
    uint32_t pick_count;
    uint32_t name_count;
    uint32_t value_count;
    uint32_t row_count;
    uint32_t term_count;
    uint32_t guard_count;
    uint32_t anchor_count;
    uint32_t size; /* bytes of a row of values */
    uint32_t stamp_anchor; /* of a header's stamp (int32 s, uint32 ns), or FCSL_ROS_NONE */
    uint32_t stamp_offset;
} fcsl_ros_reader_plan_t;

typedef struct fcsl_ros_reader fcsl_ros_reader_t;

/* Copies the plan, after checking that no part of it can lead outside a message or a row. */
fcsl_ros_reader_t *fcsl_ros_reader_new(const fcsl_ros_reader_plan_t *plan, fcsl_error_t *error);
void fcsl_ros_reader_free(fcsl_ros_reader_t *reader);

/* Reads one message. `row` gets the values, zeros in place of those not taken; `status` gets one fcsl_ros_status_t each;
 * `stamp_ns` gets the header's stamp, 0 for a type without one. Returns what became of the message as a whole. */
fcsl_ros_status_t fcsl_ros_read(fcsl_ros_reader_t *reader, const uint8_t *cdr, size_t size, uint8_t *row,
                                uint8_t *status, int64_t *stamp_ns);

/* The same for `count` messages in one buffer, each given by its offset and size; rows, status and stamps follow one
 * another. A message that does not lie within the buffer is truncated. */
void fcsl_ros_read_many(fcsl_ros_reader_t *reader, const uint8_t *buffer, size_t size, const int64_t *offsets,
                        const int64_t *sizes, size_t count, uint8_t *rows, uint8_t *status, int64_t *stamps_ns);

/* ---- into a run ---------------------------------------------------------------------------------------------------- */

typedef struct fcsl_ros_inlet fcsl_ros_inlet_t;

/* Values of messages become samples of the run's sensor channels: value i of channels[i], whose field is as large. Run and
 * reader must outlive the inlet; a reader serves one. */
fcsl_ros_inlet_t *fcsl_ros_inlet_new(fcsl_run_t *run, fcsl_ros_reader_t *reader, const uint32_t *channels,
                                     uint32_t channel_count, fcsl_error_t *error);
void fcsl_ros_inlet_free(fcsl_ros_inlet_t *inlet);

/* Takes a message for the coming tick; `now_ns` is the time by the clock that the stamps are of. The samples are as old as
 * the stamp says, rounded down to whole ticks; a stamp of 0 says nothing, then they are new. Each value that is refused
 * leaves its channel alone, and so does value i where missing[i] is not 0 (`missing` may be null): an injected dropout.
 * Returns how many channels were written. */
uint32_t fcsl_ros_deliver(fcsl_ros_inlet_t *inlet, const uint8_t *cdr, size_t size, int64_t now_ns,
                          const uint8_t *missing);

/* FCSL_ROS_STATUSES counts: of messages of which something was taken, and of messages and values refused, by reason. */
const uint64_t *fcsl_ros_inlet_counts(const fcsl_ros_inlet_t *inlet);

/* How far the stamp of the newest readable message lay behind its `now_ns` (negative: ahead); 0 where it had no stamp. */
int64_t fcsl_ros_inlet_behind_ns(const fcsl_ros_inlet_t *inlet);

/* ---- out of memory -------------------------------------------------------------------------------------------------- */

typedef struct {
    const uint8_t *text; /* the message with every constant in place */
    const fcsl_ros_row_t *rows;
    const fcsl_ros_term_t *terms; /* their anchors are numbers of memories */
    uint32_t size;
    uint32_t row_count;
    uint32_t term_count;
    uint32_t memory_count;
    uint32_t stamp_offset; /* in the message, or FCSL_ROS_NONE */
} fcsl_ros_composer_plan_t;

typedef struct fcsl_ros_composer fcsl_ros_composer_t;

fcsl_ros_composer_t *fcsl_ros_composer_new(const fcsl_ros_composer_plan_t *plan, fcsl_error_t *error);
void fcsl_ros_composer_free(fcsl_ros_composer_t *composer);

/* Writes the message, all of the plan's `size` bytes. Its terms read from `memories`, which the caller vouches for.
 * FCSL_ROS_RANGE or _NAN: a number that its field cannot hold; FCSL_ROS_STAMP: a time that a stamp cannot hold. */
fcsl_ros_status_t fcsl_ros_compose(const fcsl_ros_composer_t *composer, const uint8_t *const *memories, int64_t time_ns,
                                   uint8_t *cdr);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_ROS_H */
