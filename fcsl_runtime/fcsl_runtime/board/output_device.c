/* SPDX-License-Identifier: Apache-2.0
 *
 * An output device and its thread, which alone calls the driver: a driver may wait, the guard's loop may not.
 *
 * Values go to the thread, and reasons come back, as the newest ones alone (fcsl_latest.h): a slow device gets the last command, not a
 * queue of old ones. `wake` is posted only when the thread had taken the values before, so it never counts further than 1 and the end.
 * `taken` and `ended` are numbers of puts; the loop compares them with its own and sees a write that hangs.
 */
#define _GNU_SOURCE
#include "output_device.h"

#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "device_thread.h"
#include "fcsl/fcsl_latest.h"
#include "fcsl/fcsl_library.h"
#include "fcsl/fcsl_scalar.h"

struct output_device {
    char *name; /* of its driver as the user writes it */
    char *address;
    const fcsl_driver_t *driver;
    void *library; /* null: a driver built in */
    uint8_t *used; /* by signal */
    void *state; /* the thread's, once it runs */
    int opened;

    pthread_t thread;
    int started;
    atomic_int over;
    sem_t wake;
    sem_t finished; /* posted by the thread, at its end */
    fcsl_latest_t values; /* from the loop */
    fcsl_latest_t reasons; /* from the thread */
    _Atomic uint64_t ended; /* the number of the values of the last write */
    _Atomic uint64_t taken; /* of the last write that went well */
    _Atomic uint64_t failed;

    /* The loop's. */
    uint64_t awaited; /* the number of values */
    uint64_t timeout_ns;
    uint64_t ended_seen;
    uint64_t since_ns; /* since when no write has ended */
    uint64_t late;
    char reason[OUTPUT_REASON_BYTES];
};

/* ---- before the thread ---------------------------------------------------------------------------------------------- */

static int allocate(output_device_t *device, fcsl_error_t *error)
{
    const fcsl_driver_t *driver = device->driver;
    device->state = device_state_new(driver);
    device->used = calloc(driver->signal_count, 1);
    if (device->state == NULL || device->used == NULL || fcsl_latest_open(&device->values, driver->state_size) != 0 ||
        fcsl_latest_open(&device->reasons, OUTPUT_REASON_BYTES) != 0) {
        return fcsl_fail(error, "out of memory for driver '%.100s'", device->name);
    }
    return 0;
}

static void free_memory(output_device_t *device)
{
    fcsl_latest_close(&device->values);
    fcsl_latest_close(&device->reasons);
    (void)sem_destroy(&device->wake);
    (void)sem_destroy(&device->finished);
    free(device->state);
    free(device->used);
    if (device->library != NULL) {
        (void)dlclose(device->library);
    }
    free(device->name);
    free(device->address);
    free(device);
}

output_device_t *output_device_new(const char *driver, const char *address, fcsl_error_t *error)
{
    output_device_t *device = calloc(1, sizeof *device);
    if (device == NULL || sem_init(&device->wake, 0, 0) != 0 || sem_init(&device->finished, 0, 0) != 0) {
        free(device);
        (void)fcsl_fail(error, "out of memory for driver '%.100s'", driver);
        return NULL;
    }
    device->name = strdup(driver);
    device->address = strdup(address);
    if (device->name == NULL || device->address == NULL) {
        (void)fcsl_fail(error, "out of memory for driver '%.100s'", driver);
    } else {
        device->driver = fcsl_library_driver(driver, FCSL_ACTUATOR, &device->library, error);
    }
    if (device->driver == NULL || allocate(device, error) != 0) {
        free_memory(device);
        return NULL;
    }
    return device;
}

const char *output_device_driver_name(const output_device_t *device)
{
    return device->name;
}

const char *output_device_address(const output_device_t *device)
{
    return device->address;
}

const fcsl_driver_t *output_device_driver(const output_device_t *device)
{
    return device->driver;
}

int output_device_use(output_device_t *device, uint32_t signal)
{
    const int is_free = device->used[signal] == FCSL_DRIVER_UNUSED;
    device->used[signal] = FCSL_DRIVER_NEEDED;
    return is_free ? 0 : -1;
}

/* ---- the thread ----------------------------------------------------------------------------------------------------- */

static void take_values(output_device_t *device)
{
    const fcsl_driver_t *driver = device->driver;
    const uint8_t *values = fcsl_latest_front(&device->values);
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        const fcsl_driver_signal_t *signal = &driver->signals[i];
        if (device->used[i] != FCSL_DRIVER_UNUSED) {
            memcpy((uint8_t *)device->state + signal->offset, values + signal->offset,
                   (size_t)signal->count * fcsl_scalar_size(signal->type));
        }
    }
}

