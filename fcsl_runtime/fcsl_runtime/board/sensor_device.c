/* SPDX-License-Identifier: Apache-2.0
 *
 * A sensor's device and its thread, which alone calls the driver: a driver may wait, a tick may not.
 *
 * The ring has one writer, the device's thread, and two that take the oldest sample: the step thread, to use it, and the device's
 * thread, to make room when the ring is full, since new samples are worth more than old ones. Whoever moves `taken` on by its
 * compare-and-exchange has it. So the step thread copies a sample first and then tries to have it: if it fails, the copy may be torn,
 * and it goes on with the next, DEVICE_RING_SAMPLES times at most. If it succeeds, the device's thread cannot have written there: it
 * reads the `taken` of that exchange before it does. A sample is published by the release of `written`, behind its words. The words are
 * atomic only because a copy that is thrown away may race with them. A second thread that takes for use breaks nothing; a second writer
 * does.
 *
 * Texts for people go under a lock, which the step thread only tries.
 */
#define _GNU_SOURCE
#include "sensor_device.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "device_thread.h"
#include "fcsl/fcsl_library.h"
#include "fcsl/fcsl_scalar.h"

enum { NEWS_BYTES = 512 };
static const uint64_t RECHECK_NS = 500000000u; /* for a device that is not there */
static const uint64_t FAILED_NS = 10000000u; /* after a read that failed, of a driver that waits */
static const uint64_t END_NS = 1000000000u;
static const uint64_t AHEAD_NS = 1000000u; /* a sample that is further in the future has a wrong time */
static const uint64_t SILENT_NS = 2000000000u; /* without a sample, of a driver that tells what arrives */
static const uint64_t NEWS_NS = 1000000000u; /* between two texts for people */

typedef enum { DEVICE_MISSING, DEVICE_OPEN, DEVICE_SILENT, DEVICE_FAILING } condition_t;

struct sensor_device {
    const board_device_t *plan;
    const fcsl_driver_t *driver;
    void *library;
    void *state;
    uint8_t *used;
    uint32_t *at; /* by signal: where its elements lie in a sample */
    uint32_t value_count;
    atomic_int opened;

    pthread_t thread;
    int started;
    atomic_int over;
    sem_t wake;
    sem_t finished; /* posted by the thread, at its end */
    sem_t *posted; /* null: nobody waits for samples */

    _Atomic uint64_t ring[DEVICE_RING_SAMPLES][1 + DEVICE_VALUES_MAX]; /* time and values of a sample */
    _Atomic uint64_t written;
    _Atomic uint64_t taken;
    _Atomic uint64_t samples;
    _Atomic uint64_t errors;
    _Atomic uint64_t dropped;
    _Atomic uint64_t lost;
    _Atomic uint64_t bytes;
    _Atomic uint64_t frames;
    _Atomic uint64_t rejected;
    _Atomic uint64_t why;
    atomic_int condition; /* condition_t */

    uint32_t why_now; /* of the thread: why nothing has come since */
    uint64_t since_ns;

    pthread_mutex_t reason_lock; /* the step thread only tries it */
    char reason[DEVICE_REASON_BYTES];
    condition_t reported;
    uint64_t reported_why;
    uint64_t reported_ns;
    char news[NEWS_BYTES];
};

/* ---- before the thread ---------------------------------------------------------------------------------------------- */

static int allocate(sensor_device_t *device, fcsl_error_t *error)
{
    const fcsl_driver_t *driver = device->driver;
    device->state = device_state_new(driver);
    device->used = calloc(driver->signal_count, 1);
    device->at = calloc(driver->signal_count, sizeof *device->at);
    if (device->state == NULL || device->used == NULL || device->at == NULL) {
        return fcsl_fail(error, "out of memory for device '%.60s'", device->plan->name);
    }
    return 0;
}

sensor_device_t *sensor_device_new(const board_device_t *plan, fcsl_error_t *error)
{
    sensor_device_t *device = calloc(1, sizeof *device);
    if (device == NULL || sem_init(&device->wake, 0, 0) != 0 || sem_init(&device->finished, 0, 0) != 0 ||
        pthread_mutex_init(&device->reason_lock, NULL) != 0) {
        free(device);
        (void)fcsl_fail(error, "out of memory for device '%.60s'", plan->name);
        return NULL;
    }
    device->plan = plan;
    fcsl_error_t why;
    device->driver = fcsl_library_driver(plan->driver, FCSL_SENSOR, &device->library, &why);
    if (device->driver == NULL) {
        (void)fcsl_fail(error, "device '%.60s': %.400s", plan->name, why.text);
    } else if (!device->driver->waits && plan->period_ns == 0u) {
        (void)fcsl_fail(error,
                        "device '%.60s': driver '%.60s' does not wait for samples: give the device a \"rate_hz\"",
                        plan->name, plan->driver);
    } else if (allocate(device, error) == 0) {
        return device;
    }
    (void)sensor_device_free(device);
    return NULL;
}

