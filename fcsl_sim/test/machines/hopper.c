/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine written by hand against the ABI, so that the simulator is tested without the compiler. 100 Hz.
 *
 *   UP    full throttle; a sampled altitude above 20 m requests TURN
 *   DOWN  throttle along a velocity profile
 *
 * Channels: altitude, velocity (sensors, valid for 5 ticks), throttle (actuator).
 */
#include <math.h>
#include <string.h>

#include "fcsl/fcsl_machine.h"

typedef struct {
    uint64_t tick;
    int32_t state, next_state, current;
    uint8_t attached[2], fresh[2], valid[2], waiting[2];
    uint32_t age[2], sample_age[2];
    int64_t stamp[2];
    struct {
        double pos_z, vel_z, throttle;
        uint64_t samples; /* altitudes received */
        int32_t request, health;
        uint64_t faults, overruns;
        uint32_t fault_place;
    } pilot;
} hopper_t;

enum { UP, DOWN };
#define AT(member)   (uint32_t)offsetof(hopper_t, member)
#define SIZE(member) (uint32_t)sizeof(((hopper_t *)0)->member)
#define FIELD(path, role, type, flags, member, instance, unit)                                                         \
    {path,                                                                                                             \
     role,                                                                                                             \
     type,                                                                                                             \
     flags,                                                                                                            \
     0,                                                                                                                \
     NULL,                                                                                                             \
     1,                                                                                                                \
     AT(member),                                                                                                       \
     SIZE(member),                                                                                                     \
     instance,                                                                                                         \
     FCSL_NONE,                                                                                                        \
     unit,                                                                                                             \
     "",                                                                                                               \
     -(double)INFINITY,                                                                                                \
     (double)INFINITY}
#define OUTPUT(path, type, flags, member, unit) FIELD("pilot." path, FCSL_ROLE_OUTPUT, type, flags, member, 0, unit)

enum { POS_Z = 3, VEL_Z, THROTTLE };

