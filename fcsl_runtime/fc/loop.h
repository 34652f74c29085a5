/* SPDX-License-Identifier: Apache-2.0
 *
 * The step thread: sample, step, actuate, at the machine's rate or as the HAL paces; commands are served in between.
 */
#ifndef FC_LOOP_H
#define FC_LOOP_H

#include <stdatomic.h>

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_run.h"
#include "mailbox.h"

typedef struct {
    fcsl_run_t *run;
    fcsl_hal_t hal;
    mailbox_t *mailbox;  /* null without a command server */
    atomic_int *stop;    /* set by a signal */
    uint64_t ticks_max;  /* 0: no limit */
    int realtime;        /* paced by the clock; else as fast as the HAL allows */
    int recording;
    int lossless;        /* a failed recording ends the run */
    int paused;

    uint8_t *sensor_frame;
    size_t sensor_capacity;
    uint8_t *actuator_frame;
    size_t actuator_capacity;
    counters_t counters; /* brought up to date by loop_count */
    int ended;           /* the HAL ended the run, or something failed */
    int record_failed;
    char failure[512];   /* empty unless something failed */
} loop_t;

/* Allocates the frames; 0, or -1. */
int loop_open(loop_t *loop);
void loop_free(loop_t *loop);

/* Runs until the end: 0, or -1 with loop->failure. */
int loop_run(loop_t *loop);
void loop_count(loop_t *loop);
/* Answers one waiting command, if any; after the end all of them are refused. */
void loop_serve(loop_t *loop);

#endif /* FC_LOOP_H */
