/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_TRACE_H
#define FCSL_TRACE_H

#include "run_internal.h"

/* Takes a row into every trace of the run; after each completed tick. */
void fcsl_trace_take(const fcsl_run_t *run);
/* Ends the traces that are left. */
void fcsl_trace_free(fcsl_run_t *run);

#endif /* FCSL_TRACE_H */
