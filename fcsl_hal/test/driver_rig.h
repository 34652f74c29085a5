/* SPDX-License-Identifier: Apache-2.0
 *
 * A driver under test: opens it as a host does, and finds its values by the names of its signals.
 */
#ifndef FCSL_DRIVER_RIG_H
#define FCSL_DRIVER_RIG_H

#include <stdalign.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_driver.h"
#include "fcsl_check.h"

enum { RIG_STATE_BYTES = 1 << 16, RIG_WHY_BYTES = 200, RIG_SIGNALS_MAX = 16 };

typedef struct {
    const fcsl_driver_t *driver;
    alignas(16) uint8_t self[RIG_STATE_BYTES];
    uint64_t sample_ns; /* of the last read */
    uint64_t took_ns;
    fcsl_driver_input_t input; /* of all reads: the sums, and the largest reason */
    char why[RIG_WHY_BYTES];
} rig_t;

/* Opens the device with its first signals needed, and the others optional. */
static inline fcsl_driver_status_t rig_open_needed(rig_t *rig, const fcsl_driver_t *driver, const char *device,
                                                   uint32_t needed)
{
    uint8_t flags[RIG_SIGNALS_MAX] = {0};
    memset(rig, 0, sizeof *rig);
    rig->driver = driver;
    CHECK(driver->abi_version == FCSL_DRIVER_ABI_VERSION && driver->direction == FCSL_SENSOR && driver->waits == 1u);
    CHECK(driver->state_size <= RIG_STATE_BYTES && driver->state_align <= 16u);
    CHECK(driver->signal_count <= RIG_SIGNALS_MAX && needed <= driver->signal_count && driver->write == NULL);
    memset(flags, FCSL_DRIVER_OPTIONAL, sizeof flags);
    memset(flags, FCSL_DRIVER_NEEDED, needed);
    return driver->open(rig->self, device, flags, rig->why, sizeof rig->why);
}

static inline fcsl_driver_status_t rig_open(rig_t *rig, const fcsl_driver_t *driver, const char *device)
{
    return rig_open_needed(rig, driver, device, 0);
}

/* What the driver tells of a read. */
static inline void rig_add_input(rig_t *rig)
{
    fcsl_driver_input_t input;
    memcpy(&input, rig->self + rig->driver->input, sizeof input);
    rig->input.bytes += input.bytes;
    rig->input.frames += input.frames;
    rig->input.rejected += input.rejected;
    rig->input.why = input.why > rig->input.why ? input.why : rig->input.why;
}

static inline fcsl_driver_status_t rig_read(rig_t *rig)
{
    const uint32_t at = rig->driver->input;
    memset(rig->self + at, 0, at != 0u ? sizeof(fcsl_driver_input_t) : 0u);
    const uint64_t before_ns = fcsl_monotonic_ns();
    const uint64_t last_ns = rig->sample_ns;
    rig->why[0] = '\0';
    const fcsl_driver_status_t status = rig->driver->read(rig->self, &rig->sample_ns, rig->why, sizeof rig->why);
    rig->took_ns = fcsl_monotonic_ns() - before_ns;
    if (at != 0u) {
        rig_add_input(rig);
    }
    CHECK(status == FCSL_DRIVER_OK || rig->sample_ns == last_ns);
    CHECK((status == FCSL_DRIVER_OK || status == FCSL_DRIVER_NOTHING) == (rig->why[0] == '\0'));
    return status;
}

static inline void rig_close(rig_t *rig)
{
    rig->driver->close(rig->self);
}

/* A value of a signal: bool or f64. */
static inline double rig_value(const rig_t *rig, const char *name, uint32_t index)
{
    for (uint32_t i = 0; i < rig->driver->signal_count; i++) {
        const fcsl_driver_signal_t *signal = &rig->driver->signals[i];
        if (strcmp(signal->name, name) == 0) {
            double number = 0.0;
            CHECK(index < signal->count);
            if (signal->type == FCSL_BOOL) {
                return rig->self[signal->offset + index];
            }
            CHECK(signal->type == FCSL_F64);
            memcpy(&number, rig->self + signal->offset + index * sizeof number, sizeof number);
            return number;
        }
    }
    CHECK(!"the driver has this signal");
    return 0.0;
}

/* Whether a probe gives this status and a reason with this text. */
static inline int rig_probes(const fcsl_driver_t *driver, const char *device, fcsl_driver_status_t status,
                             const char *text)
{
    char why[RIG_WHY_BYTES] = "";
    return driver->probe(device, why, sizeof why) == status && strstr(why, text) != NULL &&
           (status == FCSL_DRIVER_OK) == (why[0] == '\0');
}

/* Whether a silent device gives NOTHING in time: the shortest of some tries, because the machine may be busy. */
static inline int rig_is_silent(rig_t *rig)
{
    enum { TRIES = 5, SILENT_MS = 200 };
    uint64_t shortest_ns = UINT64_MAX;
    for (int i = 0; i < TRIES && shortest_ns >= (uint64_t)SILENT_MS * FCSL_NS_PER_MS; i++) {
        CHECK(rig_read(rig) == FCSL_DRIVER_NOTHING);
        shortest_ns = rig->took_ns < shortest_ns ? rig->took_ns : shortest_ns;
    }
    return shortest_ns < (uint64_t)SILENT_MS * FCSL_NS_PER_MS;
}

#endif /* FCSL_DRIVER_RIG_H */
