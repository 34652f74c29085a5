/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_RUN_SUMMARY_H
#define FC_RUN_SUMMARY_H

#include "loop.h"

/* Prints what the run counted and timed, and writes it to the file `summary_file` (null: to none). `ended` says why the run is
 * over. Reads the last published tick, because the step thread may hang in the next one; any thread may call it. Returns 0,
 * or -1 after a message. */
int write_run_summary(const loop_t *loop, const char *summary_file, const char *ended);

#endif /* FC_RUN_SUMMARY_H */
