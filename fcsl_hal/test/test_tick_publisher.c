/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick of a machine puts on the bus for observers: values and commits, byte for byte. The machine is by hand, because those of fcslc
 * have no two sensors with one age and stamp, which a test here writes once.
 */
#define _GNU_SOURCE
#include "bus_rig.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_tick_publisher.h"
#include "fcsl/fcsl_scalar.h"

enum {
    ALTITUDE,
    PACKET,
    THROTTLE,
    ARMED,
    CHANNELS,
    WRITES = CHANNELS + 1,
    WRITTEN,
    COMMIT_BYTES = 25,
    LONG_BYTES = 50000,
    WRITE_BYTES = 1 << 20, /* as long as a message of the bus may be */
    DEPTH = 16,
    MANY = 20000
};

typedef struct {
    double altitude;
    int64_t stamp_ns;
    uint32_t age;
    uint32_t packet[4]; /* a blob of at most 3 bytes */
    float throttle[2];
    uint8_t attached;
    uint8_t armed;
} data_t;

#define AT(member) ((uint32_t)offsetof(data_t, member))

static const uint32_t FOUR[] = {4};
static const uint32_t TWO[] = {2};
static const fcsl_field_t FIELDS[] = {
    {.path = "altitude", .type = FCSL_F64, .count = 1, .offset = AT(altitude), .size = 8},
    {.path = "packet", .type = FCSL_U32, .rank = 1, .shape = FOUR, .count = 4, .offset = AT(packet), .size = 16},
    {.path = "throttle", .type = FCSL_F32, .rank = 1, .shape = TWO, .count = 2, .offset = AT(throttle), .size = 8},
    {.path = "armed", .type = FCSL_BOOL, .count = 1, .offset = AT(armed), .size = 1},
};
#define SENSOR                                                                                                         \
    .direction = FCSL_SENSOR, .attached_offset = AT(attached), .age_offset = AT(age), .stamp_offset = AT(stamp_ns)
static const fcsl_channel_t CHANNEL_TABLE[] = {
    {.name = "altitude", .id = 1, .field = 0, SENSOR},
    {.name = "gps.packet", .id = 2, .field = 1, .as = FCSL_AS_BLOB, SENSOR},
    {.name = "throttle", .id = 3, .field = 2, .direction = FCSL_ACTUATOR},
    {.name = "armed", .id = 4, .field = 3, .direction = FCSL_REPORT},
};
static const fcsl_machine_t MACHINE = {.name = "craft",
                                       .tick_hz = 100,
                                       .size = sizeof(data_t),
                                       .fields = FIELDS,
                                       .field_count = 4,
                                       .channels = CHANNEL_TABLE,
                                       .channel_count = CHANNELS,
                                       .arm_field = 3};

static fcsl_tick_publisher_t *open_publisher(const char *endpoint)
{
    const fcsl_tick_publisher_options_t options = {
        .endpoint = endpoint, .name_space = "north", .descriptor = "{}", .write_bytes = WRITE_BYTES};
    fcsl_tick_publisher_t *publisher = NULL;
    fcsl_error_t error = {""};
    CHECK(fcsl_tick_publisher_open(&options, &MACHINE, &publisher, &error) == 0);
    return publisher;
}

static fcsl_bus_t *observe(const char *endpoint)
{
    const fcsl_bus_input_t inputs[] = {{.key = "north/craft/altitude", .bytes = 8, .least = 8, .depth = DEPTH},
                                       {.key = "north/craft/gps.packet", .bytes = 3, .depth = DEPTH},
                                       {.key = "north/craft/throttle", .bytes = 8, .least = 8, .depth = DEPTH},
                                       {.key = "north/craft/armed", .bytes = 1, .least = 1, .depth = DEPTH},
                                       {.key = "north/craft/tick", .bytes = COMMIT_BYTES, .depth = DEPTH},
                                       {.key = "north/craft/@writes", .bytes = WRITE_BYTES, .depth = DEPTH},
                                       {.key = "north/craft/@written", .bytes = 16, .least = 16, .depth = DEPTH}};
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .inputs = inputs,
                                        .input_count = WRITTEN + 1u};
    return open_bus(&options);
}

