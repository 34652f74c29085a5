/* SPDX-License-Identifier: Apache-2.0
 *
 * The journal of a run: what its host writes (fcsl_write_kind_t), for one thread that follows. With a checkpoint and all writes
 * behind it a run is reproduced elsewhere.
 *
 * Writes are numbered from 1. Each publication of the host (fcsl_history.h) has the number of the next write: the memory that is
 * published and the writes from that number on are the run. The thread that steps only copies, into a ring that is allocated
 * at the start, and only while somebody follows; a write without room there leaves a gap in the numbers.
 */
#ifndef FCSL_JOURNAL_H
#define FCSL_JOURNAL_H

#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_journal fcsl_journal_t;

/* The journal of the run, which owns it: the same one for every call. Null with `error`. */
fcsl_journal_t *fcsl_run_journal(fcsl_run_t *run, fcsl_error_t *error);
/* The number of the next write, or 0: nobody follows. From the thread that owns the run, at each publication: here it learns
 * whether anybody does. Who begins to follow finds a gap before the first write. */
uint64_t fcsl_run_next_write(fcsl_run_t *run);

/* ---- the thread that follows ------------------------------------------------------------------------------------ */

void fcsl_journal_follow(fcsl_journal_t *journal, int follow);
/* Bytes of the longest message: a write, or a checkpoint. */
size_t fcsl_journal_capacity(const fcsl_journal_t *journal);
/* The oldest write with a number below `end` as fcsl_msgs/HostWrite: the bytes of the message, and *number. 0: there is none. */
size_t fcsl_journal_take(fcsl_journal_t *journal, uint64_t end, uint64_t *number, uint8_t *bytes, size_t capacity);
/* Forgets what is there. */
void fcsl_journal_pass(fcsl_journal_t *journal);
/* A machine struct after `tick` ticks as fcsl_msgs/Checkpoint: the bytes of the message. */
size_t fcsl_journal_checkpoint(const fcsl_journal_t *journal, const void *data, uint64_t tick, uint8_t *bytes,
                               size_t capacity);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_JOURNAL_H */
