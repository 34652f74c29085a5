/* SPDX-License-Identifier: Apache-2.0
 *
 * The sender of telemetry between a history and a socket of this process: which ticks it sends, what it counts, when it sends
 * the configuration, that its thread allocates nothing, and what it refuses. The bytes are test_fc_telemetry.py's.
 * Machine and fields are by hand, because fcslc makes no paths and fields as long as those that are refused.
 */
#define _GNU_SOURCE
#include <netinet/in.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define COUNTED_THREADS /* all of them */
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_telemetry.h"
#include "fcsl_allocations.h"
#include "fcsl_check.h"
#include "telemetry/resend.h"

enum { HEADER = 40, KIND = 5, DATAGRAM = 2048, MANY = 20000, BIG = 3 << 20, LONG_NAME = 70000 };

typedef struct {
    uint64_t number; /* ticks completed, as the machine's field has them */
} memory_t;

static const fcsl_field_t NUMBER = {.path = "machine.tick", .type = FCSL_U64, .count = 1, .size = 8, .unit = ""};
static const fcsl_machine_t MACHINE = {
    .abi_version = FCSL_ABI_VERSION, .name = "counter", .source_hash = "none", .tick_hz = 1000, .views = "seen"};
static const fcsl_vars_block_t BLOCK = {.prefix = "", .fields = &NUMBER, .field_count = 1, .machine = &MACHINE};

/* A host that publishes, a sender, and the socket that it sends to. */
typedef struct {
    memory_t memory;
    fcsl_history_t history;
    fcsl_telemetry_t *telemetry;
    int socket;
} rig_t;

static int open_socket(uint16_t *port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof address;
    const int bytes = 4 << 20;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    CHECK(fd >= 0 && bind(fd, (struct sockaddr *)&address, length) == 0);
    CHECK(setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes) == 0);
    CHECK(getsockname(fd, (struct sockaddr *)&address, &length) == 0);
    *port = ntohs(address.sin_port);
    return fd;
}

static void publish(rig_t *rig, uint64_t completed)
{
    const fcsl_moment_t moment = {.tick = completed};
    rig->memory.number = completed;
    fcsl_history_publish(&rig->history, &moment);
}

static void open_rig(rig_t *rig, uint32_t slots, uint32_t every)
{
    char address[64];
    uint16_t port = 0;
    fcsl_error_t error = {""};
    memset(rig, 0, sizeof *rig);
    const fcsl_part_t part = {.data = &rig->memory, .size = sizeof rig->memory};
    CHECK(fcsl_history_open(&rig->history, &part, 1, slots) == 0);
    publish(rig, 0);
    rig->socket = open_socket(&port);
    (void)snprintf(address, sizeof address, "udp:127.0.0.1:%u/%u", port, every);
    const fcsl_telemetry_options_t options = {.address = address, .machine = &MACHINE};
    rig->telemetry = fcsl_telemetry_open(&options, &BLOCK, 1, &rig->history, &error);
    CHECK(rig->telemetry != NULL);
}

static fcsl_telemetry_counters_t stop(rig_t *rig)
{
    fcsl_telemetry_counters_t counters;
    fcsl_telemetry_stop(rig->telemetry);
    fcsl_telemetry_count(rig->telemetry, &counters);
    return counters;
}

static void start(rig_t *rig)
{
    fcsl_error_t error = {""};
    CHECK(fcsl_telemetry_start(rig->telemetry, &error) == 0);
}

static void close_rig(rig_t *rig)
{
    fcsl_telemetry_close(rig->telemetry);
    fcsl_history_free(&rig->history);
    CHECK(close(rig->socket) == 0);
}

/* A data packet as it arrived. */
typedef struct {
    uint64_t sequence;
    uint64_t tick;
    uint64_t time_ns;
    uint64_t overwritten;
    uint64_t value;
} data_t;

/* The coming data packet, if one has arrived. */
static int receive(const rig_t *rig, data_t *data)
{
    uint8_t bytes[DATAGRAM];
    for (;;) {
        const ssize_t size = recv(rig->socket, bytes, sizeof bytes, 0);
        if (size < 0) {
            return 0;
        }
        CHECK(size >= HEADER);
        if (bytes[KIND] == 2) {
            CHECK(size == HEADER + 24 + 8);
            *data = (data_t){.sequence = fcsl_get_u64(bytes + 32),
                             .tick = fcsl_get_u64(bytes + HEADER),
                             .time_ns = fcsl_get_u64(bytes + HEADER + 8),
                             .overwritten = fcsl_get_u64(bytes + HEADER + 16),
                             .value = fcsl_get_u64(bytes + HEADER + 24)};
            return 1;
        }
    }
}