int sensor_device_use(sensor_device_t *device, const char *signal, const char *unit, fcsl_driver_use_t use,
                      uint32_t count, uint32_t *found, fcsl_error_t *error)
{
    const fcsl_driver_t *driver = device->driver;
    const char *name = device->plan->name;
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        const fcsl_driver_signal_t *known = &driver->signals[i];
        if (strcmp(known->name, signal) != 0) {
            continue;
        }
        if (known->unit[0] != '\0' && unit[0] != '\0' && strcmp(known->unit, unit) != 0) {
            return fcsl_fail(error, "device '%.60s': signal '%.60s' is in %.40s, here it must be in %.40s", name,
                             signal, known->unit, unit);
        }
        if (device->used[i] == FCSL_DRIVER_UNUSED) {
            if (device->value_count + known->count > DEVICE_VALUES_MAX) {
                return fcsl_fail(error, "device '%.60s': more than %d values", name, DEVICE_VALUES_MAX);
            }
            device->used[i] = (uint8_t)use;
            device->at[i] = device->value_count;
            device->value_count += known->count;
        }
        device->used[i] = use == FCSL_DRIVER_NEEDED ? (uint8_t)use : device->used[i];
        *found = known->count < count ? known->count : count;
        return (int)device->at[i];
    }
    return fcsl_fail(error, "device '%.60s': driver '%.60s' has no signal '%.60s'", name, device->plan->driver, signal);
}

/* ---- the thread ----------------------------------------------------------------------------------------------------- */

static void set_condition(sensor_device_t *device, condition_t condition, uint32_t why, const char *reason)
{
    (void)pthread_mutex_lock(&device->reason_lock);
    (void)snprintf(device->reason, sizeof device->reason, "%s",
                   reason[0] != '\0' ? reason : "the driver gives no reason");
    atomic_store(&device->why, why);
    atomic_store(&device->condition, (int)condition);
    (void)pthread_mutex_unlock(&device->reason_lock);
}

static int open_device(sensor_device_t *device, char *why, size_t size)
{
    const char *address = device->plan->address;
    fcsl_driver_status_t status = device->driver->probe(address, why, size);
    if (status == FCSL_DRIVER_OK) {
        memset(device->state, 0, device->driver->state_size);
        status = device->driver->open(device->state, address, device->used, why, size);
    }
    why[size - 1u] = '\0';
    atomic_store(&device->opened, status == FCSL_DRIVER_OK);
    device->why_now = FCSL_DRIVER_NOT_TOLD;
    device->since_ns = fcsl_monotonic_ns();
    return (int)status;
}

/* Makes room by taking the oldest sample away, unless the step thread has just taken it. */
static void drop_oldest(sensor_device_t *device, uint64_t taken)
{
    if (atomic_compare_exchange_strong(&device->taken, &taken, taken + 1u)) {
        atomic_fetch_add_explicit(&device->dropped, 1, memory_order_relaxed);
    }
}

static void keep_values(sensor_device_t *device, _Atomic uint64_t *words)
{
    const fcsl_driver_t *driver = device->driver;
    for (uint32_t s = 0; s < driver->signal_count; s++) {
        const fcsl_driver_signal_t *signal = &driver->signals[s];
        const size_t scalar = fcsl_scalar_size(signal->type);
        for (uint32_t i = 0; device->used[s] != FCSL_DRIVER_UNUSED && i < signal->count; i++) {
            const uint8_t *bytes = (const uint8_t *)device->state + signal->offset + i * scalar;
            const double value = fcsl_scalar_as_double(bytes, signal->type);
            uint64_t bits = 0;
            memcpy(&bits, &value, sizeof bits);
            atomic_store_explicit(&words[device->at[s] + i], bits, memory_order_relaxed);
        }
    }
}

