/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine written by hand against the ABI whose instance `io` is impure: in every second tick it reads an ADC channel
 * (1 mV a count), a register and a pin and drives a pin and another register. `law` computes from what `io` read.
 */
#include <math.h>
#include <string.h>

#include "fcsl/fcsl_hw.h"

enum { LEVEL_PIN = 4, LED_PIN = 17, ADC_CHANNEL = 3, TURNS_REGISTER = 0x40000024 };

#define DUTY_REGISTER 0xFFFFFFFFu

typedef struct {
    uint64_t tick;
    int32_t state, next_state, current;
    struct {
        uint32_t led_pin;
        int64_t turns;
        double volts, total;
        uint8_t level;
        int32_t request, health;
        uint64_t faults, overruns;
        uint32_t fault_place;
    } io;
    struct {
        double in_total, out;
        int32_t request, health;
        uint64_t faults, overruns;
        uint32_t fault_place;
    } law;
} bench_t;

enum { IO, LAW };
enum { FIRST_IO = 3, TOTAL = FIRST_IO + 4, FIRST_LAW = FIRST_IO + 10 };
#define W            FCSL_FIELD_WRITABLE
#define IMPURE       FCSL_FIELD_IMPURE
#define AT(member)   (uint32_t)offsetof(bench_t, member)
#define SIZE(member) (uint32_t)sizeof(((bench_t *)0)->member)
#define FIELD(path, role, type, flags, member, instance, from)                                                         \
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
     "",                                                                                                               \
     "",                                                                                                               \
     -(double)INFINITY,                                                                                                \
     (double)INFINITY}