/* What the thread finds when it starts: `slots` say how much of it is still there. */
static void publish_then_start(uint32_t slots, uint32_t every, uint64_t packets, uint64_t overwritten, uint64_t first)
{
    rig_t rig;
    data_t data;
    open_rig(&rig, slots, every);
    for (uint64_t completed = 1; completed <= 100; completed++) {
        publish(&rig, completed);
    }
    start(&rig);
    const fcsl_telemetry_counters_t counters = stop(&rig);
    CHECK(counters.packets == packets && counters.overwritten == overwritten && counters.failures == 0);
    CHECK(counters.datagrams == counters.packets + counters.configurations);
    for (uint64_t i = 0; i < packets; i++) {
        CHECK(receive(&rig, &data));
        CHECK(data.sequence == i && data.tick == first + i * every && data.value == data.tick + 1u);
        CHECK(data.time_ns == data.tick * 1000000u && data.overwritten == overwritten);
    }
    CHECK(!receive(&rig, &data));
    close_rig(&rig);
}

static void test_ticks_in_order_and_what_was_overtaken(void)
{
    publish_then_start(128, 1, 100, 0, 0);
    publish_then_start(128, 10, 10, 0, 0);
    publish_then_start(128, 7, 15, 0, 0);
    publish_then_start(4, 1, 2, 98, 98);  /* it goes on in the middle of what is left */
    publish_then_start(4, 10, 0, 10, 0);  /* all that were due */
    publish_then_start(32, 10, 1, 9, 90); /* ticks 84 to 99 are left */
}

/* A command publishes its tick once more; a restore goes back, or jumps. */
static void test_commands_between_ticks(void)
{
    static const uint64_t completed[] = {0, 0, 1, 1, 1, 2, 50, 50, 10, 11};
    static const uint64_t ticks[] = {0, 1, 49, 9, 10};
    rig_t rig;
    data_t data;
    open_rig(&rig, 32, 1);
    for (size_t i = 0; i < sizeof completed / sizeof completed[0]; i++) {
        publish(&rig, completed[i]);
    }
    start(&rig);
    CHECK(stop(&rig).overwritten == 0);
    for (size_t i = 0; i < sizeof ticks / sizeof ticks[0]; i++) {
        CHECK(receive(&rig, &data) && data.sequence == i && data.tick == ticks[i]);
    }
    CHECK(!receive(&rig, &data));
    close_rig(&rig);
}

/* Ticks at full speed while the thread sends: every one is a packet or is counted, and the packets say which. The thread
 * allocates nothing. */
static void test_under_way(uint32_t slots)
{
    rig_t rig;
    data_t last = {0};
    data_t data;
    uint64_t received = 0;
    open_rig(&rig, slots, 1);
    start(&rig);
    struct pollfd configuration = {.fd = rig.socket, .events = POLLIN};
    CHECK(poll(&configuration, 1, -1) == 1); /* the thread is under way */
    counting = 1;
    for (uint64_t completed = 1; completed <= MANY; completed++) {
        publish(&rig, completed);
        while (receive(&rig, &data)) {
            CHECK(data.value == data.tick + 1u && (received == 0 || data.sequence > last.sequence));
            CHECK(data.tick == data.sequence + data.overwritten);
            last = data;
            received++;
        }
    }
    counting = 0;
    const fcsl_telemetry_counters_t counters = stop(&rig);
    CHECK(allocations == 0 && counters.packets + counters.overwritten == MANY && counters.packets > 0);
    close_rig(&rig);
}

/* Nobody listens: everything is sent, and what comes back is counted. */
static void test_nobody_listens(void)
{
    rig_t rig;
    open_rig(&rig, 128, 1);
    CHECK(close(rig.socket) == 0);
    for (uint64_t completed = 1; completed <= 100; completed++) {
        publish(&rig, completed);
    }
    start(&rig);
    const fcsl_telemetry_counters_t counters = stop(&rig);
    CHECK(counters.packets == 100 && counters.failures > 0 && counters.overwritten == 0);
    /* The one that learns that an earlier one came back goes out all the same. */
    CHECK(counters.datagrams == counters.packets + counters.configurations);
    rig.socket = dup(0);
    close_rig(&rig);
}

