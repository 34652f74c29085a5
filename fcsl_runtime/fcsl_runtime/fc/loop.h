/* SPDX-License-Identifier: Apache-2.0
 *
 * The step thread: sample, step, command, publish, at the machine's rate or as the HAL paces; then one command may be served.
 */
#ifndef FC_LOOP_H
#define FC_LOOP_H

#include <stdatomic.h>

#include "fcsl/fcsl_guard.h"
#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_write_queue.h"
#include "fcsl/fcsl_observers.h"
#include "fcsl/fcsl_ros_graph.h"
#include "fcsl/fcsl_telemetry.h"
#include "fcsl/fcsl_tick_stats.h"
#include "hal_topic.h"
#include "pacing.h"

typedef enum { GUARD_NONE, GUARD_THERE, GUARD_ENDED } guard_state_t;

/* What the loop publishes: the machine, what the HAL knows of itself, the verdicts on requirements, the times of instances. */
enum { LOOP_PARTS_MAX = 4 };

typedef struct {
    fcsl_run_t *run;
    fcsl_hal_t hal;
    fcsl_guard_link_t guard; /* takes the commands to the actuators, if there is one */
    guard_state_t guard_state;
    fcsl_vars_t *vars;  /* null without a variable server */
    fcsl_telemetry_t *telemetry; /* null without telemetry */
    fcsl_observers_t *observers; /* null without a bus for observers */
    fcsl_ros_graph_t *ros; /* null without a ROS 2 graph */
    atomic_int *stop;   /* set by a signal */
    uint64_t ticks_max; /* 0: no limit */
    missed_deadline_t missed_deadline;
    int serves_clients; /* while paused the step thread serves clients itself */
    int realtime; /* ticks are in the world's time, paced by the clock or a device; else as fast as the HAL allows */
    int recording;
    hal_topic_t hal_topic;
    int paused;
    int armed; /* the last command */
    uint64_t mode_changes; /* of the floating-point mode, that were logged */

    uint64_t sensed_ns; /* when a message of the coming tick went into the run; 0: none has */
    uint8_t *actuator_bytes;
    size_t actuator_capacity;
    fcsl_history_t history; /* the machine struct after every tick and command, for other threads */
    fcsl_tick_stats_t stats;
    char record_failure[512]; /* why recording ended; the monitor thread reads it */
    atomic_int record_failed; /* recordings that have, so far */
    atomic_int record_logged; /* of them, logged by the monitor thread */
    int record_over; /* this one has */
    int record_by_command; /* it waits for the disk while paused, and never in real time */
    int ended; /* the HAL ended the run, or something failed */
    int deadline_missed; /* MISSED_STOP ended the run */
    char failure[512]; /* empty unless something failed */
} loop_t;

/* Allocates messages and history; 0, or -1. */
int loop_open(loop_t *loop);
void loop_free(loop_t *loop);

/* Runs until the end: 0, or -1 with loop->failure. */
int loop_run(loop_t *loop);

/* Whether another tick may be made. */
int loop_may_tick(const loop_t *loop);
/* Makes one tick; 0 when the run is over. */
int loop_tick(loop_t *loop);
/* Publishes what holds now. */
void loop_publish(loop_t *loop);
/* What the HAL's field number `field` says in a publication of the history; 0 where it is no counter. */
uint64_t loop_hal_count(const loop_t *loop, const uint8_t *published, uint32_t field);
/* The verdicts in what was published (fcsl_run_gather_verdicts); meaningless without requirements. */
const uint8_t *loop_verdicts(const loop_t *loop, const uint8_t *published);
/* A checkpoint was restored, and the actuators are real ones: it arms none. */
void loop_require_arming(loop_t *loop);
/* What the variable server asks of this loop (serve.c). */
fcsl_vars_host_t loop_host(loop_t *loop);
/* Answers one waiting command, if any. */
void loop_serve(loop_t *loop);

#endif /* FC_LOOP_H */
