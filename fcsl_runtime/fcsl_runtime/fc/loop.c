/* SPDX-License-Identifier: Apache-2.0
 *
 * The step thread: sample, step, command, publish, serve one command, sleep.
 */
#define _GNU_SOURCE
#include "loop.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_monotonic.h"

/* A sleeping loop looks up this often for a stop signal and for commands. */
static const uint64_t SLICE_NS = 50000000u;
/* How many publications a reader may be behind; less for machines so large that they would fill the memory. */
enum { HISTORY_SLOTS = 64, HISTORY_BYTES = 64 << 20 };

static uint32_t history_slots(uint32_t size)
{
    uint32_t slots = HISTORY_SLOTS;
    while (slots > 2 && (uint64_t)slots * size > HISTORY_BYTES) {
        slots /= 2;
    }
    return slots;
}

int loop_open(loop_t *loop)
{
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    uint32_t verdict_bytes = 0;
    const void *verdicts = fcsl_run_gather_verdicts(loop->run, &verdict_bytes);
    fcsl_part_t parts[LOOP_PARTS_MAX] = {{.data = fcsl_run_data(loop->run), .size = machine->size}};
    uint32_t count = 1;
    if (loop->hal.field_count > 0) {
        parts[count++] = (fcsl_part_t){.data = loop->hal.counters, .size = loop->hal.counter_bytes};
    }
    if (verdicts != NULL) {
        parts[count++] = (fcsl_part_t){.data = verdicts, .size = verdict_bytes};
    }
    uint32_t time_bytes = 0;
    const fcsl_time_row_t *times = fcsl_run_times(loop->run, &time_bytes);
    if (times != NULL) {
        parts[count++] = (fcsl_part_t){.data = times, .size = time_bytes};
    }
    loop->actuator_capacity = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    loop->actuator_bytes = calloc(1, loop->actuator_capacity);
    if (loop->actuator_bytes == NULL ||
        fcsl_history_open(&loop->history, parts, count, history_slots(machine->size)) != 0) {
        return -1;
    }
    loop_publish(loop);
    return 0;
}

void loop_free(loop_t *loop)
{
    hal_topic_close(&loop->hal_topic);
    free(loop->actuator_bytes);
    fcsl_history_free(&loop->history);
}

static void publish(loop_t *loop, uint64_t time_ns)
{
    uint32_t verdict_bytes = 0;
    (void)fcsl_run_gather_verdicts(loop->run, &verdict_bytes);
    loop->hal.count(loop->hal.ctx);
    const fcsl_moment_t moment = {.tick = fcsl_run_tick(loop->run),
                                  .time_ns = time_ns,
                                  .paused = (uint64_t)loop->paused,
                                  .next_write = fcsl_run_next_write(loop->run),
                                  .requires_arming = (uint64_t)fcsl_run_requires_arming(loop->run)};
    fcsl_history_publish(&loop->history, &moment);
}

void loop_publish(loop_t *loop)
{
    publish(loop, fcsl_monotonic_ns());
}

const uint8_t *loop_verdicts(const loop_t *loop, const uint8_t *published)
{
    return published + fcsl_history_part(&loop->history, loop->hal.field_count > 0 ? 2 : 1);
}

uint64_t loop_hal_count(const loop_t *loop, const uint8_t *published, uint32_t field)
{
    const fcsl_field_t *counted = &loop->hal.fields[field];
    uint64_t value = 0;
    if (counted->type == FCSL_U64 && counted->count == 1u) {
        memcpy(&value, published + fcsl_history_part(&loop->history, 1) + counted->offset, sizeof value);
    }
    return value;
}

static void fail(loop_t *loop, const char *text)
{
    (void)snprintf(loop->failure, sizeof loop->failure, "%s", text);
    loop->ended = 1;
}

/* Judges what a HAL call returned: 1 to go on, 0 when the run is over. */
static int goes_on(loop_t *loop, fcsl_hal_status_t status)
{
    if (status == FCSL_HAL_OK) {
        return 1;
    }
    if (status == FCSL_HAL_CLOSED || status == FCSL_HAL_AGAIN) {
        loop->ended = 1;
    } else {
        fail(loop, loop->hal.explain(loop->hal.ctx));
    }
    return 0;
}

/* The first change is told; the instance that made it makes it in every tick. */
static void watch_mode(loop_t *loop)
{
    const char *by = NULL;
    const uint64_t changes = fcsl_run_mode_changes(loop->run, &by);
    if (changes > 0 && loop->mode_changes == 0) {
        char text[FCSL_LOG_BYTES];
        (void)snprintf(text, sizeof text,
                       "instance `%.100s` left another floating-point mode: bits of its tick may differ in a replay",
                       by);
        fcsl_log_write(loop->hal.log, text);
    }
    loop->mode_changes = changes;
}

/* Only a lossless recording makes a step fail. Of the others the end tells: a disk must not disturb a tick. A client that has
 * asked for both ticks and recording hears of it (serve.c), and may go on without. */
