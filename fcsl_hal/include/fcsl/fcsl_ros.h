/* SPDX-License-Identifier: Apache-2.0
 *
 * Numbers picked out of ROS 2 messages and put into them, along conversions (fcsl_ros_conversion.h).
 *
 * A *reader* walks the CDR bytes of a message (little-endian, encapsulation included), whatever they hold: no byte is read
 * beyond the message, no loop runs longer than the message is. It fills *values*, each of one or more numbers, into a row of
 * memory. A *composer* does the opposite: it copies a message whose every constant is in place, and puts numbers from memory
 * and a stamp into it. Both allocate nothing once they are made.
 *
 * A number that its target cannot hold is refused, never rounded to an integer or cut off; a float32 is rounded to nearest.
 */
#ifndef FCSL_ROS_H
#define FCSL_ROS_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_ros_conversion.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of a number (fcsl_ros_scalar_t), 0 for an unknown type. */
uint32_t fcsl_ros_scalar_size(uint8_t type);

/* No message may be larger. */
#define FCSL_ROS_MESSAGE_MAX (1u << 20)

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
    FCSL_ROS_ROTATION = 10, /* a quaternion of length zero */
    /* of a message that comes in while the machine runs */
    FCSL_ROS_FUTURE = 11,   /* stamped more than FCSL_ROS_AHEAD_NS ahead of now */
    FCSL_ROS_OLDER = 12,    /* stamped before the last one taken */
    FCSL_ROS_REPEATED = 13, /* stamped as the last one taken */
    /* of a value */
    FCSL_ROS_UNKNOWN = 14, /* a string or a number that is none of the choices */
    FCSL_ROS_STATUSES = 15
} fcsl_ros_status_t;

typedef struct fcsl_ros_reader fcsl_ros_reader_t;

/* Checks that no part of the conversion, which must outlive the reader, can lead outside a message or a row. Returns null where one
 * does, or without memory, with `error` filled. */
fcsl_ros_reader_t *fcsl_ros_reader_new(const fcsl_ros_reader_plan_t *conversion, fcsl_error_t *error);
void fcsl_ros_reader_free(fcsl_ros_reader_t *reader);
const fcsl_ros_reader_plan_t *fcsl_ros_reader_conversion(const fcsl_ros_reader_t *reader);

/* Reads one message. `row` gets the values, zeros in place of those not taken; `status` gets one fcsl_ros_status_t each;
 * `stamp_ns` gets the header's stamp, 0 for a type without one. Returns what became of the message as a whole. */
fcsl_ros_status_t fcsl_ros_read(fcsl_ros_reader_t *reader, const uint8_t *cdr, size_t size, uint8_t *row,
                                uint8_t *status, int64_t *stamp_ns);

/* Bytes of the last message that was read whole, as its type says: what is behind them was passed over. */
size_t fcsl_ros_reader_end(const fcsl_ros_reader_t *reader);

/* The same for `count` messages in one buffer, each given by its offset and size; rows, status and stamps follow one
 * another. A message that does not lie within the buffer is truncated. */
void fcsl_ros_read_many(fcsl_ros_reader_t *reader, const uint8_t *buffer, size_t size, const int64_t *offsets,
                        const int64_t *sizes, size_t count, uint8_t *rows, uint8_t *status, int64_t *stamps_ns);

typedef struct fcsl_ros_composer fcsl_ros_composer_t;

/* As fcsl_ros_reader_new. */
fcsl_ros_composer_t *fcsl_ros_composer_new(const fcsl_ros_composer_plan_t *conversion, fcsl_error_t *error);
void fcsl_ros_composer_free(fcsl_ros_composer_t *composer);

/* Writes the message; `size` gets its bytes, at most the conversion's. Its terms read from `memories`, which the caller
 * vouches for. FCSL_ROS_RANGE or _NAN: a number that its field cannot hold, or a length beyond the list; FCSL_ROS_UNKNOWN: an
 * index of no choice; FCSL_ROS_STAMP: a time that a stamp cannot hold. */
fcsl_ros_status_t fcsl_ros_compose(const fcsl_ros_composer_t *composer, const uint8_t *const *memories, int64_t time_ns,
                                   uint8_t *cdr, uint32_t *size);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_ROS_H */
