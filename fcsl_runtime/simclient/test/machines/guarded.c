/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine written by hand against the ABI for fcsl-guard: a client of fcsl-fc sets what it commands and whether it is armed,
 * and can make its step hang, or stop the process. 100 Hz; the actuators keep a command for 0.2 s. Macros change that.
 */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <signal.h>
#include <string.h>

#include "fcsl/fcsl_machine.h"

typedef struct {
    uint64_t tick;
    int32_t state, next_state, current;
    double gauge;
    struct {
        uint8_t attached, fresh, valid, waiting;
        uint32_t age_ticks, sample_age;
        int64_t stamp_ns;
    } channel;
    double force;
    uint8_t valve, armed, hang, stop;
    int32_t request, health;
    uint64_t faults, overruns;
    uint32_t fault_place;
} guarded_t;

#define AT(member) (uint32_t)offsetof(guarded_t, member)
#define FIELD(path, role, type, flags, member, instance, unit)                                                         \
    {path,                                                                                                             \
     role,                                                                                                             \
     type,                                                                                                             \
     flags,                                                                                                            \
     0,                                                                                                                \
     NULL,                                                                                                             \
     1,                                                                                                                \
     AT(member),                                                                                                       \
     (uint32_t)sizeof(((guarded_t *)0)->member),                                                                       \
     instance,                                                                                                         \
     FCSL_NONE,                                                                                                        \
     unit,                                                                                                             \
     "",                                                                                                               \
     -(double)INFINITY,                                                                                                \
     (double)INFINITY}
#define W FCSL_FIELD_WRITABLE

enum { GAUGE = 3, FORCE, VALVE, ARMED };
static const fcsl_field_t fields[] = {
    FIELD("machine.tick", FCSL_ROLE_MACHINE, FCSL_U64, 0, tick, FCSL_NONE, ""),
    FIELD("machine.state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, state, FCSL_NONE, ""),
    FIELD("machine.next_state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, next_state, FCSL_NONE, ""),
    FIELD("pilot.outputs.gauge", FCSL_ROLE_OUTPUT, FCSL_F64, W, gauge, 0, ""),
    FIELD("pilot.outputs.force", FCSL_ROLE_OUTPUT, FCSL_F64, W, force, 0, "N"),
    FIELD("pilot.outputs.valve", FCSL_ROLE_OUTPUT, FCSL_BOOL, W, valve, 0, ""),
    FIELD("pilot.outputs.armed", FCSL_ROLE_OUTPUT, FCSL_BOOL, W, armed, 0, ""),
    FIELD("pilot.outputs.transition_request", FCSL_ROLE_OUTPUT, FCSL_TRANSITION_REQUEST, 0, request, 0, ""),
    FIELD("pilot.outputs.health", FCSL_ROLE_OUTPUT, FCSL_HEALTH, 0, health, 0, ""),
    FIELD("pilot.state.hang", FCSL_ROLE_STATE, FCSL_BOOL, W, hang, 0, ""),
    FIELD("pilot.state.stop", FCSL_ROLE_STATE, FCSL_BOOL, W, stop, 0, ""),
    FIELD("pilot.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, faults, 0, ""),
    FIELD("pilot.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, overruns, 0, ""),
    FIELD("pilot.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, fault_place, 0, ""),
};

static const fcsl_instance_t instances[] = {
    {"pilot", "pilot", "guarded.c", 1, GAUGE, 11, AT(request), AT(health), AT(faults), AT(overruns), AT(fault_place),
     FCSL_NO_OFFSET, FCSL_NO_OFFSET, 0, 1, "guarded/msg/GuardedPilot",
     "std_msgs/Header header\nuint64 tick\nfloat64 gauge\nfloat64 force\nbool valve\nbool armed\nuint8 health\n"},
};
static const fcsl_schedule_t schedule[] = {{0, 1, 0}};
static const fcsl_state_t states[] = {{"RUN", schedule, 1}};

static const double safe_force = -1.0;
static const uint8_t safe_valve = 1;
#define NO FCSL_NO_OFFSET
static const fcsl_channel_t channels[] = {
    {"panel.gauge",
     1,
     FCSL_SENSOR,
     GAUGE,
     5,
     5,
     AT(channel.attached),
     AT(channel.fresh),
     AT(channel.valid),
     AT(channel.waiting),
     AT(channel.age_ticks),
     AT(channel.sample_age),
     AT(channel.stamp_ns),
     "",
     "",
     "",
     "",
     "",
     "",
     NULL,
     FCSL_AS_FIELD},
    {"cart.force", 513, FCSL_ACTUATOR, FORCE,        0, 0, NO, NO, NO, NO, NO, NO, NO, "", "", "", "",
     "",           "",  &safe_force,   FCSL_AS_FIELD},
    {"panel.valve", 514,          FCSL_ACTUATOR, VALVE, 0, 0, NO, NO, NO, NO, NO, NO, NO, "", "", "", "", "", "",
     &safe_valve,   FCSL_AS_FIELD},
#ifdef TWO_FORCES
    {"cart.other", 515, FCSL_ACTUATOR, FORCE,        0, 0, NO, NO, NO, NO, NO, NO, NO, "", "", "", "",
     "",           "",  &safe_force,   FCSL_AS_FIELD},
#endif
};

static int32_t init(void *machine)
{
    guarded_t *m = machine;
    memset(m, 0, sizeof *m);
    m->current = FCSL_NONE;
    m->health = FCSL_STALE;
    return 0;
}

static void step(void *machine, const fcsl_host_t *host)
{
    (void)host;
    guarded_t *m = machine;
    const volatile uint8_t *hang = &m->hang;
    m->current = 0;
    while (*hang != 0u) {
    }
    if (m->stop != 0u) { /* SIGSTOP in the middle of this step, whose command is the last one: the next step hangs */
        m->stop = 0;
        m->hang = 1;
        (void)raise(SIGSTOP);
    }
    m->current = FCSL_NONE;
    m->health = FCSL_NOMINAL;
    m->tick++;
}

static void force_state(void *machine, int32_t state)
{
    guarded_t *m = machine;
    m->state = m->next_state = state;
}

#define COUNT(table) (uint32_t)(sizeof(table) / sizeof(table)[0])
#ifndef TIMEOUT_NS
#define TIMEOUT_NS 200000000u
#endif
#ifndef TICK_HZ
#define TICK_HZ 100
#endif
#ifndef HASH
#define HASH "5555555555555555555555555555555555555555555555555555555555555555"
#endif

static const fcsl_machine_t guarded = {
    .abi_version = FCSL_ABI_VERSION,
    .name = "guarded",
    .source_hash = HASH,
    .layout_hash = HASH,
    .build_hash = HASH,
    .tick_hz = TICK_HZ,
    .size = sizeof(guarded_t),
    .align = _Alignof(guarded_t),
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
    .channels = channels,
    .channel_count = COUNT(channels),
#ifdef NO_ARM
    .arm_field = FCSL_NONE,
#else
    .arm_field = ARMED,
#endif
    .command_timeout_ns = TIMEOUT_NS,
    .views = "",
    .init = init,
    .step = step,
    .force_state = force_state,
};

const fcsl_machine_t *const fcsl_machines[] = {&guarded, NULL};