static int step(loop_t *loop)
{
    fcsl_error_t error;
    if (fcsl_run_step(loop->run, 1, &error) == 0) {
        watch_mode(loop);
        return 1;
    }
    if (!loop->paused || !loop->record_by_command) {
        fail(loop, error.text);
    }
    return 0;
}

/* In real time a disk that is full does not end the flight; the monitor thread logs it, since printing may wait. Two that fail
 * between its looks are told as one. */
static void watch_recording(loop_t *loop)
{
    fcsl_error_t error;
    fcsl_tick_stats_put(&loop->stats.records_dropped, fcsl_run_record_dropped(loop->run));
    if (!loop->record_over && fcsl_run_record_check(loop->run, &error) != 0) {
        loop->record_over = 1;
        const int failed = atomic_load_explicit(&loop->record_failed, memory_order_relaxed);
        if (atomic_load_explicit(&loop->record_logged, memory_order_acquire) == failed) {
            (void)snprintf(loop->record_failure, sizeof loop->record_failure, "%s", error.text);
        }
        atomic_store_explicit(&loop->record_failed, failed + 1, memory_order_release);
    }
}

static void count(loop_t *loop)
{
    fcsl_tick_stats_t *stats = &loop->stats;
    fcsl_tick_stats_put(&stats->ticks, fcsl_tick_stats_get(&stats->ticks) + 1u);
    fcsl_tick_stats_put(&stats->messages_refused, fcsl_run_messages_refused(loop->run));
    fcsl_tick_stats_put(&stats->hardware_failures, fcsl_run_hardware_failures(loop->run));
    if (loop->recording) {
        watch_recording(loop);
    }
}

/* Tells the HAL, and people, that the arm flag changes. */
static int arm(loop_t *loop, int armed)
{
    char text[FCSL_LOG_BYTES];
    if (armed == loop->armed) {
        return 1;
    }
    loop->armed = armed;
    if (fcsl_run_machine(loop->run)->arm_field == FCSL_NONE) {
        return goes_on(loop, loop->hal.arm(loop->hal.ctx, armed)); /* always armed */
    }
    (void)snprintf(text, sizeof text, "%s at tick %" PRIu64, armed ? "armed" : "disarmed",
                   fcsl_run_tick(loop->run) - 1u);
    fcsl_log_write(loop->hal.log, text);
    return goes_on(loop, loop->hal.arm(loop->hal.ctx, armed));
}

void loop_require_arming(loop_t *loop)
{
    fcsl_run_require_arming(loop->run);
    if (fcsl_run_requires_arming(loop->run)) {
        fcsl_log_write(loop->hal.log,
                       "armed in the checkpoint: actuators stay safe until the machine disarms and arms anew");
    }
}

/* Steps, commands and publishes; 0 when the run is over. */
static int act_on_sensors(loop_t *loop, uint64_t begun_ns)
{
    if (!step(loop)) {
        return 0;
    }
    count(loop);
    fcsl_message_t message;
    if (fcsl_run_actuate_message(loop->run, loop->actuator_bytes, loop->actuator_capacity, &message) != 0) {
        fail(loop, "an actuator channel holds what its type does not have: there is no message of it");
        return 0;
    }
    if (fcsl_guard_command(&loop->guard, &message, begun_ns) != 0) {
        fail(loop, "the actuator message does not fit the slot of fcsl-guard");
        return 0;
    }
    const int on = arm(loop, message.armed) && goes_on(loop, loop->hal.command(loop->hal.ctx, &message));
    publish(loop, begun_ns);
    if (loop->recording) {
        hal_topic_write(&loop->hal_topic, &loop->hal, loop->run);
    }
    return on;
}

/* A refused message is counted by the run and changes nothing: the channel grows old instead. */
static void sensed(void *ctx, const fcsl_message_t *message)
{
    loop_t *loop = ctx;
    fcsl_error_t error;
    loop->sensed_ns = fcsl_monotonic_ns();
    (void)fcsl_run_sense_message(loop->run, message, &error);
}

/* Brings the sensors of the coming tick into the run. */
static fcsl_hal_status_t sample(loop_t *loop)
{
    const fcsl_sink_t to = {.ctx = loop, .sensed = sensed};
    loop->sensed_ns = 0;
    return loop->hal.sample(loop->hal.ctx, fcsl_run_tick(loop->run), &to);
}

/* The tick of what was sampled; 0 when the run is over. */
static int make_tick(loop_t *loop, fcsl_hal_status_t sampled)
{
    if (!goes_on(loop, sampled)) {
        return 0;
    }
    const uint64_t begun_ns = loop->sensed_ns > 0u ? loop->sensed_ns : fcsl_monotonic_ns();
    fcsl_tick_stats_put(&loop->stats.tick, fcsl_run_tick(loop->run));
    fcsl_tick_stats_put(&loop->stats.begun_ns, begun_ns);
    const int on = act_on_sensors(loop, begun_ns);
    fcsl_tick_stats_put(&loop->stats.begun_ns, 0);
    fcsl_histogram_add(&loop->stats.tick_time, fcsl_monotonic_ns() - begun_ns);
    return on;
}

