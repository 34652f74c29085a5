/* SPDX-License-Identifier: Apache-2.0
 *
 * The readings of a tick.
 */
#include "readings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_cdr.h"

enum {
    NAME_BYTES = 512,
    HEAD_BYTES = 64,
    NAMED_BYTES = 2 * BOARD_NAME_BYTES + 8,
    READING_BYTES = 32 + FCSL_VALUES_MAX * 8
};
static const size_t CAPACITY =
    HEAD_BYTES + BOARD_SENSORS_MAX * FCSL_BACKENDS_MAX * (size_t)NAMED_BYTES + READINGS_MAX * (size_t)READING_BYTES;
static const char TYPE[] = "fcsl_hal/msg/Readings";
static const char SCHEMA[] =
    "std_msgs/Header header\n"
    "uint64 tick\n"
    "uint64 now_ns  # monotonic time of the tick\n"
    "string[] backends  # in the first message: sensor and device of each, as readings count them\n"
    "Reading[] readings\n" FCSL_SCHEMA_SEPARATOR "MSG: fcsl_hal/Reading\n"
    "uint32 sensor  # of the board, from 0\n"
    "uint32 backend  # of the sensor, from 0\n"
    "uint64 sample_ns  # monotonic\n"
    "float64[] values  # of the quantities that its kind measures (docs/hardware/hal.md); NaN: not "
    "told\n" FCSL_SCHEMA_HEADER;

/* Those that devices give stand before those that are computed. */
static uint32_t given_values(const fcsl_sensor_kind_info_t *kind)
{
    uint32_t count = 0;
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        count += kind->quantities[q].given ? kind->quantities[q].count : 0u;
    }
    return count;
}

int readings_record(readings_t *readings, const board_plan_t *plan, fcsl_run_t *run, const char *name_space,
                    fcsl_error_t *error)
{
    char name[NAME_BYTES];
    readings->plan = plan;
    readings->named = 0;
    for (uint32_t s = 0; s < plan->sensor_count; s++) {
        readings->values[s] = given_values(&fcsl_sensor_kinds[plan->sensors[s].config.kind]);
    }
    const int length = snprintf(name, sizeof name, "%s%s/readings", name_space[0] != '\0' ? "/" : "", name_space);
    if (length < 0 || (size_t)length >= sizeof name) {
        return fcsl_fail(error, "the namespace is too long for the topic of the readings");
    }
    readings->cdr = calloc(1, CAPACITY);
    if (readings->cdr == NULL) {
        return fcsl_fail(error, "out of memory for the readings");
    }
    readings->topic = fcsl_run_record_add_topic(run, name, TYPE, SCHEMA, error);
    return readings->topic < 0 ? -1 : 0;
}

static void put_reading(fcsl_cdr_t *cdr, const sensor_reading_t *kept, uint32_t values)
{
    fcsl_cdr_u32(cdr, kept->sensor);
    fcsl_cdr_u32(cdr, kept->reading.backend);
    fcsl_cdr_u64(cdr, kept->reading.sample_ns);
    fcsl_cdr_u32(cdr, values);
    for (uint32_t i = 0; i < values; i++) {
        uint64_t bits = 0;
        memcpy(&bits, &kept->reading.values[i], sizeof bits);
        fcsl_cdr_u64(cdr, bits);
    }
}

/* The backends of the plan; null: none of them. */
static void put_names(fcsl_cdr_t *cdr, const board_plan_t *plan)
{
    uint32_t count = 0;
    for (uint32_t s = 0; plan != NULL && s < plan->sensor_count; s++) {
        count += plan->sensors[s].config.backend_count;
    }
    fcsl_cdr_u32(cdr, count);
    for (uint32_t s = 0; plan != NULL && s < plan->sensor_count; s++) {
        const board_sensor_t *sensor = &plan->sensors[s];
        for (uint32_t b = 0; b < sensor->config.backend_count; b++) {
            char name[2 * BOARD_NAME_BYTES];
            (void)snprintf(name, sizeof name, "%.64s %.64s", sensor->name, plan->devices[sensor->devices[b]].name);
            fcsl_cdr_string(cdr, name);
        }
    }
}

void readings_end_tick(readings_t *readings, fcsl_run_t *run, uint64_t now_ns)
{
    if (readings->topic >= 0) {
        fcsl_error_t error; /* of a disk; the recording tells it */
        fcsl_cdr_t cdr;
        const uint64_t time_ns = fcsl_run_tick_time_ns(run, fcsl_run_tick(run));
        fcsl_cdr_begin(&cdr, readings->cdr, CAPACITY);
        fcsl_cdr_header(&cdr, time_ns);
        fcsl_cdr_u64(&cdr, fcsl_run_tick(run));
        fcsl_cdr_u64(&cdr, now_ns);
        put_names(&cdr, readings->named ? NULL : readings->plan);
        readings->named = 1;
        fcsl_cdr_u32(&cdr, readings->count);
        for (uint32_t i = 0; i < readings->count; i++) {
            put_reading(&cdr, &readings->kept[i], readings->values[readings->kept[i].sensor]);
        }
        (void)fcsl_run_record_write(run, readings->topic, time_ns, readings->cdr, (uint32_t)fcsl_cdr_end(&cdr), &error);
    }
    readings->count = 0;
}

void readings_free(readings_t *readings)
{
    free(readings->cdr);
    readings->cdr = NULL;
}
