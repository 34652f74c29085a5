/* SPDX-License-Identifier: Apache-2.0
 *
 * Named values without lock-step (docs/reference/transports.md, "Free-running"): what a tick makes of the values and commits that came, whoever put
 * them. The other end is a session that puts byte by byte.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_scalar.h"
#include "named_values/commit.h"
#include "named_values/wire_named.h"
#include "named_values/wire_named_internal.h"
#include "wire_fixture.h"

enum { TICK = 0, COMMAND = 1, ENABLE = 2, REPLY = 3, FLAG = 1, PACKET = 2 };

static const char *const COMMANDS[] = {"fleet/channels/tick", "fleet/channels/command", "fleet/channels/enable",
                                       "fleet/channels/reply"};
static const char *const SENSORS[] = {"fleet/channels/tick", "fleet/channels/flag", "fleet/channels/packet"};
static fcsl_channel_table_t table;

static fcsl_wire_t open_free(fcsl_wire_side_t side)
{
    static char address[96];
    fcsl_error_t error = {""};
    fcsl_wire_t wire;
    (void)snprintf(address, sizeof address, "%s,free-running", spec);
    CHECK(fcsl_wire_check_named(address, &error) == 0 && fcsl_wire_runs_free(address));
    CHECK(fcsl_wire_open_named(address, "fleet", &table, side, 0, &wire, &error) == 0);
    return wire;
}

static fcsl_bus_t *open_other(fcsl_bus_role_t role, const char *const *outputs, uint32_t count)
{
    const fcsl_bus_options_t options = {.role = role,
                                        .endpoint = spec + strlen("zenoh:"),
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = 4096,
                                        .outputs = outputs,
                                        .output_count = count};
    fcsl_bus_t *bus = open_bus(&options);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, TICK) && fcsl_bus_matched(bus, count - 1u));
    return bus;
}

static named_counters_t count(const fcsl_wire_t *wire)
{
    named_counters_t counters;
    wire->count(wire->ctx, &counters);
    return counters;
}

/* What a tick takes after `received` messages have come. */
static fcsl_wire_status_t take(const fcsl_wire_t *wire, uint64_t received, fcsl_message_kind_t kind, uint8_t *bytes,
                               fcsl_message_t *message)
{
    size_t size = 0;
    const uint64_t give_up_ns = later_ns();
    while (count(wire).bus.received < received) {
        CHECK(fcsl_monotonic_ns() < give_up_ns);
        (void)usleep(1000);
    }
    const fcsl_wire_status_t status = wire->receive(wire->ctx, 0, bytes, MESSAGE_BYTES, &size);
    if (status == FCSL_WIRE_OK) {
        CHECK(fcsl_message_check(&table, kind, bytes, size, message) == FCSL_MESSAGE_OK);
    }
    return status;
}

static void post(fcsl_bus_t *bus, uint32_t output, const void *bytes, size_t size)
{
    CHECK(fcsl_bus_post(bus, output, bytes, size) == 0);
}

static void post_commands(fcsl_bus_t *bus, double first)
{
    uint8_t bytes[16] = {0};
    memcpy(bytes, &first, sizeof first);
    post(bus, COMMAND, bytes, sizeof bytes);
}

static void post_commit(fcsl_bus_t *bus, uint32_t hash_error, uint8_t direction, uint8_t armed)
{
    static const uint8_t none[CHANNEL_COUNT];
    uint8_t bytes[64];
    const commit_t commit = {.tick = 77, /* of its own counting */
                             .table_hash = table.hash + hash_error,
                             .direction = direction,
                             .armed = armed,
                             .channels = CHANNEL_COUNT};
    commit_write(&commit, none, bytes);
    post(bus, TICK, bytes, commit_bytes(CHANNEL_COUNT));
}

static void check_command(const fcsl_message_t *message, double first, uint8_t armed)
{
    data_t data;
    memset(&data, 0, sizeof data);
    fcsl_message_apply(&MACHINE, &data, message);
    CHECK(data.command[0] == first && message->armed == armed && data.enable[0] == 1 && data.reply[0] == 2);
}

