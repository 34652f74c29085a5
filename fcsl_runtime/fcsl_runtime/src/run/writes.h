/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_WRITES_H
#define FCSL_WRITES_H

#include "messages/record_messages.h"
#include "record/write_queue.h"
#include "run_internal.h"

/* Whether host writes are recorded or queued: a recorder, or the write queue's reader. */
static inline int fcsl_writes_noted(const fcsl_run_t *run)
{
    return run->recorder != NULL || fcsl_write_queue_is_enabled(run->write_queue);
}
/* Tells them of a host write that `tick` is the first to see. */
void fcsl_note_write_at(fcsl_run_t *run, uint64_t tick, const fcsl_write_t *write);
/* The same of the coming tick. */
void fcsl_note_write(fcsl_run_t *run, const fcsl_write_t *write);

#endif /* FCSL_WRITES_H */
