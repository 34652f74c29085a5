/* SPDX-License-Identifier: Apache-2.0
 *
 * Rows of a conversion: numbers read, put through the change of axes, range-checked and written.
 */
#ifndef FCSL_ROS_NUMBER_H
#define FCSL_ROS_NUMBER_H

#include "fcsl/fcsl_ros.h"

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "ROS 2 messages are read and written as they lie in memory: a little-endian processor is needed"
#endif

/* Whether every row writes within `size` bytes and is the sum of terms that exist. Whether these may be read is up to the caller. */
int fcsl_ros_rows_valid(const fcsl_ros_row_t *rows, uint32_t row_count, uint32_t term_count, uint32_t size);

/* Computes a row and writes its numbers into `out`, up to the first that cannot be taken; a null anchor is FCSL_ROS_SHAPE. */
fcsl_ros_status_t fcsl_ros_row_apply(const fcsl_ros_row_t *row, const fcsl_ros_term_t *terms,
                                     const uint8_t *const *anchors, int nan_allowed, uint8_t *out);

/* Whether the guard's number has the value that it guards against; not where it is absent. */
int fcsl_ros_guard_holds(const fcsl_ros_guard_t *guard, const uint8_t *const *anchors);

#endif /* FCSL_ROS_NUMBER_H */
