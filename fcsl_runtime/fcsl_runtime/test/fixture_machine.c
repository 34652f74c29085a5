/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine written by hand against the ABI, so that hosts are tested without the compiler. 100 Hz, two states.
 *
 *   sensors  source block: the host or a HAL writes its outputs
 *   pilot    every tick in IDLE, every second tick in ACTIVE; force = gain * gyro[0] + integral;
 *            faults when count < 0; requests GO when armed in IDLE, BACK when not armed in ACTIVE; max_wcet_us = 1000
 *
 * Built with -DFIXTURE_TWIN the library holds a second machine, `fixture_twin`, the same but for its name.
 */
#include <math.h>
#include <string.h>

#include "fcsl/fcsl_machine.h"

enum { IDLE = 0, ACTIVE = 1 };
enum { NO_REQUEST = 0, GO = 1, BACK = 2 };
enum { SENSORS = 0, PILOT = 1 };

typedef struct {
    uint8_t attached;
    uint8_t fresh;
    uint8_t valid;
    uint8_t waiting;
    uint32_t age_ticks;
    uint32_t sample_age;
    int64_t stamp_ns;
} channel_t;

typedef struct {
    uint64_t tick;
    int32_t state;
    int32_t next_state;
    int32_t current;
    /* sensors */
    double gyro[3];
    float temperature;
    uint8_t armed;
    int64_t count;
    int32_t sensors_request;
    uint64_t sensors_faults;
    uint64_t sensors_overruns;
    uint32_t sensors_fault_place;
    /* pilot */
    double in_gyro[3];
    double gain;
    double limit;
    double force;
    float matrix[2][2];
    uint32_t runs;
    int32_t sign;
    uint64_t checksum;
    uint8_t saturated;
    int32_t pilot_request;
    double integral;
    uint64_t pilot_faults;
    uint64_t pilot_overruns;
    uint32_t pilot_fault_place;
    uint8_t pilot_inject_overrun;
    uint8_t pilot_inject_fault;
    channel_t gyro_channel;
    channel_t armed_channel;
    /* What hosts read of an instance need not lie together. */
    uint8_t gap[256];
    int32_t sensors_health;
    uint8_t another_gap[256];
    int32_t pilot_health;
} machine_t;

#define AT(member) ((uint32_t)offsetof(machine_t, member))

static const uint32_t THREE[] = {3};
static const uint32_t TWO_BY_TWO[] = {2, 2};

#define RANGED(path_, role_, type_, flags_, rank_, shape_, count_, member_, size_, instance_, from_, unit_, low_,      \
               high_)                                                                                                  \
    {path_, role_, type_, flags_, rank_, shape_, count_, AT(member_), size_, instance_, from_, unit_, "", low_, high_}
#define FIELD(path_, role_, type_, flags_, rank_, shape_, count_, member_, size_, instance_, from_, unit_)             \
    RANGED(path_, role_, type_, flags_, rank_, shape_, count_, member_, size_, instance_, from_, unit_,                \
           -(double)INFINITY, (double)INFINITY)

#define W FCSL_FIELD_WRITABLE

/* A row behind each table, which no host may read: whoever follows its pointers crashes. */
#define BEHIND ((const char *)1)
#define FAR    (FCSL_NO_OFFSET - 1u)

