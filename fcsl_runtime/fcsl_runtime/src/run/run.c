/* SPDX-License-Identifier: Apache-2.0
 *
 * Hosting a machine: checkpoints, actuator messages, clock, ticks, messages. What a host writes between ticks: writes.c.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <stdlib.h>
#include <time.h>

#include "fcsl/fcsl_fp_mode.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_scalar.h"
#include "events.h"
#include "instance_times.h"
#include "io_replay.h"
#include "machine/monitor_memory.h"
#include "requirements.h"
#include "record/recorder.h"
#include "run_internal.h"
#include "trace.h"
#include "fcsl/fcsl_tick_time.h"
#include "writes.h"

const fcsl_machine_t *fcsl_run_machine(const fcsl_run_t *run)
{
    return run->machine;
}

const void *fcsl_run_data(const fcsl_run_t *run)
{
    return run->data;
}

uint64_t fcsl_run_tick(const fcsl_run_t *run)
{
    return fcsl_read_u64(run->data, run->machine->tick_offset);
}

uint64_t fcsl_run_tick_time_ns(const fcsl_run_t *run, uint64_t tick)
{
    return fcsl_tick_time_ns(run->machine->tick_hz, tick);
}

uint32_t fcsl_run_save_bytes(const fcsl_run_t *run)
{
    return run->machine->size + (uint32_t)fcsl_monitor_memory_bytes(fcsl_run_monitor(run));
}

int fcsl_run_save(const fcsl_run_t *run, void *bytes, uint32_t size, fcsl_error_t *error)
{
    const uint32_t own = run->machine->size;
    if (size != own && size != fcsl_run_save_bytes(run)) {
        return fcsl_fail(error, "a checkpoint of machine '%s' has %" PRIu32 " bytes, not %" PRIu32, run->machine->name,
                         own, size);
    }
    fcsl_copy_canonical(run->machine, bytes, run->data);
    if (size != own) {
        fcsl_monitor_memory_put(fcsl_run_monitor(run), fcsl_run_monitor_data(run), (uint8_t *)bytes + own);
    }
    return 0;
}

int fcsl_run_restore(fcsl_run_t *run, const void *bytes, uint32_t size, fcsl_error_t *error)
{
    const uint32_t own = run->machine->size;
    if (size < own) {
        return fcsl_fail(error, "a checkpoint of machine '%s' has %" PRIu32 " bytes, not %" PRIu32, run->machine->name,
                         own, size);
    }
    const fcsl_monitor_t *monitor = fcsl_run_monitor(run);
    const uint8_t *remembered = NULL;
    if (fcsl_monitor_memory_find(monitor, (const uint8_t *)bytes + own, size - own, &remembered, error) != 0) {
        return -1;
    }
    fcsl_copy_canonical(run->machine, run->staging, bytes);
    const char *wrong = fcsl_struct_check(run->machine, run->staging);
    if (wrong != NULL) {
        return fcsl_fail(error, "the checkpoint is damaged: '%s' has an impossible value", wrong);
    }
    uint32_t noted = own;
    if (remembered != NULL) {
        fcsl_monitor_memory_put(monitor, remembered, run->staging + own);
        noted += (uint32_t)fcsl_monitor_memory_bytes(monitor);
    }
    /* Recorded first: the write belongs to the tick that would have come. */
    fcsl_note_write(run, &(fcsl_write_t){.kind = FCSL_WRITE_RESTORE, .path = "", .data = run->staging, .size = noted});
    memcpy(run->data, run->staging, own);
    fcsl_monitor_restored(run, remembered);
    fcsl_events_restart(run);
    return 0;
}

int fcsl_run_is_armed(const fcsl_run_t *run)
{
    return !run->requires_arming && fcsl_is_armed(run->machine, run->data);
}

void fcsl_run_require_arming(fcsl_run_t *run)
{
    run->requires_arming = run->machine->arm_field != FCSL_NONE && fcsl_is_armed(run->machine, run->data);
}

int fcsl_run_requires_arming(const fcsl_run_t *run)
{
    return run->requires_arming;
}

int fcsl_run_actuate_message(const fcsl_run_t *run, uint8_t *bytes, size_t capacity, fcsl_message_t *message)
{
    const uint64_t completed = fcsl_run_tick(run);
    const uint64_t tick = completed == 0 ? 0 : completed - 1u;
    const int armed = fcsl_run_is_armed(run);
    const fcsl_message_status_t status =
        fcsl_message_encode_actuators(&run->channels, run->data, tick, armed, bytes, capacity, message);
    return status == FCSL_MESSAGE_OK ? 0 : -1;
}

const void *fcsl_run_actuator_data(const fcsl_run_t *run)
{
    return fcsl_run_is_armed(run) ? run->data : run->safe;
}

const void *fcsl_run_safe_data(const fcsl_run_t *run)
{
    return run->safe;
}

int64_t fcsl_run_actuate(const fcsl_run_t *run, uint8_t *bytes, size_t capacity)
{
    fcsl_message_t message;
    return fcsl_run_actuate_message(run, bytes, capacity, &message) == 0 ? (int64_t)message.size : -1;
}

const fcsl_channel_table_t *fcsl_run_channels(const fcsl_run_t *run)
{
    return &run->channels;
}

static uint64_t read_clock(void *ctx)
{
    const fcsl_run_t *run = ctx;
    return run->clock_ns(run->clock_ctx);
}

