/* SPDX-License-Identifier: Apache-2.0
 *
 * The HAL of a board.
 */
#include "hal_linux.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/error.h"
#include "board_sensor.h"
#include "counters.h"
#include "sensor_device.h"

/* A backend of a sensor, seen from its device. */
typedef struct {
    uint32_t sensor;
    uint32_t backend;
    struct {
        uint32_t from; /* in a sample of the device */
        uint32_t to; /* in a reading */
        uint32_t count;
    } copies[FCSL_QUANTITIES_MAX];
    uint32_t copy_count;
    uint32_t device;
} feed_t;

typedef struct {
    fcsl_hal_t base; /* the stub: its clock and its log */
    fcsl_run_t *run;
    board_plan_t *plan;
    sensor_device_t *devices[BOARD_DEVICES_MAX];
    board_sensor_run_t sensors[BOARD_SENSORS_MAX];
    feed_t feeds[BOARD_SENSORS_MAX * FCSL_BACKENDS_MAX];
    uint32_t feed_count;
    counters_t counters;
    fcsl_error_t failure;
} hal_t;

/* ---- a tick --------------------------------------------------------------------------------------------------------- */

static void feed(hal_t *hal, const feed_t *to, const device_sample_t *sample)
{
    fcsl_reading_t reading = {.sample_ns = sample->sample_ns, .backend = to->backend};
    for (uint32_t i = 0; i < FCSL_VALUES_MAX; i++) {
        reading.values[i] = NAN;
    }
    for (uint32_t i = 0; i < to->copy_count; i++) {
        memcpy(&reading.values[to->copies[i].to], &sample->values[to->copies[i].from],
               to->copies[i].count * sizeof(double));
    }
    fcsl_frontend_take(hal->sensors[to->sensor].frontend, &reading);
}

/* What the ring held when the tick began: a device that is faster than this loop keeps no tick. */
static void drain(hal_t *hal, uint32_t device)
{
    device_sample_t sample;
    for (uint32_t n = 0; n < DEVICE_RING_SAMPLES && sensor_device_take(hal->devices[device], &sample); n++) {
        for (uint32_t i = 0; i < hal->feed_count; i++) {
            if (hal->feeds[i].device == device) {
                feed(hal, &hal->feeds[i], &sample);
            }
        }
    }
}

static void tell_changes(hal_t *hal)
{
    for (uint32_t d = 0; d < hal->plan->device_count; d++) {
        const char *news = sensor_device_news(hal->devices[d]);
        if (news != NULL) {
            hal->base.log(hal->base.ctx, news);
        }
    }
}

static void tell_primary(hal_t *hal, const board_sensor_run_t *sensor, int32_t before)
{
    char text[FCSL_LOG_BYTES];
    const int32_t primary = sensor->output.primary;
    const board_sensor_t *plan = sensor->plan;
    if (primary == before) {
        return;
    }
    if (primary >= 0) {
        (void)snprintf(text, sizeof text, "sensor '%.60s': primary is now device '%.60s'", plan->name,
                       hal->plan->devices[plan->devices[primary]].name);
    } else {
        (void)snprintf(text, sizeof text, "sensor '%.60s': no device is healthy; '%.60s' is %s", plan->name,
                       hal->plan->devices[plan->devices[before]].name,
                       fcsl_backend_condition_text(fcsl_frontend_condition(sensor->frontend, (uint32_t)before)));
    }
    hal->base.log(hal->base.ctx, text);
}

static fcsl_hal_status_t linux_sample(void *ctx, uint64_t tick, uint8_t *bytes, size_t capacity,
                                      fcsl_message_t *message)
{
    hal_t *hal = ctx;
    (void)tick;
    (void)bytes;
    (void)capacity;
    (void)message;
    const uint64_t now_ns = hal->base.now_ns(hal->base.ctx);
    for (uint32_t d = 0; d < hal->plan->device_count; d++) {
        drain(hal, d);
    }
    for (uint32_t s = 0; s < hal->plan->sensor_count; s++) {
        const int32_t before = hal->sensors[s].output.primary;
        if (board_sensor_tick(&hal->sensors[s], hal->run, now_ns, &hal->failure) != 0) {
            return FCSL_HAL_ERROR;
        }
        tell_primary(hal, &hal->sensors[s], before);
    }
    tell_changes(hal);
    return FCSL_HAL_NONE; /* the channels have their samples already */
}

/* Those of fcsl-guard move actuators, if there is one. */
static fcsl_hal_status_t linux_command(void *ctx, const fcsl_message_t *message)
{
    (void)ctx;
    (void)message;
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
        const board_sensor_run_t *sensor = &hal->sensors[s];
        *at++ = (uint64_t)(sensor->output.primary + 1);
        for (uint32_t b = 0; b < sensor->plan->config.backend_count; b++) {
            *at++ = (uint64_t)fcsl_frontend_condition(sensor->frontend, b);
        }
    }
    for (uint32_t d = 0; d < hal->plan->device_count; d++) {
        const device_counts_t counts = sensor_device_counts(hal->devices[d]);
        *at++ = counts.open;
        *at++ = counts.samples;
        *at++ = counts.errors;
        *at++ = counts.dropped;
        *at++ = counts.lost;
    }
}

static uint64_t linux_now_ns(void *ctx)
{
    const fcsl_hal_t *base = &((hal_t *)ctx)->base;
    return base->now_ns(base->ctx);
}

static void linux_wait(void *ctx, uint64_t until_ns)
{
    const fcsl_hal_t *base = &((hal_t *)ctx)->base;
    base->wait(base->ctx, until_ns);
}