static const fcsl_field_t fields[] = {
    FIELD("machine.tick", FCSL_ROLE_MACHINE, FCSL_U64, 0, tick, FCSL_NONE, FCSL_NONE),
    FIELD("machine.state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, state, FCSL_NONE, FCSL_NONE),
    FIELD("machine.next_state", FCSL_ROLE_MACHINE, FCSL_STATE, 0, next_state, FCSL_NONE, FCSL_NONE),
    FIELD("io.parameters.led_pin", FCSL_ROLE_PARAMETER, FCSL_U32, W, io.led_pin, IO, FCSL_NONE),
    FIELD("io.state.turns", FCSL_ROLE_STATE, FCSL_I64, IMPURE, io.turns, IO, FCSL_NONE),
    FIELD("io.outputs.volts", FCSL_ROLE_OUTPUT, FCSL_F64, IMPURE, io.volts, IO, FCSL_NONE),
    FIELD("io.outputs.level", FCSL_ROLE_OUTPUT, FCSL_BOOL, IMPURE, io.level, IO, FCSL_NONE),
    FIELD("io.outputs.total", FCSL_ROLE_OUTPUT, FCSL_F64, IMPURE, io.total, IO, FCSL_NONE),
    FIELD("io.outputs.transition_request", FCSL_ROLE_OUTPUT, FCSL_TRANSITION_REQUEST, IMPURE, io.request, IO,
          FCSL_NONE),
    FIELD("io.outputs.health", FCSL_ROLE_OUTPUT, FCSL_HEALTH, IMPURE, io.health, IO, FCSL_NONE),
    FIELD("io.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, io.faults, IO, FCSL_NONE),
    FIELD("io.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, io.overruns, IO, FCSL_NONE),
    FIELD("io.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, io.fault_place, IO, FCSL_NONE),
    FIELD("law.inputs.total", FCSL_ROLE_INPUT, FCSL_F64, W, law.in_total, LAW, TOTAL),
    FIELD("law.outputs.out", FCSL_ROLE_OUTPUT, FCSL_F64, 0, law.out, LAW, FCSL_NONE),
    FIELD("law.outputs.transition_request", FCSL_ROLE_OUTPUT, FCSL_TRANSITION_REQUEST, 0, law.request, LAW, FCSL_NONE),
    FIELD("law.outputs.health", FCSL_ROLE_OUTPUT, FCSL_HEALTH, 0, law.health, LAW, FCSL_NONE),
    FIELD("law.counters.faults", FCSL_ROLE_COUNTER, FCSL_U64, 0, law.faults, LAW, FCSL_NONE),
    FIELD("law.counters.overruns", FCSL_ROLE_COUNTER, FCSL_U64, 0, law.overruns, LAW, FCSL_NONE),
    FIELD("law.counters.fault_place", FCSL_ROLE_COUNTER, FCSL_U32, 0, law.fault_place, LAW, FCSL_NONE),
};

static const fcsl_instance_t instances[] = {
    {"io", "io", "bench.c", 1, FIRST_IO, FIRST_LAW - FIRST_IO, AT(io.request), AT(io.health), AT(io.faults),
     AT(io.overruns), AT(io.fault_place), FCSL_NO_OFFSET, FCSL_NO_OFFSET, 0, 1, "bench/msg/BenchIo",
     "std_msgs/Header header\nuint64 tick\nfloat64 volts\nbool level\nfloat64 total\nuint8 health\n"},
    {"law", "law", "bench.c", 1, FIRST_LAW, 7, AT(law.request), AT(law.health), AT(law.faults), AT(law.overruns),
     AT(law.fault_place), FCSL_NO_OFFSET, FCSL_NO_OFFSET, 0, 1, "bench/msg/BenchLaw",
     "std_msgs/Header header\nuint64 tick\nfloat64 out\nuint8 health\n"},
};

static const fcsl_schedule_t schedule[] = {{IO, 2, 1}, {LAW, 1, 0}};
enum { TOO_HIGH = 1 };
static const fcsl_fault_place_t fault_places[] = {{"bench.c", 114, 15, "the voltage is too high"}};
static const fcsl_state_t states[] = {{"RUN", schedule, 2}};

static int32_t init(void *machine)
{
    bench_t *m = machine;
    memset(m, 0, sizeof *m);
    m->current = FCSL_NONE;
    m->io.led_pin = LED_PIN;
    m->io.health = m->law.health = FCSL_STALE;
    return 0;
}

/* Two volts and more are a fault: outputs and state stay, what was written to hardware stays written. */
static void run_io(bench_t *m, const fcsl_host_t *host)
{
    const uint32_t counts = fcsl_hw_read_adc(host, ADC_CHANNEL);
    const double volts = counts / 1000.0;
    fcsl_hw_write_gpio(host, m->io.led_pin, volts > 1.0);
    fcsl_hw_write_u32(host, DUTY_REGISTER, counts / 2u);
    m->io.health = FCSL_NOMINAL;
    if (volts >= 2.0) {
        m->io.faults++;
        m->io.fault_place = TOO_HIGH;
        m->io.health = FCSL_FAILED;
        return;
    }
    m->io.turns += (int64_t)fcsl_hw_read_u32(host, TURNS_REGISTER);
    m->io.level = fcsl_hw_read_gpio(host, LEVEL_PIN);
    m->io.volts = volts;
    m->io.total = volts * (double)m->io.turns;
}

static void step(void *machine, const fcsl_host_t *host)
{
    bench_t *m = machine;
    if (m->tick % 2u == 1u && (host->substitute == NULL || host->substitute(host->ctx, IO) == 0)) {
        run_io(m, host);
    }
    m->law.in_total = m->io.total;
    m->law.out += m->law.in_total;
    m->law.health = m->io.health == FCSL_FAILED ? FCSL_DEGRADED : FCSL_NOMINAL;
    m->tick++;
}

static void force_state(void *machine, int32_t state)
{
    bench_t *m = machine;
    m->state = m->next_state = state;
    m->io.health = m->law.health = FCSL_STALE;
}

#define COUNT(table) (uint32_t)(sizeof(table) / sizeof(table)[0])
#define HASH         "4444444444444444444444444444444444444444444444444444444444444444"

static const fcsl_machine_t bench = {
    .abi_version = FCSL_ABI_VERSION,
    .name = "bench",
    .source_hash = HASH,
    .layout_hash = HASH,
    .build_hash = HASH,
    .tick_hz = 1000,
    .size = sizeof(bench_t),
    .align = _Alignof(bench_t),
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
    .arm_field = FCSL_NONE,
    .fault_places = fault_places,
    .fault_place_count = COUNT(fault_places),
    .views = "",
    .init = init,
    .step = step,
    .force_state = force_state,
};

const fcsl_machine_t *const fcsl_machines[] = {&bench, NULL};
