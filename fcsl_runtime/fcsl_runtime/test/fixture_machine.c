/* SPDX-License-Identifier: Apache-2.0
 *
 * The machine of fixture/fixture.json with what fcslc makes of none: a row behind each table, which no host may read (whoever
 * follows its pointers crashes); the health of each instance far from all else of it; and, built with -DFIXTURE_TWIN, a second
 * machine that differs in its name alone.
 */
#include <string.h>

#include "fixture.h"

enum { INSTANCES = 2, FIELDS_MAX = 64, ROWS_MAX = 8, GAP_BYTES = 256 };

typedef struct {
    fixture_t compiled;
    struct {
        uint8_t gap[GAP_BYTES];
        int32_t health;
    } far[INSTANCES];
} data_t;

static fcsl_machine_t fixture;
static fcsl_field_t fields[FIELDS_MAX];
static fcsl_instance_t instances[ROWS_MAX];
static fcsl_state_t states[ROWS_MAX];
static const char *requests[ROWS_MAX];
static fcsl_channel_t channels[ROWS_MAX];
static fcsl_fault_place_t fault_places[ROWS_MAX];

#ifdef FIXTURE_TWIN
static fcsl_machine_t fixture_twin;
const fcsl_machine_t *const fcsl_machines[] = {&fixture, &fixture_twin, NULL};
#else
const fcsl_machine_t *const fcsl_machines[] = {&fixture, NULL};
#endif

static void copy_health(data_t *m)
{
    m->far[0].health = m->compiled.i_sensors.outputs.health;
    m->far[1].health = m->compiled.i_pilot.outputs.health;
}

static void init(void *machine)
{
    memset(machine, 0, sizeof(data_t));
    fixture_machine.init(machine);
}

static int32_t start(void *machine)
{
    const int32_t failed = fixture_machine.start(machine);
    copy_health(machine);
    return failed;
}

static void step(void *machine, const fcsl_host_t *host)
{
    fixture_machine.step(machine, host);
    copy_health(machine);
}

static void force_state(void *machine, int32_t state)
{
    fixture_machine.force_state(machine, state);
    copy_health(machine);
}

static uint32_t far_health(uint32_t instance)
{
    return (uint32_t)offsetof(data_t, far) + instance * (GAP_BYTES + 4u) + GAP_BYTES;
}

#define BEHIND ((const char *)1)
#define FAR    (FCSL_NO_OFFSET - 1u)
/* The table copied, with a row behind it. The library does not load if there is no room. */
#define EXTEND(table, count, ...)                                                                                      \
    do {                                                                                                               \
        if (fixture.count >= sizeof table / sizeof table[0]) {                                                         \
            __builtin_trap();                                                                                          \
        }                                                                                                              \
        memcpy(table, fixture.table, fixture.count * sizeof table[0]);                                                 \
        table[fixture.count] = __VA_ARGS__;                                                                            \
        fixture.table = table;                                                                                         \
    } while (0)

__attribute__((constructor)) static void derive(void)
{
    fixture = fixture_machine;
    EXTEND(fields, field_count, (fcsl_field_t){.path = BEHIND, .unit = BEHIND, .doc = BEHIND, .offset = FAR});
    EXTEND(
        instances, instance_count,
        (fcsl_instance_t){
            .name = BEHIND, .algorithm = BEHIND, .message_type = BEHIND, .message_text = BEHIND, .health_offset = FAR});
    EXTEND(states, state_count, (fcsl_state_t){.name = BEHIND});
    EXTEND(requests, request_count, BEHIND);
    EXTEND(channels, channel_count,
           (fcsl_channel_t){.name = BEHIND,
                            .direction = FCSL_SENSOR,
                            .field = UINT32_MAX,
                            .attached_offset = FAR,
                            .fresh_offset = FAR});
    EXTEND(fault_places, fault_place_count, (fcsl_fault_place_t){.file = BEHIND, .cause = BEHIND});
    for (uint32_t i = 0; i < INSTANCES; i++) {
        instances[i].health_offset = far_health(i);
    }
    for (uint32_t i = 0; i < fixture.field_count; i++) {
        if (fields[i].type == FCSL_HEALTH) {
            fields[i].offset = far_health((uint32_t)fields[i].instance);
        }
    }
    fixture.size = sizeof(data_t);
    fixture.init = init;
    fixture.start = start;
    fixture.step = step;
    fixture.force_state = force_state;
    fixture.views = "{\"panels\":[]}"; /* any text: no host interprets it */
#ifdef FIXTURE_TWIN
    fixture_twin = fixture;
    fixture_twin.name = "fixture_twin";
#endif
}