static void linux_log(void *ctx, const char *text)
{
    const fcsl_hal_t *base = &((hal_t *)ctx)->base;
    base->log(base->ctx, text);
}

static int linux_read_log(void *ctx, char text[FCSL_LOG_BYTES])
{
    const fcsl_hal_t *base = &((hal_t *)ctx)->base;
    return base->read_log(base->ctx, text);
}

static const char *linux_explain(void *ctx)
{
    return ((hal_t *)ctx)->failure.text;
}

static void linux_nothing(void *ctx)
{
    (void)ctx;
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

static void linux_close(void *ctx)
{
    hal_t *hal = ctx;
    for (uint32_t d = 0; d < BOARD_DEVICES_MAX; d++) {
        sensor_device_free(hal->devices[d]);
    }
    for (uint32_t s = 0; s < BOARD_SENSORS_MAX; s++) {
        board_sensor_close(&hal->sensors[s]);
    }
    if (hal->base.close != NULL) {
        hal->base.close(hal->base.ctx);
    }
    counters_free(&hal->counters);
    board_plan_free(hal->plan);
    free(hal);
}

static int linux_open(fcsl_hal_t *handle, char *error, size_t error_size)
{
    hal_t *hal = handle->ctx;
    fcsl_error_t reason;
    for (uint32_t d = 0; d < hal->plan->device_count; d++) {
        if (sensor_device_start(hal->devices[d], &reason) != 0) {
            (void)snprintf(error, error_size, "%s", reason.text);
            return -1;
        }
    }
    return 0;
}

/* The quantities that the machine gets must be there; of the others those whose signal the driver has are used, too. */
static int add_feed(hal_t *hal, uint32_t s, uint32_t b, fcsl_error_t *error)
{
    const board_sensor_t *sensor = &hal->plan->sensors[s];
    const fcsl_sensor_kind_info_t *kind = &fcsl_sensor_kinds[sensor->config.kind];
    feed_t *to = &hal->feeds[hal->feed_count++];
    *to = (feed_t){.sensor = s, .backend = b, .device = sensor->devices[b]};
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        const fcsl_quantity_t *quantity = &kind->quantities[q];
        const char *signal = sensor->signals[b][q] != NULL ? sensor->signals[b][q] : quantity->name;
        const char *unit = sensor->config.kind == FCSL_RC ? "" : quantity->unit;
        uint32_t count = 0;
        fcsl_error_t why;
        if (!quantity->given) {
            continue;
        }
        const int from = sensor_device_use(hal->devices[to->device], signal, unit, quantity->count, &count, &why);
        if (from < 0 && (sensor->config.needed[q] > 0u || sensor->signals[b][q] != NULL)) {
            *error = why;
            return -1;
        }
        if (from >= 0) {
            to->copies[to->copy_count].from = (uint32_t)from;
            to->copies[to->copy_count].to = quantity->at;
            to->copies[to->copy_count++].count = count;
        }
    }
    return 0;
}

static int add_devices_and_sensors(hal_t *hal, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(hal->run);
    for (uint32_t d = 0; d < hal->plan->device_count; d++) {
        hal->devices[d] = sensor_device_new(&hal->plan->devices[d], error);
        if (hal->devices[d] == NULL) {
            return -1;
        }
    }
    for (uint32_t s = 0; s < hal->plan->sensor_count; s++) {
        hal->sensors[s].output.primary = -1;
        if (board_sensor_open(&hal->sensors[s], &hal->plan->sensors[s], machine, error) != 0) {
            return -1;
        }
        for (uint32_t b = 0; b < hal->plan->sensors[s].config.backend_count; b++) {
            if (add_feed(hal, s, b, error) != 0) {
                return -1;
            }
        }
    }
    return 0;
}

static int check_machine(const board_plan_t *plan, const char *file, const fcsl_machine_t *machine, fcsl_error_t *error)
{
    if (strcmp(plan->machine, machine->name) != 0 || plan->tick_hz != machine->tick_hz) {
        return fcsl_fail(error,
                         "'%.300s' is for machine '%.60s' at %" PRIu64 " Hz, and this is '%.60s' at %" PRIu64 " Hz",
                         file, plan->machine, plan->tick_hz, machine->name, machine->tick_hz);
    }
    return 0;
}

static int open_plan(hal_t *hal, const char *file, fcsl_error_t *error)
{
    hal->plan = board_plan_read(file, error);
    return hal->plan != NULL && check_machine(hal->plan, file, fcsl_run_machine(hal->run), error) == 0 &&
                   add_devices_and_sensors(hal, error) == 0 && counters_open(&hal->counters, hal->plan, error) == 0
               ? 0
               : -1;
}

int hal_linux(const char *file, fcsl_run_t *run, fcsl_hal_t *hal, fcsl_error_t *error)
{
    hal_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return fcsl_fail(error, "out of memory for the board");
    }
    self->run = run;
    if (fcsl_hal_stub(&self->base, error->text, sizeof error->text) != 0 || open_plan(self, file, error) != 0) {
        linux_close(self);
        return -1;
    }
    *hal = (fcsl_hal_t){
        .ctx = self,
        .open = linux_open,
        .sample = linux_sample,
        .command = linux_command,
        .arm = linux_arm,
        .alive = linux_nothing,
        .now_ns = linux_now_ns,
        .wait = linux_wait,
        .log = linux_log,
        .read_log = linux_read_log,
        .count = linux_count,
        .explain = linux_explain,
        .interrupt = linux_nothing,
        .close = linux_close,
        .fields = self->counters.fields,
        .field_count = self->counters.count,
        .counters = self->counters.values,
        .counter_bytes = self->counters.count * (uint32_t)sizeof(uint64_t),
        .serves = 1,
    };
    return 0;
}