static const fcsl_field_t fields[] = {
    FIELD("machine.tick", FCSL_ROLE_MACHINE, FCSL_U64, 0, tick, FCSL_NONE, ""),
    FIELD("machine.state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, state, FCSL_NONE, ""),
    FIELD("machine.next_state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, next_state, FCSL_NONE, ""),
    OUTPUT("outputs.pos_z", FCSL_F64, FCSL_FIELD_WRITABLE, pilot.pos_z, "m"),
    OUTPUT("outputs.vel_z", FCSL_F64, FCSL_FIELD_WRITABLE, pilot.vel_z, "m/s"),
    OUTPUT("outputs.throttle", FCSL_F64, 0, pilot.throttle, ""),
    OUTPUT("outputs.samples", FCSL_U64, 0, pilot.samples, ""),
    OUTPUT("outputs.transition_request", FCSL_TRANSITION_REQUEST, 0, pilot.request, ""),
    OUTPUT("outputs.health", FCSL_HEALTH, 0, pilot.health, ""),
    FIELD("pilot.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, pilot.faults, 0, ""),
    FIELD("pilot.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, pilot.overruns, 0, ""),
    FIELD("pilot.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, pilot.fault_place, 0, ""),
};

static const fcsl_instance_t instances[] = {
    {"pilot", "pilot", "hopper.c", 1, POS_Z, 9, AT(pilot.request), AT(pilot.health), AT(pilot.faults),
     AT(pilot.overruns), AT(pilot.fault_place), FCSL_NO_OFFSET, FCSL_NO_OFFSET, 0, 1, "hopper/msg/HopperPilot",
     "std_msgs/Header header\nuint64 tick\nfloat64 pos_z\nfloat64 vel_z\nfloat64 throttle\nuint64 samples\n"
     "int32 transition_request\nuint8 health\n"},
};

static const fcsl_schedule_t schedule[] = {{0, 1, 0}};
static const fcsl_state_t states[] = {{"UP", schedule, 1}, {"DOWN", schedule, 1}};
static const char *const requests[] = {"TURN"};
static const fcsl_transition_t transitions[] = {{UP, DOWN, 0, 1, FCSL_NONE, 0}};

#define SENSOR(name, id, field, i)                                                                                     \
    {name,                                                                                                             \
     id,                                                                                                               \
     FCSL_SENSOR,                                                                                                      \
     field,                                                                                                            \
     5,                                                                                                                \
     5,                                                                                                                \
     AT(attached[i]),                                                                                                  \
     AT(fresh[i]),                                                                                                     \
     AT(valid[i]),                                                                                                     \
     AT(waiting[i]),                                                                                                   \
     AT(age[i]),                                                                                                       \
     AT(sample_age[i]),                                                                                                \
     AT(stamp[i]),                                                                                                     \
     "",                                                                                                               \
     "",                                                                                                               \
     "",                                                                                                               \
     "",                                                                                                               \
     "",                                                                                                               \
     "",                                                                                                               \
     NULL,                                                                                                             \
     FCSL_AS_FIELD}
static const fcsl_channel_t channels[] = {
    SENSOR("altitude", 1, POS_Z, 0),
    SENSOR("velocity", 2, VEL_Z, 1),
    {"throttle",
     16,
     FCSL_ACTUATOR,
     THROTTLE,
     UINT32_MAX,
     UINT32_MAX,
     FCSL_NO_OFFSET,
     FCSL_NO_OFFSET,
     FCSL_NO_OFFSET,
     FCSL_NO_OFFSET,
     FCSL_NO_OFFSET,
     FCSL_NO_OFFSET,
     FCSL_NO_OFFSET,
     "",
     "",
     "",
     "",
     "",
     "",
     NULL,
     FCSL_AS_FIELD},
};

static int32_t init(void *machine)
{
    hopper_t *m = machine;
    memset(m, 0, sizeof *m);
    m->current = FCSL_NONE;
    m->pilot.health = FCSL_STALE;
    return 0;
}

static void step(void *machine, const fcsl_host_t *host)
{
    (void)host;
    hopper_t *m = machine;
    m->state = m->next_state;
    m->pilot.samples += m->fresh[0];
    for (int i = 0; i < 2; i++) {
        m->age[i] = m->fresh[i] != 0u ? m->sample_age[i] : m->age[i] + 1u;
        m->valid[i] = m->age[i] <= 5u;
        m->fresh[i] = 0;
    }
    m->pilot.request = 0;
    m->pilot.health = m->valid[0] != 0u && m->valid[1] != 0u ? FCSL_NOMINAL : FCSL_FAILED;
    if (m->state == UP) {
        m->pilot.throttle = 1.0;
        m->pilot.request = m->pilot.pos_z > 20.0;
    } else {
        const double target = -(0.5 + 0.25 * (m->pilot.pos_z > 0.0 ? m->pilot.pos_z : 0.0));
        const double throttle = 0.4 + 0.5 * (target - m->pilot.vel_z);
        m->pilot.throttle = throttle < 0.0 ? 0.0 : throttle > 1.0 ? 1.0 : throttle;
    }
    if (m->state == UP && m->pilot.request != 0) {
        m->next_state = DOWN;
    }
    m->tick++;
}

static void force_state(void *machine, int32_t state)
{
    hopper_t *m = machine;
    m->state = m->next_state = state; /* both states schedule the pilot, which goes on */
}

#define COUNT(table) (uint32_t)(sizeof(table) / sizeof(table)[0])

static const fcsl_machine_t hopper = {
    .abi_version = FCSL_ABI_VERSION,
    .name = "hopper",
    .source_hash = "4444444444444444444444444444444444444444444444444444444444444444",
    .layout_hash = "5555555555555555555555555555555555555555555555555555555555555555",
    .build_hash = "6666666666666666666666666666666666666666666666666666666666666666",
    .tick_hz = 100,
    .size = sizeof(hopper_t),
    .align = _Alignof(hopper_t),
    .current_offset = AT(current),
    .tick_offset = AT(tick),
    .state_offset = AT(state),
    .next_state_offset = AT(next_state),
    .fields = fields,
    .field_count = COUNT(fields),
    .instances = instances,
    .instance_count = COUNT(instances),
    .states = states,
    .state_count = COUNT(states),
    .requests = requests,
    .request_count = COUNT(requests),
    .transitions = transitions,
    .transition_count = COUNT(transitions),
    .channels = channels,
    .channel_count = COUNT(channels),
    .arm_field = FCSL_NONE,
    .views = "",
    .init = init,
    .step = step,
    .force_state = force_state,
};

const fcsl_machine_t *const fcsl_machines[] = {&hopper, NULL};
