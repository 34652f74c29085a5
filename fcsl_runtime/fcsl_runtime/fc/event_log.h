/* SPDX-License-Identifier: Apache-2.0
 *
 * What the log says of the events that algorithms report: a line for each, debug ones left out.
 */
#ifndef FC_EVENT_LOG_H
#define FC_EVENT_LOG_H

#include "fcsl/fcsl_run.h"

typedef struct {
    uint64_t next; /* the number of the first event that was not looked at */
} event_log_t;

/* Tells what has been reported since the last look. */
void event_log_update(event_log_t *log, const fcsl_run_t *run);

#endif /* FC_EVENT_LOG_H */
