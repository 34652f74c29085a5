/* SPDX-License-Identifier: Apache-2.0
 *
 * The HAL of a board.
 */
#define _GNU_SOURCE
#include "hal_linux.h"

#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "board.h"
#include "board_hardware.h"
#include "counters.h"
#include "readings.h"

typedef struct {
    fcsl_log_t log;
    fcsl_run_t *run;
    int priority; /* of the devices' threads */
    board_t *board;
    const board_plan_t *plan; /* the board's */
    board_devices_t *devices;
    board_hardware_t *hardware; /* null: the plan has none */
    int32_t primaries[BOARD_SENSORS_MAX]; /* as they were logged */
    readings_t readings;
    counters_t counters;
    uint64_t paced_ns; /* time of the last sample that was a tick; 0: none yet */
    fcsl_error_t failure;
} hal_t;

static const uint64_t SLICE_NS = 50000000u; /* a loop that waits for a device looks around so often */

/* ---- a tick --------------------------------------------------------------------------------------------------------- */

static void tell_primary(hal_t *hal, uint32_t s)
{
    char text[FCSL_LOG_BYTES];
    const board_sensor_run_t *sensor = &hal->board->sensors[s];
    const int32_t primary = sensor->output.primary;
    const int32_t before = hal->primaries[s];
    if (primary == before) {
        return;
    }
    if (primary >= 0) {
        (void)snprintf(text, sizeof text, "sensor '%.60s': primary is device '%.60s'", sensor->plan->name,
                       hal->plan->devices[sensor->plan->devices[primary]].name);
    } else {
        (void)snprintf(text, sizeof text, "sensor '%.60s': no device is healthy; '%.60s' is %s", sensor->plan->name,
                       hal->plan->devices[sensor->plan->devices[before]].name,
                       fcsl_backend_condition_text(fcsl_frontend_condition(sensor->frontend, (uint32_t)before)));
    }
    hal->primaries[s] = primary;
    fcsl_log_write(&hal->log, text);
}

static void tell_news(hal_t *hal)
{
    const char *news = board_devices_news(hal->devices);
    if (news == NULL && hal->hardware != NULL) {
        news = board_hardware_news(hal->hardware);
    }
    if (news != NULL) {
        fcsl_log_write(&hal->log, news);
    }
}

/* Waits for the sample of the device that paces the loop: OK, WAITING, or the end. Before the first one nothing is too late. */
static fcsl_hal_status_t wait_for_pace(hal_t *hal)
{
    const board_plan_t *plan = hal->plan;
    const uint64_t slice_ns = fcsl_monotonic_ns() + SLICE_NS;
    const uint64_t end_ns = hal->paced_ns > 0u ? hal->paced_ns + plan->pace_timeout_ns : UINT64_MAX;
    const int sampled = board_devices_wait(hal->devices, slice_ns < end_ns ? slice_ns : end_ns);
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (sampled > 0) {
        hal->paced_ns = now_ns;
        return FCSL_HAL_OK;
    }
    if (sampled < 0) {
        return FCSL_HAL_CLOSED;
    }
    if (now_ns < end_ns) {
        tell_news(hal);
        return FCSL_HAL_WAITING;
    }
    (void)fcsl_fail(&hal->failure, "device '%.60s', which paces the loop, has given nothing for %.6g ms",
                    plan->devices[plan->pacing].name, (double)(now_ns - hal->paced_ns) / 1e6);
    return FCSL_HAL_TIMEOUT;
}

static fcsl_hal_status_t linux_sample(void *ctx, uint64_t tick, const fcsl_sink_t *to)
{
    hal_t *hal = ctx;
    (void)tick;
    (void)to;
    const fcsl_hal_status_t paced = hal->plan->pacing != BOARD_NO_DEVICE ? wait_for_pace(hal) : FCSL_HAL_OK;
    if (paced != FCSL_HAL_OK) {
        return paced;
    }
    const uint64_t now_ns = fcsl_monotonic_ns();
    readings_t *readings = &hal->readings;
    readings->count = board_devices_take(hal->devices, readings->kept, READINGS_MAX);
    for (uint32_t i = 0; i < readings->count; i++) {
        board_take(hal->board, readings->kept[i].sensor, &readings->kept[i].reading);
    }
    readings_end_tick(&hal->readings, hal->run, now_ns);
    if (board_tick(hal->board, now_ns, &hal->failure) != 0) {
        return FCSL_HAL_ERROR;
    }
    for (uint32_t s = 0; s < hal->plan->sensor_count; s++) {
        tell_primary(hal, s);
    }
    tell_news(hal);
    return FCSL_HAL_OK;
}

/* The tick is over: pins get their levels. Actuators are moved by fcsl-guard, if there is one. */
static fcsl_hal_status_t linux_command(void *ctx, const fcsl_message_t *message)
{
    hal_t *hal = ctx;
    (void)message;
    if (hal->hardware != NULL) {
        board_hardware_tick(hal->hardware);
    }
    return FCSL_HAL_OK;
}

static fcsl_hal_status_t linux_arm(void *ctx, int armed)
{
    (void)ctx;
    (void)armed;
    return FCSL_HAL_OK;
}

