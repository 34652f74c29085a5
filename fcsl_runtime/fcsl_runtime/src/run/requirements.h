/* SPDX-License-Identifier: Apache-2.0
 *
 * The monitor of a run: the requirements of its machine, evaluated after each tick.
 */
#ifndef FCSL_RUN_REQUIREMENTS_H
#define FCSL_RUN_REQUIREMENTS_H

#include "run_internal.h"

/* Copies what the requirements name, and steps the monitor. */
void fcsl_monitor_tick(fcsl_run_t *run);
/* For the recorder: without requirements, all null. */
fcsl_verdict_table_t fcsl_monitor_table(const fcsl_run_t *run);
/* A recording begins: what the verdicts are then is new to it. */
void fcsl_monitor_record(fcsl_run_t *run);
/* Into the recording: the verdicts after tick `tick`, if one has changed since they were recorded last. */
void fcsl_monitor_note(fcsl_run_t *run, uint64_t tick);
/* The monitor of the machine in a loaded library; null: it has no requirements. */
const fcsl_monitor_t *fcsl_monitor_in(void *library, const char *machine);
/* The struct of the machine was replaced. `remembered`: the monitor's of then; null: what the requirements remember is of
 * another flight, and they begin anew. */
void fcsl_monitor_restored(fcsl_run_t *run, const uint8_t *remembered);
void fcsl_monitor_close(fcsl_run_t *run);

#endif /* FCSL_RUN_REQUIREMENTS_H */
