/* SPDX-License-Identifier: Apache-2.0
 *
 * How long each instance of a measured machine takes (fcslc build --times).
 */
#ifndef FCSL_INSTANCE_TIMES_H
#define FCSL_INSTANCE_TIMES_H

#include "run_internal.h"

/* Allocates what a run of a measured machine keeps, and does nothing for another machine; 0, or -1. */
int fcsl_times_open(fcsl_run_t *run, fcsl_error_t *error);
void fcsl_times_close(fcsl_run_t *run);

/* Around a step of a run with times. */
void fcsl_times_begin(fcsl_run_t *run);
void fcsl_times_end(fcsl_run_t *run);

/* A recording has begun in this namespace: adds the topic of the times, if there are any; 0, or -1. */
int fcsl_times_record(fcsl_run_t *run, const char *name_space, fcsl_error_t *error);
/* Into the recording: the times of tick `tick`, which was the last. What finds no room is counted by the recorder. */
void fcsl_times_note(fcsl_run_t *run, uint64_t tick);

#endif /* FCSL_INSTANCE_TIMES_H */