/* A command needs a commit and, once, a value of every actuator; from then on they hold. */
static void test_commands(void)
{
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message = {0};
    const fcsl_wire_t wire = open_free(FCSL_WIRE_LISTEN);
    fcsl_bus_t *bus = open_other(FCSL_BUS_CLIENT, COMMANDS, 4);
    post_commands(bus, 1.0);
    post_commit(bus, 0, FCSL_ACTUATOR, 1);
    CHECK(take(&wire, 2, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_NONE);
    post_commands(bus, 2.0);
    post_commands(bus, 3.0);
    post(bus, ENABLE, "\1\0\1", 3);
    post(bus, REPLY, "ok", 2);
    CHECK(take(&wire, 6, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_NONE);
    CHECK(count(&wire).bus.replaced == 1);
    post_commit(bus, 0, FCSL_ACTUATOR, 1);
    CHECK(take(&wire, 7, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_OK);
    check_command(&message, 3.0, 1);
    CHECK(take(&wire, 7, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_NONE);
    post_commit(bus, 0, FCSL_ACTUATOR, 0);
    CHECK(take(&wire, 8, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_OK);
    check_command(&message, 3.0, 0);
    post_commit(bus, 1, FCSL_ACTUATOR, 1);
    CHECK(take(&wire, 9, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_NONE);
    post_commit(bus, 0, FCSL_SENSOR, 1);
    CHECK(take(&wire, 10, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_NONE);
    CHECK(count(&wire).commits_refused == 2);
    post(bus, ENABLE, "\2\0\0", 3); /* no bool */
    post_commit(bus, 0, FCSL_ACTUATOR, 1);
    post_commit(bus, 0, FCSL_ACTUATOR, 0); /* the newest one counts */
    CHECK(take(&wire, 13, FCSL_ACTUATOR_MESSAGE, bytes, &message) == FCSL_WIRE_OK);
    check_command(&message, 3.0, 0);
    CHECK(count(&wire).values_refused == 1);
    (void)fcsl_bus_close(bus, WAIT_MS);
    wire.close(wire.ctx);
}

/* It opens before anybody listens. A sample is of the channels alone of which a value came, and needs no commit. */
static void test_samples(void)
{
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message = {0};
    fcsl_message_entry_t entry = {0};
    const fcsl_wire_t wire = open_free(FCSL_WIRE_CONNECT);
    fcsl_bus_t *bus = open_other(FCSL_BUS_LISTEN, SENSORS, 3);
    post(bus, FLAG, "\1", 1);
    CHECK(take(&wire, 1, FCSL_SENSOR_MESSAGE, bytes, &message) == FCSL_WIRE_OK);
    CHECK(fcsl_message_next(&MACHINE, &message, &entry) && strcmp(CHANNELS[entry.channel].name, "flag") == 0);
    CHECK(!fcsl_message_next(&MACHINE, &message, &entry));
    post(bus, PACKET, "a", 1);
    post(bus, PACKET, "abc", 3);
    post_commit(bus, 0, FCSL_SENSOR, 0);
    CHECK(take(&wire, 4, FCSL_SENSOR_MESSAGE, bytes, &message) == FCSL_WIRE_OK);
    entry = (fcsl_message_entry_t){0};
    CHECK(fcsl_message_next(&MACHINE, &message, &entry) && entry.size == 3 && memcmp(entry.values, "abc", 3) == 0);
    CHECK(!fcsl_message_next(&MACHINE, &message, &entry));
    CHECK(take(&wire, 4, FCSL_SENSOR_MESSAGE, bytes, &message) == FCSL_WIRE_NONE);
    CHECK(count(&wire).bus.replaced == 1 && count(&wire).commits_refused == 0);
    (void)fcsl_bus_close(bus, WAIT_MS);
    wire.close(wire.ctx);
}

/* Nobody ever listens: it opens, takes what is sent as long as there is room, and closes in its time. */
static void test_alone(void)
{
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message = {0};
    data_t data;
    memset(&data, 0, sizeof data);
    const fcsl_wire_t wire = open_free(FCSL_WIRE_CONNECT);
    CHECK(fcsl_message_encode_actuators(&table, &data, 0, 1, bytes, sizeof bytes, &message) == FCSL_MESSAGE_OK);
    fcsl_wire_status_t status = FCSL_WIRE_OK;
    for (int i = 0; i < 100; i++) {
        status = wire.send(wire.ctx, message.bytes, message.size);
    }
    CHECK(status == FCSL_WIRE_NONE && count(&wire).bus.refused > 0);
    CHECK(take(&wire, 0, FCSL_SENSOR_MESSAGE, bytes, &message) == FCSL_WIRE_NONE);
    wire.close(wire.ctx);
}

int main(void)
{
    table = fcsl_channel_table(&MACHINE);
    use_port("zenoh:tcp:");
    check_alone(test_commands);
    check_alone(test_samples);
    check_alone(test_alone);
    return 0;
}
