/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_EVENTS_H
#define FCSL_EVENTS_H

#include "run_internal.h"

/* Without events of its machine a run has none of these (run->events is null). */
int fcsl_events_open(fcsl_run_t *run, fcsl_error_t *error);
void fcsl_events_free(fcsl_run_t *run);
/* Before a tick. */
void fcsl_events_begin(fcsl_run_t *run);
/* After `tick`: tells its events, as often as each may be told. */
void fcsl_events_tell(fcsl_run_t *run, uint64_t tick);
/* From here on each may be told as often as at the beginning: where a record begins, and where a run is restored, so that a replay
 * tells the same. */
void fcsl_events_restart(fcsl_run_t *run);

/* Puts those of the tick just completed into the recording. */
void fcsl_events_record(fcsl_run_t *run, uint64_t tick);

/* Of one event in a record: its site within the instance, its values. */
enum { FCSL_EVENT_RECORD_BYTES = 8 * (1 + FCSL_EVENT_VALUES) };
enum { FCSL_EVENTS_LEFT_MAX = FCSL_EVENTS_PER_TICK * FCSL_EVENT_RECORD_BYTES };

/* What an instance with I/O has reported in the tick just completed, for the record. Returns its bytes. */
uint32_t fcsl_events_left(const fcsl_run_t *run, uint32_t instance, uint8_t bytes[FCSL_EVENTS_LEFT_MAX]);
/* In a replay: what fcsl_run_substitute_events was given of this instance becomes its events of the tick that runs. */
void fcsl_events_substitute(fcsl_run_t *run, uint32_t instance);
/* Those of instances that did not run are forgotten. */
void fcsl_events_settle(fcsl_run_t *run);

#endif /* FCSL_EVENTS_H */