static void linux_count(void *ctx)
{
    hal_t *hal = ctx;
    uint64_t *at = hal->counters.values;
    for (uint32_t s = 0; s < hal->plan->sensor_count; s++) {
        const board_sensor_run_t *sensor = &hal->board->sensors[s];
        *at++ = (uint64_t)(sensor->output.primary + 1);
        for (uint32_t b = 0; b < sensor->plan->config.backend_count; b++) {
            *at++ = (uint64_t)fcsl_frontend_condition(sensor->frontend, b);
        }
    }
    for (uint32_t d = 0; d < hal->plan->device_count; d++) {
        device_counts_t counts;
        if (!board_plan_flies(hal->plan, d)) {
            continue;
        }
        if (hal->hardware == NULL || !board_hardware_counts(hal->hardware, d, &counts)) {
            counts = board_devices_counts(hal->devices, d);
        }
        *at++ = counts.open;
        *at++ = counts.samples;
        *at++ = counts.errors;
        *at++ = counts.dropped;
        *at++ = counts.lost;
        *at++ = counts.bytes;
        *at++ = counts.frames;
        *at++ = counts.rejected;
        *at++ = counts.why;
    }
}

static const char *linux_explain(void *ctx)
{
    return ((hal_t *)ctx)->failure.text;
}

/* While it is paused nobody gets what is measured; the newest sample is kept for the tick that follows. */
static void linux_keep_alive(void *ctx)
{
    hal_t *hal = ctx;
    board_devices_discard(hal->devices);
    if (hal->hardware != NULL) {
        board_hardware_tick(hal->hardware);
    }
    hal->paced_ns = hal->paced_ns > 0u ? fcsl_monotonic_ns() : 0u;
}

static void linux_interrupt(void *ctx)
{
    hal_t *hal = ctx;
    board_devices_interrupt(hal->devices);
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

static void linux_close(void *ctx)
{
    hal_t *hal = ctx;
    if (hal->hardware != NULL) {
        fcsl_run_use_board(hal->run, NULL);
        board_hardware_free(hal->hardware);
    }
    const int left = board_devices_free(hal->devices) != 0;
    counters_free(&hal->counters);
    readings_free(&hal->readings);
    if (!left) { /* a thread that hangs in its driver reads the plan */
        board_close(hal->board);
    }
    free(hal);
}

static int linux_open(fcsl_hal_t *handle, fcsl_error_t *error)
{
    hal_t *hal = handle->ctx;
    fcsl_error_t reason;
    if (board_devices_start(hal->devices, hal->priority, &reason) != 0 ||
        (hal->hardware != NULL && board_hardware_start(hal->hardware, hal->priority, &reason) != 0)) {
        return fcsl_fail(error, "%s", reason.text);
    }
    if (hal->hardware != NULL) {
        fcsl_run_use_board(hal->run, board_hardware_table(hal->hardware));
    }
    if (hal->plan->pacing != BOARD_NO_DEVICE) {
        char text[FCSL_LOG_BYTES];
        (void)snprintf(text, sizeof text, "waits for device '%.60s', which paces the loop",
                       hal->plan->devices[hal->plan->pacing].name);
        fcsl_log_write(&hal->log, text);
    }
    return 0;
}

static int open_board(hal_t *hal, const char *file, fcsl_error_t *error)
{
    hal->board = board_open(file, hal->run, error);
    if (hal->board == NULL) {
        return -1;
    }
    hal->plan = hal->board->plan;
    for (uint32_t s = 0; s < hal->plan->sensor_count; s++) {
        hal->primaries[s] = -1;
    }
    hal->devices = board_devices_new(hal->plan, error);
    if (hal->devices == NULL || counters_open(&hal->counters, hal->plan, error) != 0) {
        return -1;
    }
    if (!board_plan_has_hardware(hal->plan)) {
        return 0;
    }
    hal->hardware = board_hardware_new(hal->plan, hal->devices, error);
    return hal->hardware != NULL ? 0 : -1;
}

int hal_linux_end(const fcsl_hal_t *hal, fcsl_error_t *error)
{
    const hal_t *self = hal->ctx;
    return self->hardware != NULL ? board_hardware_end(self->hardware, error) : 0;
}

int hal_linux_feeds(const fcsl_hal_t *hal, uint32_t channel)
{
    const hal_t *self = hal->ctx;
    for (uint32_t s = 0; s < self->plan->sensor_count; s++) {
        for (uint32_t i = 0; i < self->plan->sensors[s].binding_count; i++) {
            if (self->board->sensors[s].channels[i].channel == channel) {
                return 1;
            }
        }
    }
    return 0;
}

int hal_linux_record(const fcsl_hal_t *hal, const char *name_space, fcsl_error_t *error)
{
    hal_t *self = hal->ctx;
    return readings_record(&self->readings, self->plan, self->run, name_space, error);
}

int hal_linux(const char *file, int priority, fcsl_run_t *run, fcsl_hal_t *hal, fcsl_error_t *error)
{
    hal_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return fcsl_fail(error, "out of memory for the board");
    }
    self->run = run;
    self->priority = priority;
    self->readings.topic = -1;
    if (open_board(self, file, error) != 0) {
        linux_close(self);
        return -1;
    }
    *hal = (fcsl_hal_t){
        .ctx = self,
        .open = linux_open,
        .sample = linux_sample,
        .command = linux_command,
        .arm = linux_arm,
        .alive = linux_keep_alive,
        .clock = fcsl_monotonic_clock,
        .log = &self->log,
        .count = linux_count,
        .explain = linux_explain,
        .interrupt = linux_interrupt,
        .close = linux_close,
        .fields = self->counters.fields,
        .field_count = self->counters.count,
        .counters = self->counters.values,
        .counter_bytes = self->counters.count * (uint32_t)sizeof(uint64_t),
        .serves = 1,
        .paces = self->plan->pacing != BOARD_NO_DEVICE ? FCSL_PACED_IN_REAL_TIME : FCSL_PACED_BY_HOST,
    };
    return 0;
}
