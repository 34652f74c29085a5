/* SPDX-License-Identifier: Apache-2.0
 *
 * The counters of a board.
 */
#include "counters.h"

#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_error.h"

enum { PATH_BYTES = 256 };

static const struct {
    const char *name;
    const char *doc;
} OF_DEVICE[] = {
    {"open", "1: the device is there"},
    {"samples", "samples that it gave; 0 for one that is driven"},
    {"errors", "reads or writes that failed"},
    {"dropped", "samples that no tick got: a tick was late, or the flight was paused"},
    {"lost", "times that it was gone"},
    {"bytes", "bytes that arrived; 0 where the driver does not tell, as of the next ones"},
    {"frames", "whole frames of its protocol among them"},
    {"rejected", "bytes among them that belong to no frame"},
    {"why", "why no sample comes, by the numbers of docs/hardware/hal.md; 0: samples come"},
};
enum { DEVICE_COUNTERS = sizeof OF_DEVICE / sizeof OF_DEVICE[0] };

static const char PRIMARY[] = "1: its first device, and so on; 0: no device is healthy";
static const char CONDITION[] = "0 healthy, 1 silent, 2 invalid, 3 out of range, 4 stuck, 5 disagrees, 6 recovering";

static void add(counters_t *counters, const char *group, const char *owner, const char *name, const char *doc)
{
    char *path = counters->texts + (size_t)counters->count * PATH_BYTES;
    (void)snprintf(path, PATH_BYTES, "%s.%s.%s", group, owner, name);
    counters->fields[counters->count] = (fcsl_field_t){
        .path = path,
        .role = FCSL_ROLE_OUTPUT,
        .type = FCSL_U64,
        .count = 1,
        .offset = counters->count * (uint32_t)sizeof(uint64_t),
        .size = sizeof(uint64_t),
        .instance = FCSL_NONE,
        .connected_from = FCSL_NONE,
        .unit = "",
        .doc = doc,
    };
    counters->count++;
}

int counters_open(counters_t *counters, const board_plan_t *plan, fcsl_error_t *error)
{
    const size_t most =
        plan->sensor_count * (FCSL_BACKENDS_MAX + 1u) + plan->device_count * (size_t)DEVICE_COUNTERS + 1u;
    counters->fields = calloc(most, sizeof *counters->fields);
    counters->values = calloc(most, sizeof *counters->values);
    counters->texts = calloc(most, PATH_BYTES);
    if (counters->fields == NULL || counters->values == NULL || counters->texts == NULL) {
        return fcsl_fail(error, "out of memory for the counters of the board");
    }
    for (uint32_t s = 0; s < plan->sensor_count; s++) {
        const board_sensor_t *sensor = &plan->sensors[s];
        add(counters, "sensors", sensor->name, "primary", PRIMARY);
        for (uint32_t b = 0; b < sensor->config.backend_count; b++) {
            char name[BOARD_NAME_BYTES + sizeof "condition."];
            (void)snprintf(name, sizeof name, "condition.%.64s", plan->devices[sensor->devices[b]].name);
            add(counters, "sensors", sensor->name, name, CONDITION);
        }
    }
    for (uint32_t d = 0; d < plan->device_count; d++) {
        for (uint32_t i = 0; board_plan_flies(plan, d) && i < DEVICE_COUNTERS; i++) {
            add(counters, "devices", plan->devices[d].name, OF_DEVICE[i].name, OF_DEVICE[i].doc);
        }
    }
    return 0;
}

void counters_free(counters_t *counters)
{
    free(counters->fields);
    free(counters->values);
    free(counters->texts);
    *counters = (counters_t){0};
}