static void write_values(output_device_t *device, uint64_t number)
{
    char *why = fcsl_latest_back(&device->reasons);
    memset(why, 0, OUTPUT_REASON_BYTES);
    take_values(device);
    if (device->driver->write(device->state, why, OUTPUT_REASON_BYTES) == FCSL_DRIVER_OK) {
        atomic_store(&device->taken, number);
    } else {
        why[OUTPUT_REASON_BYTES - 1] = '\0';
        (void)fcsl_latest_put(&device->reasons);
        atomic_fetch_add(&device->failed, 1);
    }
    atomic_store(&device->ended, number);
}

static void *run(void *ctx)
{
    output_device_t *device = ctx;
    for (;;) {
        while (sem_wait(&device->wake) != 0) {
        }
        const uint64_t number = fcsl_latest_take(&device->values);
        if (number > 0u) {
            write_values(device, number);
        } else if (atomic_load(&device->over) != 0) {
            (void)sem_post(&device->finished);
            return NULL;
        }
    }
}

static int open_device(output_device_t *device, fcsl_error_t *error)
{
    const fcsl_driver_t *driver = device->driver;
    char why[OUTPUT_REASON_BYTES] = "";
    const char *what = "is not there";
    fcsl_driver_status_t status = driver->probe(device->address, why, sizeof why);
    if (status == FCSL_DRIVER_OK) {
        what = "cannot be opened";
        status = driver->open(device->state, device->address, device->used, why, sizeof why);
    }
    device->opened = status == FCSL_DRIVER_OK;
    why[sizeof why - 1u] = '\0';
    return device->opened ? 0
                          : fcsl_fail(error, "device '%.150s' of driver '%.150s' %s: %s", device->address, device->name,
                                      what, why[0] != '\0' ? why : "the driver gives no reason");
}

int output_device_start(output_device_t *device, int priority, uint64_t timeout_ns, fcsl_error_t *error)
{
    device->timeout_ns = timeout_ns;
    if (open_device(device, error) != 0) {
        return -1;
    }
    const int code = device_thread_start(&device->thread, priority, run, device);
    device->started = code == 0;
    return code == 0 ? 0
                     : fcsl_fail(error, "device '%.150s' of driver '%.150s': no thread: %s", device->address,
                                 device->name, strerror(code));
}

int output_device_is_open(const output_device_t *device)
{
    return device->started;
}

/* ---- the loop ------------------------------------------------------------------------------------------------------- */

void *output_device_values(output_device_t *device)
{
    return fcsl_latest_back(&device->values);
}

/* A thread that gets no processor is as bad as a write that hangs. */
static void check_after_write(output_device_t *device, uint64_t now_ns)
{
    const uint64_t ended = atomic_load(&device->ended);
    if (ended == device->values.puts || ended != device->ended_seen) {
        device->ended_seen = ended;
        device->since_ns = now_ns;
    } else if (now_ns > device->since_ns && now_ns - device->since_ns > device->timeout_ns) {
        device->late++;
        (void)fcsl_latest_take(&device->reasons); /* of a write before */
        (void)snprintf(device->reason, sizeof device->reason, "it has ended no write for %.6g ms",
                       (double)device->timeout_ns / 1e6);
    }
}

void output_device_put(output_device_t *device, uint64_t now_ns)
{
    check_after_write(device, now_ns);
    if (fcsl_latest_put(&device->values)) {
        (void)sem_post(&device->wake);
    }
}

int output_device_is_busy(const output_device_t *device)
{
    return atomic_load(&device->ended) != device->values.puts;
}

void output_device_await(output_device_t *device)
{
    device->awaited = device->values.puts;
}

int output_device_has_taken(const output_device_t *device)
{
    return atomic_load(&device->taken) >= device->awaited;
}

uint64_t output_device_missed(const output_device_t *device)
{
    return atomic_load(&device->failed) + device->late;
}

const char *output_device_reason(output_device_t *device)
{
    if (fcsl_latest_take(&device->reasons) > 0u) {
        memcpy(device->reason, fcsl_latest_front(&device->reasons), sizeof device->reason);
    }
    return device->reason;
}

/* ---- the end -------------------------------------------------------------------------------------------------------- */

void output_device_end(output_device_t *device)
{
    atomic_store(&device->over, 1);
    (void)sem_post(&device->wake);
}

void output_device_free(output_device_t *device, uint64_t until_ns)
{
    if (device->started && device_thread_end(device->thread, &device->finished, until_ns) != 0) {
        return; /* the driver may still come back to its memory */
    }
    if (device->opened) {
        device->driver->close(device->state);
    }
    free_memory(device);
}