void fcsl_run_set_clock(fcsl_run_t *run, uint64_t (*clock_ns)(void *ctx), void *ctx)
{
    run->clock_ns = clock_ns;
    run->clock_ctx = ctx;
    run->host.clock_ns = clock_ns != NULL ? read_clock : NULL;
}

uint64_t fcsl_run_monotonic_ns(void *ctx)
{
    (void)ctx;
    return fcsl_monotonic_ns();
}

static void keep_overruns(fcsl_run_t *run)
{
    for (uint32_t i = 0; i < run->watched_count; i++) {
        fcsl_overrun_watch_t *watch = &run->watched[i];
        watch->overruns = fcsl_read_u64(run->data, watch->overruns_offset);
        watch->injected = run->data[watch->inject_offset];
    }
}

/* Overruns that the clock found in `tick`: an input of the run, so a replay injects them. */
static void note_new_overruns(fcsl_run_t *run, uint64_t tick)
{
    for (uint32_t i = 0; i < run->watched_count; i++) {
        const fcsl_overrun_watch_t *watch = &run->watched[i];
        if (watch->injected == 0 && fcsl_read_u64(run->data, watch->overruns_offset) != watch->overruns) {
            fcsl_note_write_at(run, tick, &(fcsl_write_t){.kind = FCSL_WRITE_OVERRUN, .path = watch->instance});
        }
    }
}

/* One tick of the machine; fails when it did not complete it. */
static int step_once(fcsl_run_t *run, uint64_t tick, fcsl_error_t *error)
{
    if (run->times != NULL) {
        fcsl_times_begin(run);
    }
    if (run->events != NULL) {
        fcsl_events_begin(run);
    }
    run->machine->step(run->data, &run->host);
    if (run->times != NULL) {
        fcsl_times_end(run);
    }
    if (run->impure_count > 0) {
        fcsl_io_replay_settle(run);
    }
    if (fcsl_run_tick(run) == tick) {
        return fcsl_fail(error, "tick %" PRIu64 " was not completed", tick);
    }
    if (run->requires_arming) {
        run->requires_arming = fcsl_is_armed(run->machine, run->data);
    }
    if (run->events != NULL) {
        fcsl_events_tell(run, tick);
    }
    if (run->monitor != NULL) {
        fcsl_monitor_tick(run);
    }
    if (run->traces != NULL) {
        fcsl_trace_take(run);
    }
    return 0;
}

/* The same, of a run of which somebody is told. */
__attribute__((hot)) static int step_noted(fcsl_run_t *run, fcsl_error_t *error)
{
    const int timed = run->host.clock_ns != NULL;
    if (run->recorder != NULL && fcsl_recorder_begin_tick(run->recorder, error) != 0) {
        return -1;
    }
    const uint64_t tick = fcsl_run_tick(run);
    if (timed) {
        keep_overruns(run);
    }
    if (step_once(run, tick, error) != 0) {
        return -1;
    }
    if (run->impure_count > 0) {
        fcsl_io_replay_note(run, tick);
    }
    if (timed) {
        note_new_overruns(run, tick);
    }
    if (run->recorder != NULL) {
        fcsl_recorder_tick(run->recorder, fcsl_run_stamp(run, tick));
        if (run->events != NULL) {
            fcsl_events_record(run, tick);
        }
        if (run->monitor != NULL) {
            fcsl_monitor_note(run, tick);
        }
        if (run->times != NULL) {
            fcsl_times_note(run, tick);
        }
        fcsl_recorder_end_tick(run->recorder, fcsl_run_stamp(run, tick + 1u));
    }
    return 0;
}

__attribute__((hot)) int fcsl_run_step(fcsl_run_t *run, uint64_t ticks, fcsl_error_t *error)
{
    const int noted = fcsl_writes_noted(run);
    const fcsl_fp_mode_t callers = fcsl_fp_enter();
    int failed = 0;
    for (uint64_t i = 0; i < ticks && !failed; i++) {
        failed = (noted ? step_noted(run, error) : step_once(run, fcsl_run_tick(run), error)) != 0;
    }
    fcsl_fp_leave(callers);
    return failed ? -1 : 0;
}

uint64_t fcsl_run_enter_mode(void)
{
    return (uint64_t)fcsl_fp_enter();
}

uint64_t fcsl_run_ieee_mode(void)
{
    return (uint64_t)FCSL_FP_DEFAULT;
}

void fcsl_run_leave_mode(uint64_t callers)
{
    fcsl_fp_leave((fcsl_fp_mode_t)callers);
}

int64_t fcsl_run_step_once(fcsl_run_t *run, fcsl_error_t *error)
{
    return fcsl_run_step(run, 1, error) == 0 ? (int64_t)fcsl_run_tick(run) : -1;
}

const char *fcsl_run_views(const fcsl_run_t *run)
{
    return run->views != NULL ? run->views : run->machine->views;
}

int fcsl_run_set_views(fcsl_run_t *run, const char *views, fcsl_error_t *error)
{
    if (run->recorder != NULL) {
        return fcsl_fail(error, "views are set before recording begins");
    }
    if (strnlen(views, FCSL_VIEWS_BYTES_MAX + 1u) > FCSL_VIEWS_BYTES_MAX) {
        return fcsl_fail(error, "the views have more than %u bytes", (unsigned)FCSL_VIEWS_BYTES_MAX);
    }
    char *copy = strdup(views);
    if (copy == NULL) {
        return fcsl_fail(error, "out of memory for views");
    }
    free(run->views);
    run->views = copy;
    return 0;
}
