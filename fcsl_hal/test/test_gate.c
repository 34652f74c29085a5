/* SPDX-License-Identifier: Apache-2.0
 *
 * The gate before the actuators: what they get is the last command while that arms them, and their safe values else. A random
 * course of commands and silence is compared with this rule, applied to the whole course.
 */
#include <string.h>

#include "channel_fixture.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl_check.h"

enum { MESSAGE_BYTES = 256, ROUNDS = 20000, TIMEOUT_NS = 100 };
enum { COMMAND_CHANNEL = 1, ENABLE_CHANNEL = 9 }; /* in CHANNELS */

static const double SAFE_COMMAND[2] = {-1.5, 0.25};
static const uint8_t SAFE_ENABLE[3] = {0, 1, 0};

/* The machine of channel_fixture.h, with these safe values; null: none. */
typedef struct {
    fcsl_machine_t machine;
    fcsl_channel_t channels[CHANNEL_COUNT];
    fcsl_channel_table_t table;
} rig_t;

static void build(rig_t *rig, const void *safe_command, const void *safe_enable, uint64_t timeout_ns)
{
    rig->machine = MACHINE;
    memcpy(rig->channels, CHANNELS, sizeof CHANNELS);
    rig->channels[COMMAND_CHANNEL].safe = safe_command;
    rig->channels[ENABLE_CHANNEL].safe = safe_enable;
    rig->machine.channels = rig->channels;
    rig->machine.command_timeout_ns = timeout_ns;
    rig->table = fcsl_channel_table(&rig->machine);
}

/* A command whose values tell its number. */
static fcsl_message_t command(const rig_t *rig, uint64_t number, int armed, uint8_t *bytes)
{
    const data_t data = {.command = {(double)number, -(double)number},
                         .enable = {number & 1u, (number >> 1u) & 1u, (number >> 2u) & 1u}};
    fcsl_message_t message = {0};
    CHECK(fcsl_message_encode_actuators(&rig->table, &data, number, armed, bytes, MESSAGE_BYTES, &message) ==
          FCSL_MESSAGE_OK);
    return message;
}

static int is_safe(const data_t *data)
{
    return memcmp(data->command, SAFE_COMMAND, sizeof SAFE_COMMAND) == 0 &&
           memcmp(data->enable, SAFE_ENABLE, sizeof SAFE_ENABLE) == 0;
}

static int is_command(const data_t *data, uint64_t number)
{
    return data->command[0] == (double)number && data->command[1] == -(double)number &&
           data->enable[0] == (number & 1u) && data->enable[2] == ((number >> 2u) & 1u);
}

static void test_closed_until_armed(void)
{
    rig_t rig;
    uint8_t bytes[MESSAGE_BYTES];
    data_t data = {.command = {7.0, 7.0}};
    build(&rig, SAFE_COMMAND, SAFE_ENABLE, 0);
    fcsl_gate_t gate = fcsl_gate(&rig.machine, &data);
    CHECK(gate.state == FCSL_GATE_DISARMED && is_safe(&data));
    fcsl_gate_wait(&gate, UINT64_MAX, &data);
    CHECK(gate.state == FCSL_GATE_DISARMED && is_safe(&data));

    fcsl_message_t message = command(&rig, 5, 0, bytes);
    fcsl_gate_command(&gate, &message, 10, &data);
    CHECK(gate.state == FCSL_GATE_DISARMED && is_safe(&data));
    message = command(&rig, 6, 1, bytes);
    fcsl_gate_command(&gate, &message, 20, &data);
    CHECK(gate.state == FCSL_GATE_ARMED && is_command(&data, 6));
    fcsl_gate_wait(&gate, UINT64_MAX, &data); /* without a time-out it waits for ever */
    CHECK(gate.state == FCSL_GATE_ARMED && is_command(&data, 6));
    message = command(&rig, 7, 0, bytes);
    fcsl_gate_command(&gate, &message, 30, &data);
    CHECK(gate.state == FCSL_GATE_DISARMED && is_safe(&data));
}

