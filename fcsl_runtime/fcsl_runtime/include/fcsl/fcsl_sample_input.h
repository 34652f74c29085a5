/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages of ROS 2 that come in while a machine runs: their values become samples of its channels.
 */
#ifndef FCSL_SAMPLE_INPUT_H
#define FCSL_SAMPLE_INPUT_H

#include "fcsl/fcsl_ros.h"
#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Clocks of two computers are never quite equal, and /clock comes a little after what it is the time of: a message stamped
 * ahead of now by at most this is of now. */
#define FCSL_ROS_AHEAD_NS 50000000

typedef struct fcsl_sample_input fcsl_sample_input_t;

/* Values of messages become samples of the run's sensor channels: value i of channels[i], whose field is as large. Run and
 * reader must outlive the input; a reader serves one. */
fcsl_sample_input_t *fcsl_sample_input_new(fcsl_run_t *run, fcsl_ros_reader_t *reader, const uint32_t *channels,
                                           uint32_t channel_count, fcsl_error_t *error);
void fcsl_sample_input_free(fcsl_sample_input_t *input);

/* Takes a message for the coming tick; `now_ns` is the time by the clock that the stamps are of. The samples are as old as
 * the stamp says, rounded down to whole ticks; a stamp of 0 says nothing, then they are new. Each value that is refused
 * leaves its channel alone, and so does value i where missing[i] is not 0 (`missing` may be null): an injected dropout.
 * Returns how many channels were written. */
uint32_t fcsl_sample_input_deliver(fcsl_sample_input_t *input, const uint8_t *cdr, size_t size, int64_t now_ns,
                                   const uint8_t *missing);

/* FCSL_ROS_STATUSES counts: of messages of which something was taken, and of messages and values refused, by reason. */
const uint64_t *fcsl_sample_input_counts(const fcsl_sample_input_t *input);

/* How far the stamp of the newest readable message lay behind its `now_ns` (negative: ahead); 0 where it had no stamp. */
int64_t fcsl_sample_input_behind_ns(const fcsl_sample_input_t *input);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_SAMPLE_INPUT_H */