static void post(fcsl_tick_publisher_t *publisher, const data_t *data, uint64_t tick)
{
    const uint64_t give_up_ns = later_ns();
    while (!fcsl_tick_publisher_ready(publisher)) {
        CHECK(fcsl_monotonic_ns() < give_up_ns);
    }
    CHECK(fcsl_tick_publisher_post(publisher, data, tick, tick * 10u, 0) == 0);
}

static void expect_commit(fcsl_bus_t *bus, uint64_t tick, uint8_t direction, uint8_t armed, uint8_t bits)
{
    uint8_t commit[COMMIT_BYTES];
    take_one(bus, CHANNELS, commit, sizeof commit);
    CHECK(fcsl_get_u64(commit) == tick && fcsl_get_u64(commit + 8) == (direction == FCSL_SENSOR ? tick * 10u : 0u));
    CHECK(fcsl_get_u32(commit + 16) == fcsl_channel_table(&MACHINE).hash && fcsl_get_u16(commit + 22) == CHANNELS);
    CHECK(commit[20] == direction && commit[21] == armed && commit[24] == bits);
}

/* The commit says `armed`; what is reported, `reports`, has one of its own. */
static void expect_commands(fcsl_bus_t *bus, uint64_t tick, uint8_t armed, uint8_t reports)
{
    static const uint8_t values[] = {0, 0, 0, 0x3f, 0, 0, 0xc0, 0x7f}; /* 0.5, and a NaN whose sign is gone */
    uint8_t throttle[8];
    take_one(bus, THROTTLE, throttle, sizeof throttle);
    CHECK(memcmp(throttle, values, sizeof values) == 0);
    expect_commit(bus, tick, FCSL_ACTUATOR, armed, 1u << THROTTLE);
    uint8_t reported = 2;
    take_one(bus, ARMED, &reported, 1);
    CHECK(reported == reports);
    expect_commit(bus, tick, FCSL_REPORT, 0, 1u << ARMED);
}

static void expect_actuators(fcsl_bus_t *bus, uint64_t tick, uint8_t armed)
{
    expect_commands(bus, tick, armed, armed);
}

static void expect_sensors(fcsl_bus_t *bus, uint64_t tick, const uint8_t *packet, size_t size)
{
    uint8_t bytes[8];
    double altitude = 0.0;
    take_one(bus, ALTITUDE, bytes, sizeof altitude);
    fcsl_scalars_import(&altitude, bytes, FCSL_F64, 1);
    CHECK(altitude == (double)tick);
    take_one(bus, PACKET, bytes, size);
    CHECK(memcmp(bytes, packet, size) == 0);
    expect_commit(bus, tick, FCSL_SENSOR, 0, 1u << ALTITUDE | 1u << PACKET);
}

/* Posts ticks until a message of every key has come, and takes them all. */
static void meet(fcsl_tick_publisher_t *publisher, fcsl_bus_t *bus)
{
    enum { KEYS = WRITTEN + 1, LAST = 1000000 };
    const data_t data = {.attached = 0};
    uint8_t bytes[COMMIT_BYTES];
    size_t size = 0;
    uint32_t seen = 0;
    const uint64_t give_up_ns = later_ns();
    for (uint64_t tick = 0; seen != (1u << KEYS) - 1u; tick++) {
        CHECK(fcsl_monotonic_ns() < give_up_ns);
        post(publisher, &data, tick);
        CHECK(fcsl_tick_publisher_post_write(publisher, "w", 1) == 0 &&
              fcsl_tick_publisher_post_written(publisher, tick, 0) == 0);
        (void)fcsl_bus_wait(bus, fcsl_monotonic_ns() + 20000000u);
        for (uint32_t i = 0; i < KEYS; i++) {
            seen |= fcsl_bus_take(bus, i, bytes, &size) ? 1u << i : 0u;
        }
    }
    post(publisher, &data, LAST);
    do {
        take_one(bus, CHANNELS, bytes, COMMIT_BYTES);
    } while (fcsl_get_u64(bytes) != LAST || bytes[20] != FCSL_REPORT);
    for (uint32_t i = 0; i < KEYS; i++) {
        while (fcsl_bus_take(bus, i, bytes, &size)) {
        }
    }
    fcsl_tick_publisher_begin(publisher);
}

