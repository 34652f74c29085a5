/* SPDX-License-Identifier: Apache-2.0
 *
 * The sensor devices of a plan.
 */
#define _GNU_SOURCE
#include "board_devices.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"

/* How long a sample stands for what is on a pin. */
static const uint64_t LATEST_NS = 500000000u;
enum { PERIODS = 3 };

/* A backend of a sensor, seen from its device. */
typedef struct {
    uint32_t device;
    uint32_t sensor;
    uint32_t backend;
    struct {
        uint32_t from; /* in a sample of the device */
        uint32_t to; /* in a reading */
        uint32_t count;
    } copies[FCSL_QUANTITIES_MAX];
    uint32_t copy_count;
} feed_t;

struct board_devices {
    const board_plan_t *plan;
    sensor_device_t *devices[BOARD_DEVICES_MAX]; /* null: no sensor uses it */
    device_sample_t latest[BOARD_DEVICES_MAX];
    uint8_t has_latest[BOARD_DEVICES_MAX];
    feed_t feeds[BOARD_SENSORS_MAX * FCSL_BACKENDS_MAX];
    uint32_t feed_count;
    sem_t sampled; /* posted by the device that paces the loop */
    atomic_int interrupted;
};

/* ---- opening -------------------------------------------------------------------------------------------------------- */

static int use_device(board_devices_t *devices, uint32_t d, fcsl_error_t *error)
{
    if (devices->devices[d] == NULL) {
        devices->devices[d] = sensor_device_new(&devices->plan->devices[d], error);
    }
    return devices->devices[d] != NULL ? 0 : -1;
}

/* Copies a signal into the quantity. One that the driver does not have is an error where the machine or the plan needs it. */
static int add_copy(board_devices_t *devices, feed_t *feed, uint32_t q, fcsl_error_t *error)
{
    const board_sensor_t *sensor = &devices->plan->sensors[feed->sensor];
    const fcsl_quantity_t *quantity = &fcsl_sensor_kinds[sensor->config.kind].quantities[q];
    const char *given = sensor->signals[feed->backend][q];
    const char *unit = sensor->config.kind == FCSL_RC ? "" : quantity->unit; /* pulses become sticks */
    const fcsl_driver_use_t use =
        board_sensor_needs(sensor, q) || given != NULL ? FCSL_DRIVER_NEEDED : FCSL_DRIVER_OPTIONAL;
    uint32_t count = 0;
    fcsl_error_t why;
    const int from = sensor_device_use(devices->devices[feed->device], given != NULL ? given : quantity->name, unit,
                                       use, quantity->count, &count, &why);
    if (from < 0 && use == FCSL_DRIVER_NEEDED) {
        *error = why;
        return -1;
    }
    if (from >= 0) {
        feed->copies[feed->copy_count].from = (uint32_t)from;
        feed->copies[feed->copy_count].to = quantity->at;
        feed->copies[feed->copy_count++].count = count;
    }
    return 0;
}

static int add_feed(board_devices_t *devices, uint32_t s, uint32_t b, fcsl_error_t *error)
{
    const board_sensor_t *sensor = &devices->plan->sensors[s];
    const fcsl_sensor_kind_info_t *kind = &fcsl_sensor_kinds[sensor->config.kind];
    feed_t *feed = &devices->feeds[devices->feed_count++];
    *feed = (feed_t){.device = sensor->devices[b], .sensor = s, .backend = b};
    if (use_device(devices, feed->device, error) != 0) {
        return -1;
    }
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        if (kind->quantities[q].given && add_copy(devices, feed, q, error) != 0) {
            return -1;
        }
    }
    return 0;
}

board_devices_t *board_devices_new(const board_plan_t *plan, fcsl_error_t *error)
{
    board_devices_t *devices = calloc(1, sizeof *devices);
    if (devices == NULL) {
        (void)fcsl_fail(error, "out of memory for the devices");
        return NULL;
    }
    devices->plan = plan;
    if (sem_init(&devices->sampled, 0, 0) != 0) {
        free(devices);
        (void)fcsl_fail(error, "no semaphore for the devices");
        return NULL;
    }
    for (uint32_t s = 0; s < plan->sensor_count; s++) {
        for (uint32_t b = 0; b < plan->sensors[s].config.backend_count; b++) {
            if (add_feed(devices, s, b, error) != 0) {
                (void)board_devices_free(devices);
                return NULL;
            }
        }
    }
    if (plan->pacing != BOARD_NO_DEVICE && devices->devices[plan->pacing] == NULL) {
        (void)fcsl_fail(error, "device '%.60s' paces the loop, and no sensor uses it",
                        plan->devices[plan->pacing].name);
        (void)board_devices_free(devices);
        return NULL;
    }
    if (plan->pacing != BOARD_NO_DEVICE) {
        sensor_device_post(devices->devices[plan->pacing], &devices->sampled);
    }
    return devices;
}

int board_devices_use(board_devices_t *devices, uint32_t device, const char *signal, fcsl_error_t *error)
{
    uint32_t count = 0;
    if (use_device(devices, device, error) != 0) {
        return -1;
    }
    const int at = sensor_device_use(devices->devices[device], signal, "", FCSL_DRIVER_NEEDED, 2, &count, error);
    if (at >= 0 && count != 1u) {
        return fcsl_fail(error, "device '%.60s': signal '%.60s' has several values, and a pin or a count is one",
                         devices->plan->devices[device].name, signal);
    }
    return at;
}

