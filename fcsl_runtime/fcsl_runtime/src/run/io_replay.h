/* SPDX-License-Identifier: Apache-2.0
 *
 * I/O replay. Instances that read hardware or call externs are impure: their outputs and state do not follow from the
 * run's inputs. A record keeps them, and a replay puts them in place instead of executing the instance.
 */
#ifndef FCSL_IO_REPLAY_H
#define FCSL_IO_REPLAY_H

#include "run_internal.h"

/* Finds the impure instances of run->machine and makes room for what they leave; 0, or -1. */
int fcsl_io_replay_open(fcsl_run_t *run, fcsl_error_t *error);
void fcsl_io_replay_free(fcsl_run_t *run);

/* fcsl_host_t.substitute of every run. */
int32_t fcsl_io_replay_apply(void *ctx, uint32_t instance);
/* fcsl_host_t.executed */
void fcsl_io_replay_executed(void *ctx, uint32_t instance);
/* Both are for runs that have impure instances (run->impure_count).
 * After a step: forgets substitutes of instances that did not execute. */
void fcsl_io_replay_settle(fcsl_run_t *run);
/* After the step of `tick`: notes what the impure instances that executed have left. */
void fcsl_io_replay_note(fcsl_run_t *run, uint64_t tick);

#endif /* FCSL_IO_REPLAY_H */