static void check_ticks(fcsl_tick_publisher_t *publisher, fcsl_bus_t *bus)
{
    data_t data = {.altitude = 5.0, .age = 2, .packet = {2, 0x141, 0x42, 0x43}, .throttle = {0.5f}, .attached = 1};
    const uint32_t nan = 0xffc12345u;
    memcpy(&data.throttle[1], &nan, sizeof nan);
    post(publisher, &data, 5); /* the first one: all that there is */
    expect_sensors(bus, 5, (const uint8_t *)"AB", 2);
    expect_actuators(bus, 5, 0);
    data.age = 3;
    data.armed = 1;
    post(publisher, &data, 6); /* no sample */
    expect_commit(bus, 6, FCSL_SENSOR, 0, 0);
    expect_actuators(bus, 6, 1);
    data.age = 4;
    CHECK(fcsl_tick_publisher_post(publisher, &data, 7, 70, 1) == 0); /* armed, and a new arming is required */
    expect_commit(bus, 7, FCSL_SENSOR, 0, 0);
    expect_commands(bus, 7, 0, 1);
    data = (data_t){.altitude = 9.0, .age = 5, .packet = {77, 'x', 'y', 'z'}, .throttle = {0.5f}, .attached = 1};
    memcpy(&data.throttle[1], &nan, sizeof nan);
    post(publisher, &data, 9); /* 8 was dropped, and in it or in this one a sample came */
    expect_sensors(bus, 9, (const uint8_t *)"xyz", 3);
    expect_actuators(bus, 9, 0);
    data.altitude = 10.0;
    data.age = 0;
    data.packet[0] = 0;
    post(publisher, &data, 10);
    expect_sensors(bus, 10, (const uint8_t *)"", 0);
    expect_actuators(bus, 10, 0);
    data.altitude = 11.0;
    data.age = UINT32_MAX;
    data.attached = 0;
    post(publisher, &data, 11); /* nobody samples: what a host set */
    expect_sensors(bus, 11, (const uint8_t *)"", 0);
    expect_actuators(bus, 11, 0);
    data.altitude = 12.0;
    data.attached = 1;
    fcsl_tick_publisher_begin(publisher);
    post(publisher, &data, 12);
    expect_sensors(bus, 12, (const uint8_t *)"", 0);
    expect_actuators(bus, 12, 0);
    data.altitude = 13.0;
    post(publisher, &data, 13); /* no sample ever came */
    expect_commit(bus, 13, FCSL_SENSOR, 0, 0);
    expect_actuators(bus, 13, 0);
    data.altitude = 14.0;
    data.age = 0;
    post(publisher, &data, 14);
    expect_sensors(bus, 14, (const uint8_t *)"", 0);
    expect_actuators(bus, 14, 0);
    data.altitude = 15.0;
    data.age = 1;
    data.stamp_ns = 7;
    post(publisher, &data, 15); /* a newer sample, which is as old as the one before would be */
    expect_sensors(bus, 15, (const uint8_t *)"", 0);
    expect_actuators(bus, 15, 0);
}

