/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_write_queue.h for the thread that owns the run.
 */
#ifndef FCSL_RECORD_WRITE_QUEUE_H
#define FCSL_RECORD_WRITE_QUEUE_H

#include "fcsl/fcsl_write_queue.h"
#include "messages/record_messages.h"
#include "ring.h"

struct fcsl_write_queue {
    const fcsl_machine_t *machine;
    size_t capacity; /* of the longest message */
    fcsl_ring_t ring;
    atomic_int requested; /* by the reading thread */

    /* The thread that owns the run. */
    int enabled;   /* as it was requested at the last publication */
    uint64_t next; /* write's number */
};

/* Null: out of memory. */
fcsl_write_queue_t *fcsl_write_queue_open(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor);
/* What fcsl_run_next_write returns. */
uint64_t fcsl_write_queue_next_write(fcsl_write_queue_t *queue);

/* Accepts null. */
static inline int fcsl_write_queue_is_enabled(const fcsl_write_queue_t *queue)
{
    return queue != NULL && queue->enabled;
}

/* Copies a write that `tick` is the first to see. */
void fcsl_write_queue_put(fcsl_write_queue_t *queue, uint64_t tick, const fcsl_write_t *write);
/* Accepts null. */
void fcsl_write_queue_close(fcsl_write_queue_t *queue);

#endif /* FCSL_RECORD_WRITE_QUEUE_H */
