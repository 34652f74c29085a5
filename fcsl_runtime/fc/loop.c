/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "loop.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* A sleeping loop looks up this often for a stop signal and for commands. */
static const uint64_t SLICE_NS = 50000000u;
/* Behind by more than this (and by a period), the schedule begins anew: a burst of old ticks helps nobody. */
static const uint64_t BEHIND_MAX_NS = 100000000u;

int loop_open(loop_t *loop)
{
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    loop->sensor_capacity = fcsl_frame_capacity(machine, FCSL_SENSOR);
    loop->actuator_capacity = fcsl_frame_capacity(machine, FCSL_ACTUATOR);
    loop->sensor_frame = calloc(1, loop->sensor_capacity);
    loop->actuator_frame = calloc(1, loop->actuator_capacity);
    return loop->sensor_frame != NULL && loop->actuator_frame != NULL ? 0 : -1;
}

void loop_free(loop_t *loop)
{
    free(loop->sensor_frame);
    free(loop->actuator_frame);
}

static void fail(loop_t *loop, const char *text)
{
    (void)snprintf(loop->failure, sizeof loop->failure, "%s", text);
    loop->ended = 1;
}

/* Judges what a HAL call returned: 1 to go on, 0 when the run is over. */
static int goes_on(loop_t *loop, fcsl_hal_status_t status)
{
    if (status == FCSL_HAL_OK || status == FCSL_HAL_NONE) {
        return 1;
    }
    if (status == FCSL_HAL_CLOSED) {
        loop->ended = 1;
    } else {
        fail(loop, loop->hal.explain(loop->hal.ctx));
    }
    return 0;
}

static void lose_record(loop_t *loop, const fcsl_error_t *error)
{
    fcsl_error_t ignored;
    loop->counters.records_dropped = fcsl_run_record_dropped(loop->run);
    (void)fcsl_run_record_stop(loop->run, &ignored);
    loop->recording = 0;
    loop->record_failed = 1;
    if (loop->lossless) {
        fail(loop, error->text);
    } else {
        (void)fprintf(stderr, "fcsl-fc: %s; flying on without\n", error->text);
    }
}

/* One tick; returns 0 when the run is over. */
static int run_tick(loop_t *loop)
{
    fcsl_error_t error;
    const uint64_t tick = fcsl_run_tick(loop->run);
    size_t size = 0;
    if (!goes_on(loop, loop->hal.sample(loop->hal.ctx, tick, loop->sensor_frame, loop->sensor_capacity, &size))) {
        return 0;
    }
    if (size > 0) {
        /* A refused frame is counted by the run and changes nothing: the channel grows old instead. */
        (void)fcsl_run_sense(loop->run, loop->sensor_frame, size, &error);
    }
    if (fcsl_run_step(loop->run, 1, &error) != 0) {
        lose_record(loop, &error);
        if (loop->ended || fcsl_run_step(loop->run, 1, &error) != 0) {
            return 0;
        }
    }
    loop->counters.ticks++;
    const int64_t bytes = fcsl_run_actuate(loop->run, loop->actuator_frame, loop->actuator_capacity);
    if (bytes < 0) {
        fail(loop, "the actuator frame does not fit its buffer");
        return 0;
    }
    return goes_on(loop, loop->hal.actuate(loop->hal.ctx, tick, loop->actuator_frame, (size_t)bytes));
}

static int may_tick(const loop_t *loop)
{
    return !loop->ended && !atomic_load(loop->stop) && (loop->ticks_max == 0 || loop->counters.ticks < loop->ticks_max);
}

static void run_ticks(loop_t *loop, command_t *command)
{
    for (uint64_t i = 0; i < command->count; i++) {
        if (!may_tick(loop) || !run_tick(loop)) {
            command->status = loop->failure[0] != '\0' ? COMMAND_FAILED : COMMAND_ENDED;
            (void)snprintf(command->error.text, sizeof command->error.text, "%.480s",
                           loop->failure[0] != '\0' ? loop->failure : "the run has ended");
            return;
        }
    }
}

static void act(loop_t *loop, command_t *command)
{
    const uint32_t size = fcsl_run_machine(loop->run)->size;
    const fcsl_field_t *field = NULL;
    int refused = 0;
    switch (command->kind) {
    case COMMAND_NOTHING:
        break;
    case COMMAND_GET:
        field = &fcsl_run_machine(loop->run)->fields[command->field];
        memcpy(command->bytes, (const uint8_t *)fcsl_run_data(loop->run) + field->offset, field->size);
        break;
    case COMMAND_SAVE:
        refused = fcsl_run_save(loop->run, command->bytes, size, &command->error);
        break;
    case COMMAND_SET:
        refused =
            fcsl_run_set(loop->run, command->field, command->element, command->bytes, command->size, &command->error);
        break;
    case COMMAND_PAUSE:
        loop->paused = 1;
        break;
    case COMMAND_RESUME:
        loop->paused = 0;
        break;
    case COMMAND_TICK:
        if (loop->paused) {
            run_ticks(loop, command);
        } else {
            command->status = COMMAND_RUNNING;
        }
        break;
    case COMMAND_SET_STATE:
        refused = fcsl_run_set_state(loop->run, command->state, &command->error);
        break;
    case COMMAND_RESTORE:
        refused = fcsl_run_restore(loop->run, command->bytes, size, &command->error);
        break;
    }
    if (refused != 0) {
        command->status = COMMAND_REFUSED;
    }
}