static void check_writes(fcsl_tick_publisher_t *publisher, fcsl_bus_t *bus)
{
    static uint8_t bytes[LONG_BYTES];
    static uint8_t got[LONG_BYTES];
    uint8_t written[16];
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)(i * 7u);
    }
    CHECK(fcsl_tick_publisher_writes_watched(publisher));
    const uint64_t give_up_ns = later_ns();
    while (!fcsl_tick_publisher_ready(publisher)) {
        CHECK(fcsl_monotonic_ns() < give_up_ns);
    }
    CHECK(fcsl_tick_publisher_post_write(publisher, "write", 5) == 0);
    CHECK(fcsl_tick_publisher_post_write(publisher, bytes, sizeof bytes) == 0);
    CHECK(fcsl_tick_publisher_post_written(publisher, 7, UINT64_C(1) << 40) == 0);
    take_one(bus, WRITES, got, 5);
    CHECK(memcmp(got, "write", 5) == 0);
    take_one(bus, WRITES, got, sizeof got);
    CHECK(memcmp(got, bytes, sizeof got) == 0);
    take_one(bus, WRITTEN, written, sizeof written);
    CHECK(fcsl_get_u64(written) == 7u && fcsl_get_u64(written + 8) == UINT64_C(1) << 40);
    CHECK(fcsl_tick_publisher_answer_checkpoint(publisher, "checkpoint", 10) == 0);
    CHECK(fcsl_tick_publisher_answer_checkpoint(publisher, "", FCSL_BUS_MESSAGE_MAX + 1u) == -1);
}

/* Writes take none of the room of ticks, however many there are. */
static void check_room_beside_writes(fcsl_tick_publisher_t *publisher)
{
    static const uint8_t bytes[WRITE_BYTES / 2];
    const data_t data = {.attached = 0};
    uint32_t posted = 0;
    const uint64_t give_up_ns = later_ns();
    while (!fcsl_tick_publisher_ready(publisher)) {
        CHECK(fcsl_monotonic_ns() < give_up_ns);
    }
    while (fcsl_tick_publisher_post_write(publisher, bytes, sizeof bytes) == 0) {
        posted++;
    }
    CHECK(posted == 2u * 4u - 1u || posted == 2u * 4u);
    CHECK(fcsl_tick_publisher_post(publisher, &data, 1, 0, 0) == 0);
}

/* Where there is room, there is room for all of a tick. */
static void check_room(fcsl_tick_publisher_t *publisher)
{
    const data_t data = {.attached = 0, .packet = {3}};
    uint32_t refused = 0;
    for (uint64_t tick = 0; tick < MANY; tick++) {
        const int ready = fcsl_tick_publisher_ready(publisher);
        const int posted = fcsl_tick_publisher_post(publisher, &data, tick, 0, 0) == 0;
        CHECK(posted || !ready);
        refused += !posted;
    }
    (void)printf("%u of %d ticks were refused\n", refused, MANY);
}

static void check_refused(fcsl_channel_t channel, const char *name_space, const char *endpoint, const char *why)
{
    static char descriptor[FCSL_BUS_MESSAGE_MAX + 2u];
    fcsl_machine_t machine = MACHINE;
    fcsl_tick_publisher_t *publisher = NULL;
    fcsl_error_t error = {""};
    memset(descriptor, ' ', sizeof descriptor - 1u);
    const fcsl_tick_publisher_options_t options = {
        .endpoint = endpoint, .name_space = name_space, .descriptor = endpoint[0] == 't' ? descriptor : "{}"};
    machine.channels = &channel;
    machine.channel_count = 1;
    CHECK(fcsl_tick_publisher_open(&options, &machine, &publisher, &error) == -1);
    CHECK(strstr(error.text, why) != NULL);
}

