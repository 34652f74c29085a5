/* SPDX-License-Identifier: Apache-2.0
 *
 * What the step thread may ask of the system: a real-time priority, memory that stays, a processor of its own.
 */
#ifndef FC_REALTIME_H
#define FC_REALTIME_H

#include "fcsl/fcsl_run.h"

typedef struct {
    int priority;    /* of SCHED_FIFO, 1 to 99; 0: as started */
    int lock_memory;
    int cpu;         /* the step thread's processor; -1: any */
} realtime_t;

/* From the step thread before another one is started: takes the priority, which other threads do not inherit, keeps them off
 * the step thread's processor, and finds out whether memory may be locked. 0, or -1 with what is missing and how to get it. */
int realtime_begin(const realtime_t *realtime, fcsl_error_t *error);

/* From the step thread when all that runs is loaded and allocated: locks memory, goes to its processor. 0, or -1. */
int realtime_enter(const realtime_t *realtime, fcsl_error_t *error);

#endif /* FC_REALTIME_H */
