/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine written by hand against the ABI, so that hosts can be tested without the compiler: every scalar
 * type, arrays of one and two dimensions, channels, a timed instance, two states.
 *
 * PROBE_SOURCE_HASH, PROBE_GAIN and PROBE_EXTRA_FIELD build variants of it.
 */
#include <math.h>
#include <string.h>

#include "fcsl/fcsl_machine.h"

#ifndef PROBE_SOURCE_HASH
#define PROBE_SOURCE_HASH "1111111111111111111111111111111111111111111111111111111111111111"
#endif
#ifndef PROBE_GAIN
#define PROBE_GAIN 2.0
#endif
#ifdef PROBE_EXTRA_FIELD
#define PROBE_LAYOUT_HASH "3333333333333333333333333333333333333333333333333333333333333333"
#else
#define PROBE_LAYOUT_HASH "2222222222222222222222222222222222222222222222222222222222222222"
#endif

typedef struct {
    uint64_t tick;
    int32_t state, next_state, current;
    uint8_t attached[4], fresh[4], valid[4], waiting[4];
    uint32_t age[4], sample_age[4];
    int64_t stamp[4];
    struct {
        double vec[3], quat[4], real;
        int64_t big;
        uint64_t long_word;
        float single, grid[2][3];
        int32_t small;
        uint32_t word;
        uint8_t flag;
        int32_t request, health;
        uint64_t faults, overruns;
        uint32_t fault_place;
    } source;
    struct {
        double in_vec[3], gain, fixed, total;
        double sum, copy[3];
        uint64_t count;
        int32_t request, health;
        uint64_t faults, overruns;
        uint32_t fault_place;
        uint8_t inject_overrun, inject_fault;
#ifdef PROBE_EXTRA_FIELD
        double extra;
#endif
    } echo;
} probe_t;

enum { IDLE, ACTIVE };
enum { SOURCE, ECHO };
#define W            FCSL_FIELD_WRITABLE
#define AT(member)   (uint32_t)offsetof(probe_t, member)
#define SIZE(member) (uint32_t)sizeof(((probe_t *)0)->member)
#define SCALAR(path, role, type, flags, member, instance, from, unit, doc)                                             \
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
     from,                                                                                                             \
     unit,                                                                                                             \
     doc,                                                                                                              \
     -(double)INFINITY,                                                                                                \
     (double)INFINITY}
#define ARRAY(path, role, type, flags, member, shape, rank, count, instance, from)                                     \
    {path,                                                                                                             \
     role,                                                                                                             \
     type,                                                                                                             \
     flags,                                                                                                            \
     rank,                                                                                                             \
     shape,                                                                                                            \
     count,                                                                                                            \
     AT(member),                                                                                                       \
     SIZE(member),                                                                                                     \
     instance,                                                                                                         \
     from,                                                                                                             \
     "",                                                                                                               \
     "",                                                                                                               \
     -(double)INFINITY,                                                                                                \
     (double)INFINITY}

static const uint32_t three[] = {3}, four[] = {4}, two_three[] = {2, 3};

enum { FIRST_SOURCE = 3, VEC = FIRST_SOURCE, QUAT, REAL, BIG, LONG_WORD, SINGLE, GRID, SMALL, WORD, FLAG };
enum { FIRST_ECHO = FIRST_SOURCE + 15 };

/* A row behind each table, which no host may read: whoever follows its pointers crashes. */
#define BEHIND ((const char *)1)
#define FAR    (FCSL_NO_OFFSET - 1u)