static void keep_sample(sensor_device_t *device, uint64_t sample_ns)
{
    const uint64_t written = atomic_load_explicit(&device->written, memory_order_relaxed);
    const uint64_t taken = atomic_load(&device->taken);
    if (written - taken >= DEVICE_RING_SAMPLES) {
        drop_oldest(device, taken);
    }
    _Atomic uint64_t *words = device->ring[written % DEVICE_RING_SAMPLES];
    atomic_store_explicit(&words[0], sample_ns, memory_order_relaxed);
    keep_values(device, words + 1);
    atomic_store_explicit(&device->written, written + 1u, memory_order_release);
    atomic_fetch_add_explicit(&device->samples, 1, memory_order_relaxed);
    if (device->posted != NULL) {
        (void)sem_post(device->posted);
    }
}

/* ---- what arrives */

static fcsl_driver_input_t *input_of(const sensor_device_t *device)
{
    void *input = (uint8_t *)device->state + device->driver->input;
    return device->driver->input != 0u ? input : NULL;
}

/* Of what a read took in without giving a sample. */
static uint32_t why_of(const fcsl_driver_input_t *input)
{
    if (input->why != FCSL_DRIVER_NOT_TOLD && input->why < FCSL_DRIVER_WHYS) {
        return input->why;
    }
    return input->bytes > 0u ? (uint32_t)FCSL_DRIVER_NO_FRAMES : (uint32_t)FCSL_DRIVER_NO_BYTES;
}

/* Counts it. Returns why no sample has come for SILENT_NS, or 0. */
static uint32_t count_input(sensor_device_t *device, int has_sample)
{
    const fcsl_driver_input_t *input = input_of(device);
    if (input == NULL) {
        return FCSL_DRIVER_NOT_TOLD;
    }
    atomic_fetch_add_explicit(&device->bytes, input->bytes, memory_order_relaxed);
    atomic_fetch_add_explicit(&device->frames, input->frames, memory_order_relaxed);
    atomic_fetch_add_explicit(&device->rejected, input->rejected, memory_order_relaxed);
    const uint64_t now = fcsl_monotonic_ns();
    const uint32_t why = why_of(input);
    const uint32_t worst = why > device->why_now ? why : device->why_now;
    const int begins_anew = has_sample || now - device->since_ns >= SILENT_NS;
    device->why_now = begins_anew ? (uint32_t)FCSL_DRIVER_NOT_TOLD : worst;
    device->since_ns = begins_anew ? now : device->since_ns;
    return begins_anew && !has_sample ? worst : (uint32_t)FCSL_DRIVER_NOT_TOLD;
}

const char *board_why_text(uint64_t why)
{
    static const char *const TEXTS[FCSL_DRIVER_WHYS] = {
        [FCSL_DRIVER_NOT_TOLD] = "",
        [FCSL_DRIVER_NO_BYTES] = "no bytes arrive",
        [FCSL_DRIVER_NO_FRAMES] = "bytes arrive, and none are a frame of this protocol: another protocol or baud rate?",
        [FCSL_DRIVER_LINE_ENDS] = "lines arrive that do not end with CR LF",
        [FCSL_DRIVER_NO_CHECKSUMS] = "sentences arrive without a checksum",
        [FCSL_DRIVER_OTHER_FRAMES] = "frames arrive, and none of the kinds that the driver reads",
        [FCSL_DRIVER_GGA_ALONE] = "GGA arrives without an RMC of the same time",
        [FCSL_DRIVER_RMC_ALONE] = "RMC arrives without a GGA of the same time",
        [FCSL_DRIVER_NO_TIME] = "sentences arrive without a time: the receiver knows none yet",
        [FCSL_DRIVER_REFUSED] = "frames arrive with a field that cannot be",
        [FCSL_DRIVER_REPEATED] = "the receiver repeats its last frame: it does not hear the transmitter",
        [FCSL_DRIVER_SHORT_FRAMES] = "frames arrive that are too short for a signal of the device",
    };
    return why < FCSL_DRIVER_WHYS ? TEXTS[why] : "unknown";
}