static void test_when_the_configuration_is_sent(void)
{
    const uint64_t second = 1000000000u;
    resend_t resend = fcsl_resend_begin(5);
    CHECK(!fcsl_resend_due(&resend, 0, 1, 5)); /* it was sent at the start */
    for (uint64_t sequence = 1; sequence < 5000; sequence++) {
        const int power = (sequence & (sequence - 1u)) == 0;
        CHECK(fcsl_resend_due(&resend, sequence, 1, 5 + sequence) == power);
        CHECK(!fcsl_resend_due(&resend, sequence, 0, 5 + sequence));
    }
    const uint64_t sent = resend.sent_ns;
    CHECK(sent == 5 + 4096);
    CHECK(!fcsl_resend_due(&resend, 5000, 1, sent + 10 * second - 1) &&
          fcsl_resend_due(&resend, 5000, 1, sent + 10 * second));
    CHECK(!fcsl_resend_due(&resend, 5000, 0, sent + 20 * second - 1) &&
          fcsl_resend_due(&resend, 5000, 0, sent + 20 * second));
    CHECK(fcsl_resend_due(&resend, 8192, 1,
                          sent + 21 * second)); /* the clock's sendings leave the others where they are */
}

/* A block with one field of `count` doubles at `path`. */
static int refused(const char *path, uint32_t count, const char *fields, const char *address, const char *reason)
{
    static double memory[BIG];
    fcsl_error_t error = {""};
    fcsl_history_t history;
    const fcsl_part_t part = {.data = memory, .size = count * 8u};
    const fcsl_moment_t moment = {.tick = 0};
    const fcsl_field_t field = {
        .path = path, .type = FCSL_F64, .rank = 1, .shape = &count, .count = count, .size = count * 8u, .unit = ""};
    const fcsl_vars_block_t block = {.prefix = "", .fields = &field, .field_count = 1, .machine = &MACHINE};
    const fcsl_telemetry_options_t options = {.address = address, .fields = fields, .machine = &MACHINE};
    CHECK(fcsl_history_open(&history, &part, 1, 2) == 0);
    fcsl_history_publish(&history, &moment);
    fcsl_telemetry_t *telemetry = fcsl_telemetry_open(&options, &block, 1, &history, &error);
    const int as_said = telemetry == NULL && strstr(error.text, reason) != NULL;
    fcsl_telemetry_close(telemetry);
    fcsl_history_free(&history);
    return as_said;
}

static void test_what_is_refused(void)
{
    static const char *const addresses[] = {"",
                                            "udp:",
                                            "udp:127.0.0.1",
                                            "udp:127.0.0.1:",
                                            "udp:127.0.0.1:0",
                                            "udp:127.0.0.1:65536",
                                            "udp:0.0.0.0:7600",
                                            "udp:[::]:7600",
                                            "udp:127.0.0.1:7600/",
                                            "udp:127.0.0.1:7600/0",
                                            "udp:127.0.0.1:7600/-1",
                                            "udp:127.0.0.1:7600/1x",
                                            "udp:127.0.0.1:7600/4294967296",
                                            "udp:example.org:7600",
                                            "udp::7600",
                                            "udp:[::1:7600",
                                            "tcp:127.0.0.1:7600",
                                            "127.0.0.1:7600"};
    static char name[LONG_NAME + 1];
    const char *here = "udp:127.0.0.1:7600";
    for (size_t i = 0; i < sizeof addresses / sizeof addresses[0]; i++) {
        CHECK(refused("a.b", 1, "*", addresses[i], "udp:HOST:PORT"));
    }
    memset(name, 'n', LONG_NAME);
    CHECK(refused("a.b", BIG, "*", here, "16 MiB"));
    CHECK(refused(name, 1, "*", here, "65535"));
    CHECK(refused("a.b", 1, "*.c", here, "no field matches '*.c'; a path is like 'a.b'"));
    CHECK(refused("a.b", 1, "", here, "chooses no field"));
    CHECK(refused("a.b", 1, NULL, here, "chooses no field"));
    CHECK(refused("a.b", 1, "*", "udp:255.255.255.255:7600", "broadcast"));
    CHECK(!refused("a.b", 1, "*", here, "") && !refused("a.b", BIG / 2, "a.b", "udp:localhost:7600/3", ""));
    const int six = socket(AF_INET6, SOCK_DGRAM, 0); /* not every computer has it */
    CHECK(six < 0 || (close(six) == 0 && !refused("a.b", 1, "*", "udp:[::1]:7600", "")));
}

int main(void)
{
    test_when_the_configuration_is_sent();
    test_ticks_in_order_and_what_was_overtaken();
    test_commands_between_ticks();
    test_under_way(2);
    test_under_way(64);
    test_nobody_listens();
    test_what_is_refused();
    return 0;
}