static const fcsl_field_t fields[] = {
    SCALAR("machine.tick", FCSL_ROLE_MACHINE, FCSL_U64, 0, tick, FCSL_NONE, FCSL_NONE, "", "ticks completed"),
    SCALAR("machine.state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, state, FCSL_NONE, FCSL_NONE, "", ""),
    SCALAR("machine.next_state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, next_state, FCSL_NONE, FCSL_NONE, "", ""),
    ARRAY("source.outputs.vec", FCSL_ROLE_OUTPUT, FCSL_F64, W, source.vec, three, 1, 3, SOURCE, FCSL_NONE),
    ARRAY("source.outputs.quat", FCSL_ROLE_OUTPUT, FCSL_F64, W, source.quat, four, 1, 4, SOURCE, FCSL_NONE),
    SCALAR("source.outputs.real", FCSL_ROLE_OUTPUT, FCSL_F64, W, source.real, SOURCE, FCSL_NONE, "m/s", "a speed"),
    SCALAR("source.outputs.big", FCSL_ROLE_OUTPUT, FCSL_I64, W, source.big, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.outputs.long_word", FCSL_ROLE_OUTPUT, FCSL_U64, W, source.long_word, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.outputs.single", FCSL_ROLE_OUTPUT, FCSL_F32, W, source.single, SOURCE, FCSL_NONE, "", ""),
    ARRAY("source.outputs.grid", FCSL_ROLE_OUTPUT, FCSL_F32, W, source.grid, two_three, 2, 6, SOURCE, FCSL_NONE),
    SCALAR("source.outputs.small", FCSL_ROLE_OUTPUT, FCSL_I32, W, source.small, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.outputs.word", FCSL_ROLE_OUTPUT, FCSL_U32, W, source.word, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.outputs.flag", FCSL_ROLE_OUTPUT, FCSL_BOOL, W, source.flag, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.outputs.transition_request", FCSL_ROLE_OUTPUT, FCSL_TRANSITION_REQUEST, W, source.request, SOURCE,
           FCSL_NONE, "", ""),
    SCALAR("source.outputs.health", FCSL_ROLE_OUTPUT, FCSL_HEALTH, W, source.health, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, source.faults, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, source.overruns, SOURCE, FCSL_NONE, "", ""),
    SCALAR("source.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, source.fault_place, SOURCE, FCSL_NONE, "",
           ""),
    ARRAY("echo.inputs.vec", FCSL_ROLE_INPUT, FCSL_F64, W, echo.in_vec, three, 1, 3, ECHO, VEC),
    SCALAR("echo.parameters.gain", FCSL_ROLE_PARAMETER, FCSL_F64, W, echo.gain, ECHO, FCSL_NONE, "", ""),
    SCALAR("echo.parameters.fixed", FCSL_ROLE_PARAMETER, FCSL_F64, FCSL_FIELD_FROZEN, echo.fixed, ECHO, FCSL_NONE, "",
           ""),
    SCALAR("echo.state.total", FCSL_ROLE_STATE, FCSL_F64, W, echo.total, ECHO, FCSL_NONE, "", ""),
    SCALAR("echo.outputs.sum", FCSL_ROLE_OUTPUT, FCSL_F64, 0, echo.sum, ECHO, FCSL_NONE, "", ""),
    ARRAY("echo.outputs.copy", FCSL_ROLE_OUTPUT, FCSL_F64, 0, echo.copy, three, 1, 3, ECHO, FCSL_NONE),
    SCALAR("echo.outputs.count", FCSL_ROLE_OUTPUT, FCSL_U64, 0, echo.count, ECHO, FCSL_NONE, "", ""),
    SCALAR("echo.outputs.transition_request", FCSL_ROLE_OUTPUT, FCSL_TRANSITION_REQUEST, 0, echo.request, ECHO,
           FCSL_NONE, "", ""),
    SCALAR("echo.outputs.health", FCSL_ROLE_OUTPUT, FCSL_HEALTH, 0, echo.health, ECHO, FCSL_NONE, "", ""),
    SCALAR("echo.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, echo.faults, ECHO, FCSL_NONE, "", ""),
    SCALAR("echo.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, echo.overruns, ECHO, FCSL_NONE, "", ""),
    SCALAR("echo.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, echo.fault_place, ECHO, FCSL_NONE, "", ""),
#ifdef PROBE_EXTRA_FIELD
    SCALAR("echo.outputs.extra", FCSL_ROLE_OUTPUT, FCSL_F64, 0, echo.extra, ECHO, FCSL_NONE, "", ""),
#endif
    {.path = BEHIND, .unit = BEHIND, .doc = BEHIND, .offset = FAR},
};
#define ROWS(table) (uint32_t)(sizeof(table) / sizeof(table)[0] - 1u)

static const fcsl_instance_t instances[] = {
    {"source", "block", "probe.c", 1, FIRST_SOURCE, 15, AT(source.request), AT(source.health), AT(source.faults),
     AT(source.overruns), AT(source.fault_place), FCSL_NO_OFFSET, FCSL_NO_OFFSET, 0, 1, "probe/msg/ProbeSource",
     "std_msgs/Header header\nuint64 tick\nfloat64[3] vec\nfloat64[4] quat\nfloat64 real  # m/s\nint64 big\n"
     "uint64 long_word\nfloat32 single\nfloat32[6] grid\nint32 small\nuint32 word\nbool flag\nuint8 health\n"},
    {"echo", "echo", "probe.c", 1, FIRST_ECHO, ROWS(fields) - FIRST_ECHO, AT(echo.request), AT(echo.health),
     AT(echo.faults), AT(echo.overruns), AT(echo.fault_place), AT(echo.inject_overrun), AT(echo.inject_fault), 100, 1,
     "probe/msg/ProbeEcho",
     "std_msgs/Header header\nuint64 tick\nfloat64 sum\nfloat64[3] copy\nuint64 count\n"
#ifdef PROBE_EXTRA_FIELD
     "float64 extra\n"
#endif
     "int32 transition_request\nuint8 health\n"},
    {.name = BEHIND, .algorithm = BEHIND, .message_type = BEHIND, .message_text = BEHIND, .health_offset = FAR},
};

static const fcsl_schedule_t schedule[] = {{SOURCE, 1, 0}, {ECHO, 1, 0}};
enum { INJECTED = 1 };
static const fcsl_fault_place_t fault_places[] = {{"", 0, 0, "injected"}, {.file = BEHIND, .cause = BEHIND}};
static const fcsl_state_t states[] = {{"IDLE", schedule, 2}, {"ACTIVE", schedule, 2}, {.name = BEHIND}};
static const char *const requests[] = {"GO", "STOP", BEHIND};
static const fcsl_transition_t transitions[] = {
    {IDLE, ACTIVE, 0, 2, FCSL_NONE, 0},
    {ACTIVE, IDLE, 1, 2, ECHO, (1u << FCSL_NOMINAL) | (1u << FCSL_DEGRADED)},
};

#define CHANNEL(name, id, field, i)                                                                                    \
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
    CHANNEL("imu.gyro", 1, VEC, 0),
    CHANNEL("imu.attitude", 2, QUAT, 1),
    CHANNEL("level", 3, SMALL, 2),
    CHANNEL("switch", 4, FLAG, 3),
    {.name = BEHIND, .direction = FCSL_SENSOR, .field = UINT32_MAX, .attached_offset = FAR, .fresh_offset = FAR},
};

static int32_t init(void *machine)
{
    probe_t *m = machine;
    memset(m, 0, sizeof *m);
    m->current = FCSL_NONE;
    m->source.health = m->echo.health = FCSL_STALE;
    m->source.quat[0] = 1.0;
    m->echo.gain = PROBE_GAIN;
    m->echo.fixed = 0.5;
    return 0;
}

static void keep_channels(probe_t *m)
{
    for (int i = 0; i < 4; i++) {
        if (m->attached[i] != 0u) {
            m->age[i] = m->fresh[i] != 0u ? m->sample_age[i] : m->age[i] + 1u;
            m->valid[i] = m->age[i] <= 5u;
            m->fresh[i] = 0;
        }
    }
}

static void run_echo(probe_t *m)
{
    m->echo.sum = m->echo.gain * (m->echo.in_vec[0] + m->echo.in_vec[1] + m->echo.in_vec[2]);
    memcpy(m->echo.copy, m->echo.in_vec, sizeof m->echo.copy);
    m->echo.total += m->echo.sum;
    m->echo.count++;
    if (m->echo.sum > 10.0) {
        m->echo.request = 1;
    } else if (m->echo.sum < -10.0) {
        m->echo.request = 2;
    }
}

static void step(void *machine, const fcsl_host_t *host)
{
    (void)host;
    probe_t *m = machine;
    m->state = m->next_state;
    keep_channels(m);
    m->source.health = m->attached[0] != 0u && m->valid[0] == 0u ? FCSL_FAILED : FCSL_NOMINAL;
    memcpy(m->echo.in_vec, m->source.vec, sizeof m->echo.in_vec);
    m->echo.request = 0;
    m->echo.health = FCSL_NOMINAL;
    if (m->echo.inject_fault != 0u) {
        m->echo.inject_fault = 0;
        m->echo.faults++;
        m->echo.fault_place = INJECTED;
        m->echo.health = FCSL_FAILED;
    } else {
        run_echo(m);
    }
    if (m->echo.inject_overrun != 0u) {
        m->echo.inject_overrun = 0;
        m->echo.overruns++;
        m->echo.health = m->echo.health == FCSL_NOMINAL ? FCSL_DEGRADED : m->echo.health;
    }
    for (size_t i = 0; i < sizeof transitions / sizeof transitions[0]; i++) {
        if (transitions[i].from == m->state && m->echo.request == transitions[i].request + 1) {
            m->next_state = transitions[i].to;
        }
    }
    m->tick++;
}

static void force_state(void *machine, int32_t state)
{
    probe_t *m = machine;
    m->state = m->next_state = state; /* both states schedule both instances, which go on */
}

static const fcsl_machine_t probe = {
    .abi_version = FCSL_ABI_VERSION,
    .name = "probe",
    .source_hash = PROBE_SOURCE_HASH,
    .layout_hash = PROBE_LAYOUT_HASH,
    .build_hash = PROBE_SOURCE_HASH,
    .tick_hz = 100,
    .size = sizeof(probe_t),
    .align = _Alignof(probe_t),
    .current_offset = AT(current),
    .tick_offset = AT(tick),
    .state_offset = AT(state),
    .next_state_offset = AT(next_state),
    .fields = fields,
    .field_count = ROWS(fields),
    .instances = instances,
    .instance_count = ROWS(instances),
    .states = states,
    .state_count = ROWS(states),
    .requests = requests,
    .request_count = ROWS(requests),
    .transitions = transitions,
    .transition_count = (uint32_t)(sizeof transitions / sizeof transitions[0]),
    .channels = channels,
    .channel_count = ROWS(channels),
    .arm_field = FCSL_NONE,
    .fault_places = fault_places,
    .fault_place_count = ROWS(fault_places),
    .views = "",
    .init = init,
    .step = step,
    .force_state = force_state,
};

const fcsl_machine_t *const fcsl_machines[] = {&probe, NULL};