/* Reads once. Returns how long to wait before the next read of a driver that waits by itself. */
static uint64_t read_device(sensor_device_t *device)
{
    char why[DEVICE_REASON_BYTES] = "";
    uint64_t sample_ns = 0;
    fcsl_driver_input_t *input = input_of(device);
    if (input != NULL) {
        *input = (fcsl_driver_input_t){0};
    }
    fcsl_driver_status_t status = device->driver->read(device->state, &sample_ns, why, sizeof why);
    why[sizeof why - 1u] = '\0';
    const uint32_t silence = count_input(device, status == FCSL_DRIVER_OK);
    if (status == FCSL_DRIVER_OK && sample_ns > fcsl_monotonic_ns() + AHEAD_NS) {
        (void)snprintf(why, sizeof why, "its sample has a time in the future");
        status = FCSL_DRIVER_FAILED;
    }
    if (status == FCSL_DRIVER_OK) {
        keep_sample(device, sample_ns);
        if (atomic_load(&device->condition) != DEVICE_OPEN) {
            set_condition(device, DEVICE_OPEN, FCSL_DRIVER_NOT_TOLD, "");
        }
        return 0;
    }
    if (status == FCSL_DRIVER_NOTHING) {
        if (silence != FCSL_DRIVER_NOT_TOLD) {
            set_condition(device, DEVICE_SILENT, silence, board_why_text(silence));
        }
        return 0;
    }
    atomic_fetch_add_explicit(&device->errors, 1, memory_order_relaxed);
    if (status == FCSL_DRIVER_ABSENT) {
        device->driver->close(device->state);
        atomic_store(&device->opened, 0);
        atomic_fetch_add_explicit(&device->lost, 1, memory_order_relaxed);
        set_condition(device, DEVICE_MISSING, FCSL_DRIVER_NOT_TOLD, why);
        return RECHECK_NS;
    }
    if (atomic_load(&device->condition) != DEVICE_FAILING) {
        set_condition(device, DEVICE_FAILING, FCSL_DRIVER_NOT_TOLD, why);
    }
    return FAILED_NS;
}

/* Until then, or until the end. */
static void sleep_until(sensor_device_t *device, uint64_t until_ns)
{
    const struct timespec until = fcsl_timespec_of(until_ns);
    while (atomic_load(&device->over) == 0 && sem_clockwait(&device->wake, CLOCK_MONOTONIC, &until) != 0 &&
           errno == EINTR) {
    }
}

/* The next time in the grid of the period that has not passed. */
static uint64_t next_due(uint64_t due_ns, uint64_t period_ns)
{
    const uint64_t now = fcsl_monotonic_ns();
    return now < due_ns + period_ns ? due_ns + period_ns : due_ns + ((now - due_ns) / period_ns + 1u) * period_ns;
}

/* Opens a device that was not there; one that is there and refuses is told. */
static int reopen(sensor_device_t *device)
{
    char why[DEVICE_REASON_BYTES] = "";
    const int status = open_device(device, why, sizeof why);
    if (status == FCSL_DRIVER_FAILED) {
        atomic_fetch_add_explicit(&device->errors, 1, memory_order_relaxed);
        if (atomic_load(&device->condition) != DEVICE_FAILING) {
            set_condition(device, DEVICE_FAILING, FCSL_DRIVER_NOT_TOLD, why);
        }
    }
    return status == FCSL_DRIVER_OK;
}

static void *run(void *ctx)
{
    sensor_device_t *device = ctx;
    uint64_t due_ns = fcsl_monotonic_ns();
    while (atomic_load(&device->over) == 0) {
        if (!atomic_load(&device->opened) && !reopen(device)) {
            sleep_until(device, fcsl_monotonic_ns() + RECHECK_NS);
            continue;
        }
        const uint64_t wait_ns = read_device(device);
        if (!device->driver->waits && atomic_load(&device->opened)) {
            due_ns = next_due(due_ns, device->plan->period_ns);
            sleep_until(device, due_ns);
        } else if (wait_ns > 0u) {
            sleep_until(device, fcsl_monotonic_ns() + wait_ns);
        }
    }
    (void)sem_post(&device->finished);
    return NULL;
}

void sensor_device_post(sensor_device_t *device, sem_t *semaphore)
{
    device->posted = semaphore;
}

int sensor_device_start(sensor_device_t *device, int priority, fcsl_error_t *error)
{
    char why[DEVICE_REASON_BYTES] = "";
    const int status = open_device(device, why, sizeof why);
    if (status == FCSL_DRIVER_FAILED) {
        return fcsl_fail(error, "device '%.60s' (%.200s) cannot be opened: %s", device->plan->name,
                         device->plan->address, why[0] != '\0' ? why : "the driver gives no reason");
    }
    set_condition(device, status == FCSL_DRIVER_OK ? DEVICE_OPEN : DEVICE_MISSING, FCSL_DRIVER_NOT_TOLD, why);
    device->reported = DEVICE_OPEN;
    const int code = device_thread_start(&device->thread, priority, run, device);
    device->started = code == 0;
    return code == 0 ? 0 : fcsl_fail(error, "device '%.60s': no thread: %s", device->plan->name, strerror(code));
}

/* ---- the step thread ------------------------------------------------------------------------------------------------ */