static const fcsl_field_t FIELDS[] = {
    FIELD("machine.tick", FCSL_ROLE_MACHINE, FCSL_U64, 0, 0, NULL, 1, tick, 8, FCSL_NONE, FCSL_NONE, ""),
    FIELD("machine.state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, 0, NULL, 1, state, 4, FCSL_NONE, FCSL_NONE, ""),
    FIELD("machine.next_state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, 0, NULL, 1, next_state, 4, FCSL_NONE, FCSL_NONE, ""),
    FIELD("sensors.outputs.gyro", FCSL_ROLE_OUTPUT, FCSL_F64, W, 1, THREE, 3, gyro, 24, SENSORS, FCSL_NONE, "rad/s"),
    FIELD("sensors.outputs.temperature", FCSL_ROLE_OUTPUT, FCSL_F32, W, 0, NULL, 1, temperature, 4, SENSORS, FCSL_NONE,
          "K"),
    FIELD("sensors.outputs.armed", FCSL_ROLE_OUTPUT, FCSL_BOOL, W, 0, NULL, 1, armed, 1, SENSORS, FCSL_NONE, ""),
    FIELD("sensors.outputs.count", FCSL_ROLE_OUTPUT, FCSL_I64, W, 0, NULL, 1, count, 8, SENSORS, FCSL_NONE, ""),
    FIELD("sensors.outputs.transition_request", FCSL_ROLE_OUTPUT, FCSL_TRANSITION_REQUEST, 0, 0, NULL, 1,
          sensors_request, 4, SENSORS, FCSL_NONE, ""),
    FIELD("sensors.outputs.health", FCSL_ROLE_OUTPUT, FCSL_HEALTH, 0, 0, NULL, 1, sensors_health, 4, SENSORS, FCSL_NONE,
          ""),
    FIELD("sensors.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, 0, NULL, 1, sensors_faults, 8, SENSORS, FCSL_NONE,
          ""),
    FIELD("sensors.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, 0, NULL, 1, sensors_overruns, 8, SENSORS,
          FCSL_NONE, ""),
    FIELD("sensors.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, 0, NULL, 1, sensors_fault_place, 4, SENSORS,
          FCSL_NONE, ""),
    FIELD("pilot.inputs.gyro", FCSL_ROLE_INPUT, FCSL_F64, W, 1, THREE, 3, in_gyro, 24, PILOT, 3, "rad/s"),
    RANGED("pilot.parameters.gain", FCSL_ROLE_PARAMETER, FCSL_F64, W, 0, NULL, 1, gain, 8, PILOT, FCSL_NONE, "N*s/rad",
           -100.0, 100.0),
    FIELD("pilot.parameters.limit", FCSL_ROLE_PARAMETER, FCSL_F64, FCSL_FIELD_FROZEN, 0, NULL, 1, limit, 8, PILOT,
          FCSL_NONE, "N"),
    FIELD("pilot.outputs.force", FCSL_ROLE_OUTPUT, FCSL_F64, 0, 0, NULL, 1, force, 8, PILOT, FCSL_NONE, "N"),
    FIELD("pilot.outputs.matrix", FCSL_ROLE_OUTPUT, FCSL_F32, 0, 2, TWO_BY_TWO, 4, matrix, 16, PILOT, FCSL_NONE, ""),
    FIELD("pilot.outputs.runs", FCSL_ROLE_OUTPUT, FCSL_U32, 0, 0, NULL, 1, runs, 4, PILOT, FCSL_NONE, ""),
    FIELD("pilot.outputs.sign", FCSL_ROLE_OUTPUT, FCSL_I32, 0, 0, NULL, 1, sign, 4, PILOT, FCSL_NONE, ""),
    FIELD("pilot.outputs.checksum", FCSL_ROLE_OUTPUT, FCSL_U64, 0, 0, NULL, 1, checksum, 8, PILOT, FCSL_NONE, ""),
    FIELD("pilot.outputs.saturated", FCSL_ROLE_OUTPUT, FCSL_BOOL, 0, 0, NULL, 1, saturated, 1, PILOT, FCSL_NONE, ""),
    FIELD("pilot.outputs.transition_request", FCSL_ROLE_OUTPUT, FCSL_TRANSITION_REQUEST, 0, 0, NULL, 1, pilot_request,
          4, PILOT, FCSL_NONE, ""),
    FIELD("pilot.outputs.health", FCSL_ROLE_OUTPUT, FCSL_HEALTH, 0, 0, NULL, 1, pilot_health, 4, PILOT, FCSL_NONE, ""),
    FIELD("pilot.state.integral", FCSL_ROLE_STATE, FCSL_F64, W, 0, NULL, 1, integral, 8, PILOT, FCSL_NONE, "N"),
    FIELD("pilot.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, 0, NULL, 1, pilot_faults, 8, PILOT, FCSL_NONE, ""),
    FIELD("pilot.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, 0, NULL, 1, pilot_overruns, 8, PILOT, FCSL_NONE,
          ""),
    FIELD("pilot.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, 0, NULL, 1, pilot_fault_place, 4, PILOT,
          FCSL_NONE, ""),
    FIELD("channels.imu.gyro.valid", FCSL_ROLE_CHANNEL, FCSL_BOOL, 0, 0, NULL, 1, gyro_channel.valid, 1, FCSL_NONE,
          FCSL_NONE, ""),
    FIELD("channels.imu.gyro.age_ticks", FCSL_ROLE_CHANNEL, FCSL_U32, 0, 0, NULL, 1, gyro_channel.age_ticks, 4,
          FCSL_NONE, FCSL_NONE, ""),
    FIELD("channels.panel.armed.valid", FCSL_ROLE_CHANNEL, FCSL_BOOL, 0, 0, NULL, 1, armed_channel.valid, 1, FCSL_NONE,
          FCSL_NONE, ""),
    FIELD("channels.panel.armed.age_ticks", FCSL_ROLE_CHANNEL, FCSL_U32, 0, 0, NULL, 1, armed_channel.age_ticks, 4,
          FCSL_NONE, FCSL_NONE, ""),
    FIELD("channels.imu.gyro.stamp_ns", FCSL_ROLE_CHANNEL, FCSL_I64, 0, 0, NULL, 1, gyro_channel.stamp_ns, 8, FCSL_NONE,
          FCSL_NONE, "ns"),
    FIELD("channels.panel.armed.stamp_ns", FCSL_ROLE_CHANNEL, FCSL_I64, 0, 0, NULL, 1, armed_channel.stamp_ns, 8,
          FCSL_NONE, FCSL_NONE, "ns"),
    {.path = BEHIND, .unit = BEHIND, .doc = BEHIND, .offset = FAR},
};
#define ROWS(table) (uint32_t)(sizeof(table) / sizeof(table)[0] - 1u)

static const fcsl_instance_t INSTANCES[] = {
    {"sensors", "sensors", "sensors.py", 3, 3, 9, AT(sensors_request), AT(sensors_health), AT(sensors_faults),
     AT(sensors_overruns), AT(sensors_fault_place), FCSL_NO_OFFSET, FCSL_NO_OFFSET, 0, 1, "fixture/msg/FixtureSensors",
     "# Outputs of sensors.\nstd_msgs/Header header\nuint64 tick\nfloat64[3] gyro  # rad/s\nfloat32 temperature\n"
     "bool armed\nint64 count\nuint8 health\n"},
    {"pilot", "pilot", "pilot.py", 9, 12, 15, AT(pilot_request), AT(pilot_health), AT(pilot_faults), AT(pilot_overruns),
     AT(pilot_fault_place), AT(pilot_inject_overrun), AT(pilot_inject_fault), 1000, 0, "fixture/msg/FixturePilot",
     "std_msgs/Header header\nuint64 tick\nfloat64 force\nfloat32[4] matrix\nuint32 runs\nint32 sign\nuint64 checksum\n"
     "bool saturated\nint32 transition_request\nuint8 health\n"},
    {.name = BEHIND, .algorithm = BEHIND, .message_type = BEHIND, .message_text = BEHIND, .health_offset = FAR},
};

static const fcsl_schedule_t IDLE_SCHEDULE[] = {{SENSORS, 1, 0}, {PILOT, 1, 0}};
static const fcsl_schedule_t ACTIVE_SCHEDULE[] = {{SENSORS, 1, 0}, {PILOT, 2, 1}};
static const fcsl_state_t STATES[] = {{"IDLE", IDLE_SCHEDULE, 2}, {"ACTIVE", ACTIVE_SCHEDULE, 2}, {.name = BEHIND}};
static const char *const REQUESTS[] = {"GO", "BACK", BEHIND};
static const fcsl_transition_t TRANSITIONS[] = {
    {IDLE, ACTIVE, GO - 1, 1, FCSL_NONE, 0},
    {ACTIVE, IDLE, FCSL_NONE, 2, PILOT, 1u << FCSL_FAILED},
    {ACTIVE, IDLE, BACK - 1, 1, FCSL_NONE, 0},
};
enum { INJECTED = 1, COUNT_NEGATIVE = 2 };
static const fcsl_fault_place_t FAULT_PLACES[] = {
    {"", 0, 0, "injected"}, {"pilot.py", 12, 20, "the count is negative"}, {.file = BEHIND, .cause = BEHIND}};
static const fcsl_channel_t CHANNELS[] = {
    {"imu.gyro",
     257,
     FCSL_SENSOR,
     3,
     5,
     5,
     AT(gyro_channel.attached),
     AT(gyro_channel.fresh),
     AT(gyro_channel.valid),
     AT(gyro_channel.waiting),
     AT(gyro_channel.age_ticks),
     AT(gyro_channel.sample_age),
     AT(gyro_channel.stamp_ns),
     "sensor_msgs/Imu",
     "angular_velocity",
     "imu/data",
     "imu_link",
     "",
     "frd",
     NULL,
     FCSL_AS_FIELD},
    {"panel.armed",
     258,
     FCSL_SENSOR,
     5,
     UINT32_MAX,
     UINT32_MAX,
     AT(armed_channel.attached),
     AT(armed_channel.fresh),
     AT(armed_channel.valid),
     AT(armed_channel.waiting),
     AT(armed_channel.age_ticks),
     AT(armed_channel.sample_age),
     AT(armed_channel.stamp_ns),
     "",
     "",
     "",
     "",
     "",
     "",
     NULL,
     FCSL_AS_FIELD},
    {"cart.force",
     513,
     FCSL_ACTUATOR,
     15,
     0,
     0,
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
    {"panel.saturated",
     514,
     FCSL_ACTUATOR,
     20,
     0,
     0,
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
    {.name = BEHIND, .direction = FCSL_SENSOR, .field = UINT32_MAX, .attached_offset = FAR, .fresh_offset = FAR},
};

static int32_t initialise(void *machine)
{
    machine_t *m = machine;
    memset(m, 0, sizeof *m);
    m->gain = 2.0;
    m->limit = 10.0;
    m->current = FCSL_NONE;
    m->sensors_health = FCSL_STALE;
    m->pilot_health = FCSL_STALE;
    return 0;
}

static void force_state(void *machine, int32_t state)
{
    machine_t *m = machine;
    m->state = state; /* both states schedule both instances, which go on */
    m->next_state = state;
}

static void keep_channel(channel_t *channel, uint32_t max_age_ticks)
{
    if (channel->attached == 0u) {
        return;
    }
    if (channel->fresh != 0u) {
        channel->age_ticks = channel->sample_age;
    } else if (channel->age_ticks < UINT32_MAX) {
        channel->age_ticks++;
    }
    channel->valid = channel->age_ticks <= max_age_ticks;
    channel->fresh = 0;
}

static void run_sensors(machine_t *m)
{
    m->sensors_request = NO_REQUEST;
    m->sensors_health = FCSL_NOMINAL;
    if ((m->gyro_channel.attached != 0u && m->gyro_channel.valid == 0u) ||
        (m->armed_channel.attached != 0u && m->armed_channel.valid == 0u)) {
        m->sensors_health = FCSL_FAILED;
    }
}

static void run_pilot(machine_t *m, const fcsl_host_t *host)
{
    const uint64_t begun = host->clock_ns != NULL ? host->clock_ns(host->ctx) : 0;
    m->current = PILOT;
    memcpy(m->in_gyro, m->gyro, sizeof m->gyro);
    m->pilot_request = NO_REQUEST;
    m->pilot_health = FCSL_NOMINAL;
    if (m->count < 0 || m->pilot_inject_fault != 0u) {
        m->pilot_fault_place = m->pilot_inject_fault != 0u ? INJECTED : COUNT_NEGATIVE;
        m->pilot_inject_fault = 0;
        m->pilot_faults++;
        m->pilot_health = FCSL_FAILED;
    } else {
        m->integral += 0.125 * m->in_gyro[1];
        const double force = m->gain * m->in_gyro[0] + m->integral;
        m->saturated = force > 10.0 || force < -10.0;
        m->force = force > 10.0 ? 10.0 : force < -10.0 ? -10.0 : force;
        m->matrix[0][1] = (float)m->force;
        m->matrix[1][0] = m->temperature;
        m->runs++;
        m->sign = m->force < 0.0 ? -1 : 1;
        m->checksum = m->checksum * 6364136223846793005u + (uint64_t)m->count + 1u;
        if (m->state == IDLE && m->armed != 0u) {
            m->pilot_request = GO;
        } else if (m->state == ACTIVE && m->armed == 0u) {
            m->pilot_request = BACK;
        }
    }
    const uint64_t ended = host->clock_ns != NULL ? host->clock_ns(host->ctx) : 0;
    if (m->pilot_inject_overrun != 0u || ended - begun > 1000000u) {
        m->pilot_inject_overrun = 0;
        m->pilot_overruns++;
        m->pilot_health = m->pilot_health == FCSL_NOMINAL ? FCSL_DEGRADED : m->pilot_health;
    }
    m->current = FCSL_NONE;
}

static void arbitrate(machine_t *m, int pilot_ran)
{
    for (size_t i = 0; i < sizeof TRANSITIONS / sizeof TRANSITIONS[0]; i++) {
        const fcsl_transition_t *edge = &TRANSITIONS[i];
        const int asked = edge->request == FCSL_NONE || (pilot_ran && m->pilot_request == edge->request + 1);
        const int open = edge->guard_instance == FCSL_NONE || (edge->guard_mask >> m->pilot_health & 1u) != 0;
        if (edge->from == m->state && asked && open) {
            m->next_state = edge->to;
            return;
        }
    }
}

static void step(void *machine, const fcsl_host_t *host)
{
    machine_t *m = machine;
    if (m->state != m->next_state) {
        force_state(m, m->next_state);
    }
    keep_channel(&m->gyro_channel, 5);
    keep_channel(&m->armed_channel, UINT32_MAX);
    run_sensors(m);
    const int due = m->state == IDLE || m->tick % 2 == 1;
    if (due) {
        run_pilot(m, host);
    }
    arbitrate(m, due);
    m->tick++;
}

/* Any text: no host interprets it. */
#define FIXTURE_VIEWS "{\"panels\":[]}"

#define DESCRIPTOR(name_)                                                                                              \
    {.abi_version = FCSL_ABI_VERSION,                                                                                  \
     .name = name_,                                                                                                    \
     .source_hash = "1111111111111111111111111111111111111111111111111111111111111111",                                \
     .layout_hash = "2222222222222222222222222222222222222222222222222222222222222222",                                \
     .build_hash = "3333333333333333333333333333333333333333333333333333333333333333",                                 \
     .tick_hz = 100,                                                                                                   \
     .size = sizeof(machine_t),                                                                                        \
     .align = _Alignof(machine_t),                                                                                     \
     .current_offset = AT(current),                                                                                    \
     .tick_offset = AT(tick),                                                                                          \
     .state_offset = AT(state),                                                                                        \
     .next_state_offset = AT(next_state),                                                                              \
     .fields = FIELDS,                                                                                                 \
     .field_count = ROWS(FIELDS),                                                                                      \
     .instances = INSTANCES,                                                                                           \
     .instance_count = ROWS(INSTANCES),                                                                                \
     .states = STATES,                                                                                                 \
     .state_count = ROWS(STATES),                                                                                      \
     .requests = REQUESTS,                                                                                             \
     .request_count = ROWS(REQUESTS),                                                                                  \
     .transitions = TRANSITIONS,                                                                                       \
     .transition_count = sizeof TRANSITIONS / sizeof TRANSITIONS[0],                                                   \
     .channels = CHANNELS,                                                                                             \
     .channel_count = ROWS(CHANNELS),                                                                                  \
     .arm_field = FCSL_NONE,                                                                                           \
     .fault_places = FAULT_PLACES,                                                                                     \
     .fault_place_count = ROWS(FAULT_PLACES),                                                                          \
     .views = FIXTURE_VIEWS,                                                                                           \
     .init = initialise,                                                                                               \
     .step = step,                                                                                                     \
     .force_state = force_state}

static const fcsl_machine_t FIXTURE = DESCRIPTOR("fixture");
#ifdef FIXTURE_TWIN
static const fcsl_machine_t FIXTURE_TWIN_MACHINE = DESCRIPTOR("fixture_twin");
#endif

const fcsl_machine_t *const fcsl_machines[] = {
    &FIXTURE,
#ifdef FIXTURE_TWIN
    &FIXTURE_TWIN_MACHINE,
#endif
    NULL,
};