/* Silence begins with the time-out, not before; a clock that went back is none; the next command ends it. */
static void test_timeout(void)
{
    rig_t rig;
    uint8_t bytes[MESSAGE_BYTES];
    data_t data = {0};
    build(&rig, SAFE_COMMAND, SAFE_ENABLE, TIMEOUT_NS);
    fcsl_gate_t gate = fcsl_gate(&rig.machine, &data);
    const fcsl_message_t message = command(&rig, 3, 1, bytes);
    fcsl_gate_command(&gate, &message, 1000, &data);
    fcsl_gate_wait(&gate, 0, &data);
    fcsl_gate_wait(&gate, 1000 + TIMEOUT_NS - 1, &data);
    CHECK(gate.state == FCSL_GATE_ARMED && is_command(&data, 3));
    fcsl_gate_wait(&gate, 1000 + TIMEOUT_NS, &data);
    CHECK(gate.state == FCSL_GATE_SILENT && is_safe(&data));
    fcsl_gate_wait(&gate, 1000, &data); /* time alone does not end it */
    CHECK(gate.state == FCSL_GATE_SILENT && is_safe(&data));
    fcsl_gate_command(&gate, &message, 5000, &data);
    CHECK(gate.state == FCSL_GATE_ARMED && is_command(&data, 3));
}

/* A channel without a safe value keeps what it has, and nothing else of the struct is written. */
static void test_what_is_written(void)
{
    rig_t rig;
    uint8_t bytes[MESSAGE_BYTES];
    data_t data;
    data_t before;
    build(&rig, SAFE_COMMAND, NULL, 0);
    memset(&data, 0x5a, sizeof data);
    memset(data.enable, 1, sizeof data.enable);
    before = data;
    fcsl_gate_t gate = fcsl_gate(&rig.machine, &data);
    CHECK(memcmp(data.command, SAFE_COMMAND, sizeof SAFE_COMMAND) == 0);
    memcpy(before.command, SAFE_COMMAND, sizeof SAFE_COMMAND);
    CHECK(memcmp(&data, &before, sizeof data) == 0);
    const fcsl_message_t message = command(&rig, 8, 0, bytes);
    fcsl_gate_command(&gate, &message, 1, &data);
    CHECK(memcmp(&data, &before, sizeof data) == 0);
}

/* Any course: the values are those of the last command if it armed and is young enough, and safe otherwise. */
static void test_any_course(void)
{
    rig_t rig;
    uint8_t bytes[MESSAGE_BYTES];
    data_t data = {0};
    uint64_t random = 42;
    uint64_t now = 0;
    uint64_t last = 0;
    uint64_t came = 0;
    int armed = 0;
    int counts[3] = {0};
    build(&rig, SAFE_COMMAND, SAFE_ENABLE, TIMEOUT_NS);
    fcsl_gate_t gate = fcsl_gate(&rig.machine, &data);
    for (uint64_t i = 1; i <= ROUNDS; i++) {
        random = random * 6364136223846793005u + 1442695040888963407u;
        now += (random >> 33u) % (TIMEOUT_NS / 2);
        if ((random >> 60u) < 4u) {
            armed = (int)((random >> 59u) & 1u);
            const fcsl_message_t message = command(&rig, i, armed, bytes);
            fcsl_gate_command(&gate, &message, now, &data);
            last = i;
            came = now;
        } else {
            fcsl_gate_wait(&gate, now, &data);
            armed = armed && now - came < TIMEOUT_NS;
        }
        CHECK(armed ? is_command(&data, last) : is_safe(&data));
        CHECK((gate.state == FCSL_GATE_ARMED) == armed);
        counts[gate.state]++;
    }
    CHECK(counts[FCSL_GATE_DISARMED] > 100 && counts[FCSL_GATE_ARMED] > 100 && counts[FCSL_GATE_SILENT] > 100);
}

static void test_armed(void)
{
    data_t data = {0};
    fcsl_machine_t machine = MACHINE;
    CHECK(fcsl_is_armed(&machine, &data)); /* nothing arms it */
    machine.arm_field = 0; /* `flag` */
    CHECK(!fcsl_is_armed(&machine, &data));
    data.flag = 1;
    CHECK(fcsl_is_armed(&machine, &data));
    memset(&data.flag, 2, sizeof data.flag);
    CHECK(!fcsl_is_armed(&machine, &data));
}

static void test_texts(void)
{
    CHECK(strcmp(fcsl_gate_state_text(FCSL_GATE_DISARMED), "disarmed") == 0);
    CHECK(strcmp(fcsl_gate_state_text(FCSL_GATE_ARMED), "armed") == 0);
    CHECK(strcmp(fcsl_gate_state_text(FCSL_GATE_SILENT), "silent") == 0);
}

int main(void)
{
    test_closed_until_armed();
    test_timeout();
    test_what_is_written();
    test_any_course();
    test_armed();
    test_texts();
    return 0;
}