/* The device's thread may take the oldest sample away meanwhile: then the next one is tried. */
int sensor_device_take(sensor_device_t *device, device_sample_t *sample)
{
    for (uint32_t i = 0; i < DEVICE_RING_SAMPLES; i++) {
        uint64_t taken = atomic_load(&device->taken);
        if (taken == atomic_load_explicit(&device->written, memory_order_acquire)) {
            return 0;
        }
        const _Atomic uint64_t *words = device->ring[taken % DEVICE_RING_SAMPLES];
        sample->sample_ns = atomic_load_explicit(&words[0], memory_order_relaxed);
        for (uint32_t v = 0; v < device->value_count; v++) {
            const uint64_t bits = atomic_load_explicit(&words[1u + v], memory_order_relaxed);
            memcpy(&sample->values[v], &bits, sizeof bits);
        }
        if (atomic_compare_exchange_strong(&device->taken, &taken, taken + 1u)) {
            return 1;
        }
    }
    return 0;
}

void sensor_device_skip(sensor_device_t *device, uint32_t most)
{
    for (uint32_t i = 0; i < DEVICE_RING_SAMPLES; i++) {
        const uint64_t taken = atomic_load(&device->taken);
        if (atomic_load_explicit(&device->written, memory_order_acquire) - taken <= most) {
            return;
        }
        drop_oldest(device, taken);
    }
}

int sensor_device_has_sample(const sensor_device_t *device)
{
    return atomic_load_explicit(&device->taken, memory_order_relaxed) !=
           atomic_load_explicit(&device->written, memory_order_acquire);
}

int sensor_device_is_well(const sensor_device_t *device)
{
    const int condition = atomic_load(&device->condition);
    return condition == DEVICE_OPEN || condition == DEVICE_SILENT;
}

device_counts_t sensor_device_counts(const sensor_device_t *device)
{
    return (device_counts_t){
        .samples = atomic_load_explicit(&device->samples, memory_order_relaxed),
        .errors = atomic_load_explicit(&device->errors, memory_order_relaxed),
        .dropped = atomic_load_explicit(&device->dropped, memory_order_relaxed),
        .lost = atomic_load_explicit(&device->lost, memory_order_relaxed),
        .open = atomic_load_explicit(&device->opened, memory_order_relaxed) != 0,
        .bytes = atomic_load_explicit(&device->bytes, memory_order_relaxed),
        .frames = atomic_load_explicit(&device->frames, memory_order_relaxed),
        .rejected = atomic_load_explicit(&device->rejected, memory_order_relaxed),
        .why = atomic_load_explicit(&device->why, memory_order_relaxed),
    };
}

const char *sensor_device_news(sensor_device_t *device)
{
    static const char *const CONDITION_TEXTS[] = {[DEVICE_MISSING] = "is not there: ",
                                                  [DEVICE_OPEN] = "is there",
                                                  [DEVICE_SILENT] = "is silent: ",
                                                  [DEVICE_FAILING] = "fails: "};
    const uint64_t now = fcsl_monotonic_ns();
    if ((atomic_load(&device->condition) == (int)device->reported &&
         atomic_load(&device->why) == device->reported_why) ||
        now - device->reported_ns < NEWS_NS || pthread_mutex_trylock(&device->reason_lock) != 0) {
        return NULL;
    }
    device->reported_ns = now;
    device->reported = (condition_t)atomic_load(&device->condition);
    device->reported_why = atomic_load(&device->why);
    (void)snprintf(device->news, sizeof device->news, "device '%.60s' %s%s", device->plan->name,
                   CONDITION_TEXTS[device->reported], device->reported == DEVICE_OPEN ? "" : device->reason);
    (void)pthread_mutex_unlock(&device->reason_lock);
    return device->news;
}

static int end_thread(sensor_device_t *device)
{
    atomic_store(&device->over, 1);
    (void)sem_post(&device->wake);
    return device_thread_end(device->thread, &device->finished, fcsl_monotonic_ns() + END_NS);
}

int sensor_device_free(sensor_device_t *device)
{
    if (device == NULL) {
        return 0;
    }
    if (device->started && end_thread(device) != 0) {
        return -1; /* its memory stays: the driver may still return to it */
    }
    if (atomic_load(&device->opened)) {
        device->driver->close(device->state);
    }
    (void)sem_destroy(&device->wake);
    (void)sem_destroy(&device->finished);
    (void)pthread_mutex_destroy(&device->reason_lock);
    free(device->state);
    free(device->used);
    free(device->at);
    if (device->library != NULL) {
        (void)dlclose(device->library);
    }
    free(device);
    return 0;
}