void loop_count(loop_t *loop)
{
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    const uint8_t *data = fcsl_run_data(loop->run);
    loop->counters.faults = 0;
    loop->counters.overruns = 0;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        uint64_t count = 0;
        memcpy(&count, data + machine->instances[i].faults_offset, sizeof count);
        loop->counters.faults += count;
        memcpy(&count, data + machine->instances[i].overruns_offset, sizeof count);
        loop->counters.overruns += count;
    }
    if (loop->recording) {
        loop->counters.records_dropped = fcsl_run_record_dropped(loop->run);
    }
    loop->counters.frames_refused = fcsl_run_frames_refused(loop->run);
    loop->counters.hardware_failures = fcsl_run_hardware_failures(loop->run);
}

void loop_serve(loop_t *loop)
{
    command_t *command = loop->mailbox != NULL ? mailbox_take(loop->mailbox) : NULL;
    if (command == NULL) {
        return;
    }
    command->status = COMMAND_OK;
    act(loop, command);
    loop_count(loop);
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    const uint8_t *data = fcsl_run_data(loop->run);
    command->tick = fcsl_run_tick(loop->run);
    memcpy(&command->current_state, data + machine->state_offset, sizeof command->current_state);
    memcpy(&command->next_state, data + machine->next_state_offset, sizeof command->next_state);
    command->paused = loop->paused;
    command->counters = loop->counters;
    mailbox_answer(loop->mailbox);
}

static uint64_t now_ns(void)
{
    return fcsl_run_monotonic_ns(NULL);
}

/* Sleeps until `deadline` in slices; returns 0 when the loop should look around instead of ticking. */
static int sleep_until(loop_t *loop, uint64_t deadline)
{
    for (;;) {
        const uint64_t now = now_ns();
        if (now >= deadline) {
            return 1;
        }
        const uint64_t slice = deadline - now > SLICE_NS ? now + SLICE_NS : deadline;
        const struct timespec until = {.tv_sec = (time_t)(slice / 1000000000u), .tv_nsec = (long)(slice % 1000000000u)};
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        loop_serve(loop);
        if (atomic_load(loop->stop) || loop->paused || loop->ended) {
            return 0;
        }
    }
}

static void idle(loop_t *loop)
{
    const uint64_t deadline = now_ns() + SLICE_NS;
    if (loop->mailbox != NULL) {
        mailbox_wait(loop->mailbox, deadline);
    } else {
        const struct timespec pause = {.tv_nsec = (long)SLICE_NS};
        (void)nanosleep(&pause, NULL);
    }
}

/* Where the clock's schedule stands: tick `anchor_tick` is due at `anchor_ns`, the others at exact distances from it. */
typedef struct {
    int set;
    uint64_t anchor_ns;
    uint64_t done; /* ticks since the anchor */
} schedule_t;

/* Waits for the next tick's time and notes lateness; returns 0 when the loop should look around instead of ticking. */
static int keep_time(loop_t *loop, schedule_t *schedule)
{
    if (!schedule->set) {
        *schedule = (schedule_t){.set = 1, .anchor_ns = now_ns()};
    }
    const uint64_t due = schedule->anchor_ns + fcsl_run_tick_time_ns(loop->run, schedule->done);
    const uint64_t next = schedule->anchor_ns + fcsl_run_tick_time_ns(loop->run, schedule->done + 1);
    if (!sleep_until(loop, due)) {
        return 0;
    }
    const uint64_t now = now_ns();
    schedule->done++;
    if (now > next) {
        loop->counters.late++;
        if (now - due > BEHIND_MAX_NS && now - due > 2 * (next - due)) {
            loop->counters.skipped++;
            *schedule = (schedule_t){.set = 1, .anchor_ns = now, .done = 1};
        }
    }
    return 1;
}

int loop_run(loop_t *loop)
{
    schedule_t schedule = {0};
    while (may_tick(loop)) {
        loop_serve(loop);
        if (loop->paused) {
            schedule.set = 0;
            if (may_tick(loop)) {
                idle(loop);
            }
        } else if (may_tick(loop) && (!loop->realtime || keep_time(loop, &schedule))) {
            (void)run_tick(loop);
        }
    }
    loop_count(loop);
    return loop->failure[0] != '\0' || loop->record_failed ? -1 : 0;
}