/* A plan of a message that does not hold together is found when composer or reader is made of it. */
static void check_a_wrong_payload(const char *endpoint)
{
    static const uint32_t channel = 0;
    static const uint8_t text[16];
    static const fcsl_channel_t channels[] = {{.name = "a"}};
    for (int is_composer = 0; is_composer < 2; is_composer++) {
        const fcsl_ros_composer_plan_t composer = {
            .text = text, .size = sizeof text, .stamp_offset = is_composer ? sizeof text : FCSL_ROS_NONE};
        const fcsl_ros_reader_plan_t reader = {.size = 8, .stamp_anchor = is_composer ? FCSL_ROS_NONE : 0};
        const fcsl_ros_message_t payload = {
            .type = "a/A", .channels = &channel, .channel_count = 1, .composer = &composer, .reader = &reader};
        const fcsl_machine_t machine = {.name = "craft",
                                        .tick_hz = 1,
                                        .size = 8,
                                        .fields = FIELDS,
                                        .field_count = 1,
                                        .channels = channels,
                                        .channel_count = 1,
                                        .payloads = &payload};
        const fcsl_tick_publisher_options_t options = {.endpoint = endpoint, .name_space = "", .descriptor = ""};
        fcsl_tick_publisher_t *publisher = NULL;
        fcsl_error_t error = {""};
        CHECK(fcsl_tick_publisher_open(&options, &machine, &publisher, &error) == -1 && publisher == NULL);
        CHECK(strstr(error.text, "of a message does not hold together") != NULL);
    }
}

int main(void)
{
    char endpoint[64];
    char long_name[FCSL_BUS_KEY_MAX + 1u];
    (void)snprintf(endpoint, sizeof endpoint, "%s", free_endpoint());
    memset(long_name, 'n', sizeof long_name - 1u);
    long_name[sizeof long_name - 1u] = '\0';
    check_refused((fcsl_channel_t){.name = "tick"}, "", endpoint, "channel 'tick' cannot go over the bus");
    check_refused((fcsl_channel_t){.name = "a"}, long_name, endpoint, "longer than 255 bytes");
    /* By a byte: namespace, machine, and what is longer of the channel and what else there is. */
    char namespace[FCSL_BUS_KEY_MAX];
    memset(namespace, 'n', sizeof namespace);
    const size_t length = FCSL_BUS_KEY_MAX + 1u - strlen(MACHINE.name) - strlen("@checkpoint") - 2u;
    namespace[length] = '\0';
    check_refused((fcsl_channel_t){.name = "a"}, namespace, endpoint, "' are longer than 255 bytes");
    check_refused((fcsl_channel_t){.name = "checkpoints"}, namespace, endpoint,
                  "the key of channel 'checkpoints' is longer than 255 bytes");
    namespace[length - 1u] = '\0';
    check_refused((fcsl_channel_t){.name = "checkpoints"}, namespace, endpoint, "at most 1048576 are possible");
    check_refused((fcsl_channel_t){.name = "a"}, "a//b", endpoint, "one slash between them");
    check_refused((fcsl_channel_t){.name = "a"}, "", "udp/127.0.0.1:7", "write tcp:HOST:PORT");
    check_refused((fcsl_channel_t){.name = "a"}, "", endpoint, "at most 1048576 are possible");
    check_a_wrong_payload(endpoint);
    fcsl_tick_publisher_t *publisher = open_publisher(endpoint);
    CHECK(!fcsl_tick_publisher_watched(publisher));
    fcsl_bus_t *bus = observe(endpoint);
    const uint64_t give_up_ns = later_ns();
    while (!fcsl_tick_publisher_watched(publisher) || !fcsl_tick_publisher_writes_watched(publisher)) {
        CHECK(fcsl_monotonic_ns() < give_up_ns);
    }
    meet(publisher, bus);
    check_ticks(publisher, bus);
    check_writes(publisher, bus);
    check_room_beside_writes(publisher);
    check_room(publisher);
    CHECK(counted(bus).wrong_size == 0 && counted(bus).deletions == 0);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
    fcsl_tick_publisher_close(publisher);
    fcsl_tick_publisher_close(NULL);
    return 0;
}