int board_devices_start(board_devices_t *devices, int priority, fcsl_error_t *error)
{
    for (uint32_t d = 0; d < devices->plan->device_count; d++) {
        if (devices->devices[d] != NULL && sensor_device_start(devices->devices[d], priority, error) != 0) {
            return -1;
        }
    }
    return 0;
}

int board_devices_free(board_devices_t *devices)
{
    int left = 0;
    if (devices == NULL) {
        return 0;
    }
    for (uint32_t d = 0; d < BOARD_DEVICES_MAX; d++) {
        left |= sensor_device_free(devices->devices[d]) != 0;
    }
    if (left) {
        return -1;
    }
    (void)sem_destroy(&devices->sampled);
    free(devices);
    return 0;
}

/* ---- the step thread ------------------------------------------------------------------------------------------------ */

int board_devices_wait(board_devices_t *devices, uint64_t deadline_ns)
{
    const sensor_device_t *pacing = devices->devices[devices->plan->pacing];
    const struct timespec deadline = fcsl_timespec_of(deadline_ns);
    int waited = 0;
    /* The semaphore may have been posted for samples that were taken already: each of them costs a turn. */
    while (!sensor_device_has_sample(pacing) && waited == 0 && atomic_load(&devices->interrupted) == 0) {
        waited = sem_clockwait(&devices->sampled, CLOCK_MONOTONIC, &deadline) != 0 && errno != EINTR;
    }
    if (sensor_device_has_sample(pacing)) {
        return 1;
    }
    return atomic_load(&devices->interrupted) != 0 ? -1 : 0;
}

void board_devices_interrupt(board_devices_t *devices)
{
    atomic_store(&devices->interrupted, 1);
    (void)sem_post(&devices->sampled);
}

void board_devices_discard(board_devices_t *devices)
{
    for (uint32_t d = 0; d < devices->plan->device_count; d++) {
        if (devices->devices[d] != NULL) {
            sensor_device_skip(devices->devices[d], 1);
        }
    }
}

static void make_reading(const feed_t *feed, const device_sample_t *sample, sensor_reading_t *made)
{
    made->sensor = feed->sensor;
    made->reading = (fcsl_reading_t){.sample_ns = sample->sample_ns, .backend = feed->backend};
    for (uint32_t i = 0; i < FCSL_VALUES_MAX; i++) {
        made->reading.values[i] = NAN;
    }
    for (uint32_t i = 0; i < feed->copy_count; i++) {
        memcpy(&made->reading.values[feed->copies[i].to], &sample->values[feed->copies[i].from],
               feed->copies[i].count * sizeof(double));
    }
}

/* Returns whether there was a sample. */
static int take_sample(board_devices_t *devices, uint32_t d, sensor_reading_t *readings, uint32_t *count)
{
    device_sample_t sample;
    if (!sensor_device_take(devices->devices[d], &sample)) {
        return 0;
    }
    devices->latest[d] = sample;
    devices->has_latest[d] = 1;
    for (uint32_t i = 0; i < devices->feed_count; i++) {
        if (devices->feeds[i].device == d) {
            make_reading(&devices->feeds[i], &sample, &readings[(*count)++]);
        }
    }
    return 1;
}

/* Once a tick, so that all reads of a tick agree. */
static void judge_latest(board_devices_t *devices, uint32_t d, uint64_t now_ns)
{
    const uint64_t period_ns = devices->plan->devices[d].period_ns;
    const uint64_t limit_ns = PERIODS * period_ns > LATEST_NS ? PERIODS * period_ns : LATEST_NS;
    const int is_old =
        period_ns > 0u && now_ns > devices->latest[d].sample_ns && now_ns - devices->latest[d].sample_ns > limit_ns;
    if (is_old || !sensor_device_is_well(devices->devices[d])) {
        devices->has_latest[d] = 0;
    }
}

static int has_feed(const board_devices_t *devices, uint32_t d)
{
    for (uint32_t i = 0; i < devices->feed_count; i++) {
        if (devices->feeds[i].device == d) {
            return 1;
        }
    }
    return 0;
}

uint32_t board_devices_take(board_devices_t *devices, sensor_reading_t *readings, uint32_t capacity)
{
    const uint32_t share = devices->feed_count > 0u ? capacity / devices->feed_count : 0u; /* of a device */
    const uint64_t now_ns = fcsl_monotonic_ns();
    uint32_t count = 0;
    for (uint32_t d = 0; d < devices->plan->device_count; d++) {
        uint32_t samples = DEVICE_RING_SAMPLES; /* of one that makes no readings */
        if (devices->devices[d] == NULL) {
            continue;
        }
        if (d == devices->plan->pacing) {
            samples = 1;
        } else if (has_feed(devices, d)) {
            samples = share;
            sensor_device_skip(devices->devices[d], share);
        }
        for (uint32_t i = 0; i < samples && take_sample(devices, d, readings, &count); i++) {
        }
        judge_latest(devices, d, now_ns);
    }
    return count;
}

device_counts_t board_devices_counts(const board_devices_t *devices, uint32_t device)
{
    return devices->devices[device] != NULL ? sensor_device_counts(devices->devices[device]) : (device_counts_t){0};
}

const device_sample_t *board_devices_latest(const board_devices_t *devices, uint32_t device)
{
    return devices->has_latest[device] != 0u ? &devices->latest[device] : NULL;
}

const char *board_devices_news(board_devices_t *devices)
{
    for (uint32_t d = 0; d < devices->plan->device_count; d++) {
        const char *news = devices->devices[d] != NULL ? sensor_device_news(devices->devices[d]) : NULL;
        if (news != NULL) {
            return news;
        }
    }
    return NULL;
}
