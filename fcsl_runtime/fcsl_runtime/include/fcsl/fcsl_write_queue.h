/* SPDX-License-Identifier: Apache-2.0
 *
 * The queue of a run's host writes (fcsl_write_kind_t), for one reading thread. With a checkpoint and all writes
 * behind it a run is reproduced elsewhere.
 *
 * Writes are numbered from 1. Each publication of the host (fcsl_history.h) has the number of the next write: the memory that is
 * published and the writes from that number on are the run. The thread that steps only copies, into a ring that is allocated
 * at the start, and only while it is enabled; a write without room there leaves a gap in the numbers.
 */
#ifndef FCSL_WRITE_QUEUE_H
#define FCSL_WRITE_QUEUE_H

#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_write_queue fcsl_write_queue_t;

/* The run's queue, which the run owns: the same one for every call. Null with `error`. */
fcsl_write_queue_t *fcsl_run_write_queue(fcsl_run_t *run, fcsl_error_t *error);
/* The number of the next write, or 0: the queue is not enabled. From the thread that owns the run, at each publication: here a change of
 * fcsl_write_queue_enable takes effect. A reader that enables it finds a gap before the first write. */
uint64_t fcsl_run_next_write(fcsl_run_t *run);

/* ---- the reading thread --------------------------------------------------------------------------------------- */

void fcsl_write_queue_enable(fcsl_write_queue_t *queue, int enabled);
/* Bytes of the longest message: a write, or a checkpoint. */
size_t fcsl_write_queue_capacity(const fcsl_write_queue_t *queue);
/* The oldest write with a number below `end` as fcsl_msgs/HostWrite: the bytes of the message, and *number. 0: there is none. */
size_t fcsl_write_queue_take(fcsl_write_queue_t *queue, uint64_t end, uint64_t *number, uint8_t *bytes,
                             size_t capacity);
/* Drops what is there. */
void fcsl_write_queue_skip(fcsl_write_queue_t *queue);
/* A machine struct after `tick` ticks as fcsl_msgs/Checkpoint: the bytes of the message. */
size_t fcsl_write_queue_checkpoint(const fcsl_write_queue_t *queue, const void *data, uint64_t tick, uint8_t *bytes,
                                   size_t capacity);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_WRITE_QUEUE_H */
