/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine for fcsl-guard: a client of fcsl-fc sets what it commands and whether it is armed, and can make its step hang, or stop
 * the process. It is by hand, because no step of a machine of fcslc does. 100 Hz; the actuators keep a command for 0.2 s. Macros
 * change that.
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
#define FIELD(path_, role_, type_, flags_, member_, instance_, unit_)                                                  \
    {.path = path_,                                                                                                    \
     .role = role_,                                                                                                    \
     .type = type_,                                                                                                    \
     .flags = flags_,                                                                                                  \
     .count = 1,                                                                                                       \
     .offset = AT(member_),                                                                                            \
     .size = (uint32_t)sizeof(((guarded_t *)0)->member_),                                                              \
     .instance = instance_,                                                                                            \
     .connected_from = FCSL_NONE,                                                                                      \
     .unit = unit_,                                                                                                    \
     .doc = "",                                                                                                        \
     .minimum = -(double)INFINITY,                                                                                     \
     .maximum = (double)INFINITY}
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
    {.name = "pilot",
     .algorithm = "pilot",
     .source_file = "guarded.c",
     .source_line = 1,
     .first_field = GAUGE,
     .field_count = 11,
     .request_offset = AT(request),
     .health_offset = AT(health),
     .faults_offset = AT(faults),
     .overruns_offset = AT(overruns),
     .fault_place_offset = AT(fault_place),
     .inject_overrun_offset = FCSL_NO_OFFSET,
     .inject_fault_offset = FCSL_NO_OFFSET,
     .published = 1,
     .message_type = "guarded/msg/GuardedPilot",
     .message_text =
         "std_msgs/Header header\nuint64 tick\nfloat64 gauge\nfloat64 force\nbool valve\nbool armed\nuint8 health\n"},
};
static const fcsl_schedule_t schedule[] = {{0, 1, 0}};
static const fcsl_state_t states[] = {{"RUN", schedule, 1}};

static const double safe_force = -1.0;
static const uint8_t safe_valve = 1;
#define NO_ROS .ros_type = "", .ros_field = "", .ros_topic = "", .ros_frame = "", .ros_child_frame = "", .ros_axes = ""
#define ACTUATOR(name_, id_, field_, safe_)                                                                            \
    {.name = name_,                                                                                                    \
     .id = id_,                                                                                                        \
     .direction = FCSL_ACTUATOR,                                                                                       \
     .field = field_,                                                                                                  \
     .attached_offset = FCSL_NO_OFFSET,                                                                                \
     .fresh_offset = FCSL_NO_OFFSET,                                                                                   \
     .valid_offset = FCSL_NO_OFFSET,                                                                                   \
     .waiting_offset = FCSL_NO_OFFSET,                                                                                 \
     .age_offset = FCSL_NO_OFFSET,                                                                                     \
     .sample_age_offset = FCSL_NO_OFFSET,                                                                              \
     .stamp_offset = FCSL_NO_OFFSET,                                                                                   \
     NO_ROS,                                                                                                           \
     .safe = safe_}
static const fcsl_channel_t channels[] = {
    {.name = "panel.gauge",
     .id = 1,
     .direction = FCSL_SENSOR,
     .field = GAUGE,
     .max_age_ticks = 5,
     .grace_ticks = 5,
     .attached_offset = AT(channel.attached),
     .fresh_offset = AT(channel.fresh),
     .valid_offset = AT(channel.valid),
     .waiting_offset = AT(channel.waiting),
     .age_offset = AT(channel.age_ticks),
     .sample_age_offset = AT(channel.sample_age),
     .stamp_offset = AT(channel.stamp_ns),
     NO_ROS},
    ACTUATOR("cart.force", 513, FORCE, &safe_force),
    ACTUATOR("panel.valve", 514, VALVE, &safe_valve),
#ifdef TWO_FORCES
    ACTUATOR("cart.other", 515, FORCE, &safe_force),
#endif
};

static void init(void *machine)
{
    guarded_t *m = machine;
    memset(m, 0, sizeof *m);
    m->current = FCSL_NONE;
    m->health = FCSL_STALE;
}

static int32_t start(void *machine)
{
    (void)machine;
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
    .start = start,
    .step = step,
    .force_state = force_state,
};

const fcsl_machine_t *const fcsl_machines[] = {&guarded, NULL};