int loop_tick(loop_t *loop)
{
    fcsl_hal_status_t sampled = FCSL_HAL_WAITING;
    while (sampled == FCSL_HAL_WAITING) { /* ends at the HAL's time-out, or when it is interrupted */
        sampled = sample(loop);
    }
    return make_tick(loop, sampled);
}

int loop_may_tick(const loop_t *loop)
{
    return !loop->ended && !atomic_load(loop->stop) &&
           (loop->ticks_max == 0 || fcsl_tick_stats_get(&loop->stats.ticks) < loop->ticks_max);
}

static void idle(loop_t *loop)
{
    const uint64_t deadline = fcsl_monotonic_ns() + SLICE_NS;
    if (loop->vars != NULL && loop->serves_clients) {
        fcsl_vars_wait_serving(loop->vars, deadline);
    } else if (loop->vars != NULL) {
        fcsl_vars_wait(loop->vars, deadline);
    } else {
        const struct timespec pause = {.tv_nsec = (long)SLICE_NS};
        (void)nanosleep(&pause, NULL);
    }
}

/* When the pause is over, or the run. */
static void leave_clients(loop_t *loop)
{
    if (loop->vars != NULL) {
        fcsl_vars_stop_serving(loop->vars);
    }
}

/* Sleeps until `deadline`, in slices with a command at most after each; the last one ends in the tick itself. Returns the time,
 * or 0 when the loop should look around instead of ticking. */
static uint64_t sleep_until(loop_t *loop, uint64_t deadline)
{
    const fcsl_hal_t *hal = &loop->hal;
    uint64_t now = hal->clock.now_ns(hal->clock.ctx);
    while (now < deadline) {
        hal->clock.wait(hal->clock.ctx, deadline - now > SLICE_NS ? now + SLICE_NS : deadline);
        now = hal->clock.now_ns(hal->clock.ctx);
        if (now < deadline) {
            loop_serve(loop);
        }
        if (loop->paused || !loop_may_tick(loop)) {
            return 0;
        }
    }
    return now;
}

static void stop_late(loop_t *loop, uint64_t lateness_ns)
{
    char text[sizeof loop->failure];
    (void)snprintf(text, sizeof text,
                   "tick %" PRIu64 " is %" PRIu64 " us late, a period is %" PRIu64
                   " us: --missed-deadline stop ends the run before it",
                   fcsl_run_tick(loop->run), lateness_ns / 1000u, fcsl_run_tick_time_ns(loop->run, 1) / 1000u);
    loop->deadline_missed = 1;
    fail(loop, text);
}

/* Waits for the next tick's time; returns 0 when the loop should look around instead of ticking. */
static int keep_time(loop_t *loop, pacing_t *pacing)
{
    const uint64_t now = sleep_until(loop, pacing_deadline(pacing));
    if (now == 0) {
        return 0;
    }
    fcsl_tick_stats_t *stats = &loop->stats;
    const arrival_t found = pacing_arrive(pacing, now);
    fcsl_histogram_add(&stats->lateness, found.lateness_ns);
    fcsl_tick_stats_put(&stats->deadlines_missed, fcsl_tick_stats_get(&stats->deadlines_missed) + found.missed);
    fcsl_tick_stats_put(&stats->ticks_skipped, fcsl_tick_stats_get(&stats->ticks_skipped) + found.skipped);
    if (found.verdict == PACING_STOP) {
        stop_late(loop, found.lateness_ns);
    }
    return found.verdict == PACING_TICK;
}

int loop_run(loop_t *loop)
{
    const fcsl_hal_t *hal = &loop->hal;
    pacing_t pacing =
        pacing_start(loop->missed_deadline, fcsl_run_machine(loop->run)->tick_hz, hal->clock.now_ns(hal->clock.ctx));
    while (loop_may_tick(loop)) {
        if (loop->paused) {
            idle(loop);
            loop->hal.alive(loop->hal.ctx);
            loop_serve(loop);
            if (!loop->paused) {
                leave_clients(loop);
            }
            pacing.anchor_ns = hal->clock.now_ns(hal->clock.ctx);
            pacing.next = 0;
        } else if (!loop->realtime || hal->paces != FCSL_PACED_BY_HOST || keep_time(loop, &pacing)) {
            /* A simulator may be paused for long: clients are served while it is waited for. */
            const fcsl_hal_status_t sampled = sample(loop);
            if (sampled != FCSL_HAL_WAITING) {
                (void)make_tick(loop, sampled);
            }
            loop_serve(loop);
        }
    }
    leave_clients(loop);
    if (loop->armed) {
        if (hal->arm(hal->ctx, 0) != FCSL_HAL_OK && loop->failure[0] == '\0') {
            fail(loop, hal->explain(hal->ctx));
        }
        loop_publish(loop);
    }
    return loop->failure[0] != '\0' ? -1 : 0;
}
