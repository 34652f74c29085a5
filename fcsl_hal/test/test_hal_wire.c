/* SPDX-License-Identifier: Apache-2.0
 *
 * A controller and a simulator over every wire: lock-step, its end, and every way in which a peer can fail.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <pty.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "channel_fixture.h"
#include "messages.h"
#include "fcsl/fcsl_address.h"
#include "fcsl/fcsl_check.h"
#include "fcsl/fcsl_external.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_socket.h"

enum { MESSAGE_BYTES = 512, TEXT_BYTES = 512, TICKS = 5000, WAIT_MS = 5000 };

static char path[64];
static char spec[80]; /* of the simulator's end */
static char their_spec[80]; /* of the controller's */

static fcsl_external_t *listen_here(void)
{
    char error[TEXT_BYTES] = "";
    fcsl_external_t *external = NULL;
    CHECK(fcsl_external_open(spec, &MACHINE, &external, error, sizeof error) == 0);
    return external;
}

static uint64_t time_of(uint64_t tick)
{
    return 10000000u * tick;
}

static size_t sensor_message(uint64_t tick, uint8_t *message)
{
    data_t data;
    memset(&data, 0, sizeof data);
    data.i64 = (int64_t)tick * 3;
    data.packet[0] = 5; /* a full blob: the longest message */
    return encode_message(&MACHINE, &data, FCSL_SENSOR_MESSAGE, tick, NULL, message, MESSAGE_BYTES);
}

/* Steps a controller that answers 2 * i64 until the run ends; returns the last status. */
static fcsl_hal_status_t fly(const fcsl_machine_t *machine, uint32_t timeout_ms, char *text)
{
    fcsl_hal_t hal;
    data_t data;
    uint8_t bytes[MESSAGE_BYTES];
    const fcsl_channel_table_t table = fcsl_channel_table(machine);
    memset(&data, 0, sizeof data);
    CHECK(fcsl_hal_wire(their_spec, machine, timeout_ms, &hal, text, TEXT_BYTES) == 0);
    if (hal.open(&hal, text, TEXT_BYTES) != 0) {
        hal.close(hal.ctx);
        return FCSL_HAL_ERROR;
    }
    CHECK(hal.paces && hal.serves && hal.now_ns(hal.ctx) == 0);
    fcsl_hal_status_t status = FCSL_HAL_OK;
    for (uint64_t tick = 0; status == FCSL_HAL_OK; tick++) {
        fcsl_message_t message;
        status = hal.sample(hal.ctx, tick, bytes, sizeof bytes, &message);
        if (status == FCSL_HAL_OK) {
            CHECK(message.bytes == bytes && message.tick == tick && message.kind == FCSL_SENSOR_MESSAGE);
            CHECK(hal.now_ns(hal.ctx) == time_of(tick));
            fcsl_message_apply(machine, &data, &message);
            data.command[0] = 2.0 * (double)data.i64;
            CHECK(fcsl_message_encode_actuators(&table, &data, tick, 1, bytes, sizeof bytes, &message) == 0);
            status = hal.command(hal.ctx, &message);
        }
    }
    (void)snprintf(text, TEXT_BYTES, "%s", hal.explain(hal.ctx));
    hal.close(hal.ctx);
    return status;
}

/* Runs a controller in a process of its own that exits 0 when it ended with `status` and a text that contains `text`. */
static pid_t start_controller(const fcsl_machine_t *machine, uint32_t timeout_ms, fcsl_hal_status_t status,
                              const char *text)
{
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        char got[TEXT_BYTES] = "";
        const fcsl_hal_status_t ended = fly(machine, timeout_ms, got);
        if (ended != status || strstr(got, text) == NULL) {
            (void)fprintf(stderr, "the controller ended with %d: %s\n", (int)ended, got);
            _exit(1);
        }
        _exit(0);
    }
    return child;
}

static void join(pid_t child)
{
    int status = 0;
    CHECK(waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

/* Bytes of a tick as a sensor message, whatever they are. */
static fcsl_hal_status_t send_bytes(fcsl_external_t *external, uint64_t tick, const uint8_t *bytes, size_t size)
{
    const fcsl_message_t message = {.bytes = bytes, .size = size, .tick = tick, .kind = FCSL_SENSOR_MESSAGE};
    return fcsl_external_send(external, &message, time_of(tick));
}

/* The simulator's half of ticks [from, to). */
static void simulate(fcsl_external_t *external, uint64_t from, uint64_t to)
{
    uint8_t bytes[MESSAGE_BYTES];
    data_t data;
    for (uint64_t tick = from; tick < to; tick++) {
        const size_t size = sensor_message(tick, bytes);
        fcsl_message_t message;
        CHECK(send_bytes(external, tick, bytes, size) == FCSL_HAL_OK);
        CHECK(fcsl_external_receive(external, tick, WAIT_MS, &message) == FCSL_HAL_OK);
        CHECK(message.tick == tick && message.kind == FCSL_ACTUATOR_MESSAGE && message.armed == 1);
        fcsl_message_apply(&MACHINE, &data, &message);
        CHECK(data.command[0] == 6.0 * (double)tick);
    }
}

static void test_lock_step(const char *name, uint64_t ticks)
{
    struct timespec begun;
    struct timespec ended;
    char end[TEXT_BYTES];
    (void)snprintf(end, sizeof end, "ended the run at tick %llu", (unsigned long long)ticks);
    fcsl_external_t *external = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, end);
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    (void)clock_gettime(CLOCK_MONOTONIC, &begun);
    simulate(external, 0, ticks);
    (void)clock_gettime(CLOCK_MONOTONIC, &ended);
    CHECK(fcsl_external_messages_dropped(external) == 0);
    fcsl_external_close(external);
    join(child);
    const double seconds = (double)(ended.tv_sec - begun.tv_sec) + 1e-9 * (double)(ended.tv_nsec - begun.tv_nsec);
    (void)printf("lock-step over %s: %.0f ticks/s\n", name, (double)ticks / seconds);
}

/* ---- a serial line: two pseudo-terminals, and a process that carries bytes from one to the other --------------------- */

static void carry(int from, int to)
{
    char bytes[256];
    const ssize_t got = read(from, bytes, sizeof bytes);
    for (ssize_t at = 0; at < got;) {
        const ssize_t done = write(to, bytes + at, (size_t)(got - at));
        if (done <= 0) {
            _exit(0);
        }
        at += done;
    }
}

static pid_t open_line(char ours[64], char theirs[64])
{
    int a = -1;
    int b = -1;
    int ends[2];
    CHECK(openpty(&a, &ends[0], ours, NULL, NULL) == 0 && openpty(&b, &ends[1], theirs, NULL, NULL) == 0);
    const pid_t child = fork();
    CHECK(child >= 0);
    while (child == 0) {
        struct pollfd entries[2] = {{.fd = a, .events = POLLIN}, {.fd = b, .events = POLLIN}};
        if (poll(entries, 2, -1) < 0) {
            _exit(0);
        }
        if ((entries[0].revents & POLLIN) != 0) {
            carry(a, b);
        }
        if ((entries[1].revents & POLLIN) != 0) {
            carry(b, a);
        }
    }
    (void)close(a);
    (void)close(b);
    (void)close(ends[0]); /* the other process keeps the terminals */
    (void)close(ends[1]);
    return child;
}

static void test_serial_line(void)
{
    char error[TEXT_BYTES];
    char ours[64];
    char theirs[64];
    fcsl_external_t *second = NULL;
    const pid_t line = open_line(ours, theirs);
    (void)snprintf(spec, sizeof spec, "uart:%s:115200", ours);
    (void)snprintf(their_spec, sizeof their_spec, "uart:%s:115200", theirs);
    test_lock_step("uart", 300);
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_open(spec, &MACHINE, &second, error, sizeof error) != 0 && strstr(error, "in use") != NULL);
    fcsl_external_close(external);
    CHECK(kill(line, SIGKILL) == 0 && waitpid(line, NULL, 0) == line);
}

static void test_stranger_is_ignored(void);
static void test_mismatch_is_refused(void);
static void test_killed_controller(void);

static void test_every_wire(void)
{
    test_lock_step("unix", TICKS);
    CHECK(access(path, F_OK) != 0);
    const unsigned port = 20000u + (unsigned)getpid() % 20000u;
    (void)snprintf(spec, sizeof spec, "udp:127.0.0.1:%u", port);
    memcpy(their_spec, spec, sizeof spec);
    test_lock_step("udp", TICKS / 5);
    (void)snprintf(spec, sizeof spec, "tcp:127.0.0.1:%u", port);
    memcpy(their_spec, spec, sizeof spec);
    test_lock_step("tcp", TICKS / 5);
    test_stranger_is_ignored();
    test_mismatch_is_refused();
    test_killed_controller();
    test_serial_line();
    (void)snprintf(spec, sizeof spec, "unix:%s", path);
    memcpy(their_spec, spec, sizeof spec);
}

static void test_specs(void)
{
    static const struct {
        const char *spec;
        const char *error;
    } CASES[] = {
        {"/tmp/wire", "a wire is unix:PATH, udp:HOST:PORT"},
        {"unix:", "a wire is unix:PATH"},
        {"udp:host:7600", "HOST:PORT must be numbers"},
        {"tcp:127.0.0.1", "HOST:PORT must be numbers"},
        {"uart:/dev/ttyS0", "write uart:DEVICE:BAUD"},
        {"uart::115200", "write uart:DEVICE:BAUD"},
        {"uart:/dev/ttyS0:12345", "no serial device has the speed 12345"},
    };
    char error[TEXT_BYTES];
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        CHECK(fcsl_wire_check(CASES[i].spec, error, sizeof error) != 0 && strstr(error, CASES[i].error) != NULL);
    }
    CHECK(fcsl_wire_check("unix:w", error, sizeof error) == 0 && fcsl_wire_check("uart:/dev/x:115200", error, 1) == 0);
    CHECK(fcsl_wire_check("udp:[::1]:7600", error, sizeof error) == 0);
}

static void test_controller_may_start_first(void)
{
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 3");
    (void)usleep(100000);
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 3);
    fcsl_external_close(external);
    join(child);
}

static void test_time_timeout_names_the_tick(void)
{
    fcsl_external_t *external = listen_here();
    const pid_t child = start_controller(&MACHINE, 200, FCSL_HAL_TIMEOUT, "no time message of tick 17 within 200 ms");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 17);
    join(child);
    fcsl_message_t message;
    errno = EAGAIN; /* of some earlier call: it says nothing about this one */
    CHECK(fcsl_external_receive(external, 17, WAIT_MS, &message) == FCSL_HAL_CLOSED);
    CHECK(strstr(fcsl_external_explain(external), "tick 17") != NULL);
    fcsl_external_close(external);
}

static void test_actuator_timeout_names_the_tick(void)
{
    fcsl_external_t *external = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 4");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 4);
    fcsl_message_t message;
    CHECK(fcsl_external_receive(external, 4, 50, &message) == FCSL_HAL_TIMEOUT);
    CHECK(strstr(fcsl_external_explain(external), "no actuator message of tick 4 within 50 ms") != NULL);
    fcsl_external_close(external);
    join(child);
}

/* The simulator ends with a command unread: the system tells of that before what was sent last. */
static void test_end_with_a_command_unread(void)
{
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_external_t *external = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 1");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    CHECK(send_bytes(external, 0, bytes, sensor_message(0, bytes)) == FCSL_HAL_OK);
    (void)usleep(200000); /* so that it is there; without it this finds nothing, and passes */
    fcsl_external_close(external);
    join(child);
}

static void test_no_controller(void)
{
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_accept(external, 50) == FCSL_HAL_TIMEOUT);
    CHECK(strstr(fcsl_external_explain(external), "no controller") != NULL);
    fcsl_external_close(external);
}

static void test_no_simulator(void)
{
    char text[TEXT_BYTES] = "";
    CHECK(fly(&MACHINE, 50, text) == FCSL_HAL_ERROR);
    CHECK(strstr(text, "nobody listens") != NULL);
}

static void test_killed_simulator(void)
{
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        fcsl_external_t *external = listen_here();
        CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
        simulate(external, 0, 10);
        (void)kill(getpid(), SIGKILL);
    }
    char text[TEXT_BYTES] = "";
    CHECK(fly(&MACHINE, WAIT_MS, text) == FCSL_HAL_ERROR);
    CHECK(strstr(text, "went away before tick 10") != NULL);
    CHECK(waitpid(child, NULL, 0) == child);
    /* It could not unlink its socket: the next one replaces it. */
    CHECK(access(path, F_OK) == 0);
    fcsl_external_close(listen_here());
}

static void test_killed_controller(void)
{
    fcsl_external_t *external = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 10);
    (void)kill(child, SIGKILL);
    CHECK(waitpid(child, NULL, 0) == child);
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message;
    (void)send_bytes(external, 10, bytes, sensor_message(10, bytes)); /* TCP may not know yet */
    CHECK(fcsl_external_receive(external, 10, WAIT_MS, &message) == FCSL_HAL_CLOSED);
    CHECK(strstr(fcsl_external_explain(external), "actuator message of tick 10") != NULL);
    fcsl_external_close(external);
}

static void test_mismatch_is_refused(void)
{
    fcsl_channel_t channels[CHANNEL_COUNT];
    fcsl_machine_t other = MACHINE;
    memcpy(channels, CHANNELS, sizeof channels);
    channels[0].id = 901;
    other.channels = channels;
    fcsl_external_t *external = listen_here();
    pid_t child =
        start_controller(&other, WAIT_MS, FCSL_HAL_ERROR, "the simulator refused: the peers have different channel");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_ERROR);
    CHECK(strstr(fcsl_external_explain(external), "different channel tables") != NULL);
    join(child);
    other = MACHINE;
    other.tick_hz = 200;
    child = start_controller(&other, WAIT_MS, FCSL_HAL_ERROR, "different tick rates (200 Hz and 100 Hz)");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_ERROR);
    join(child);
    fcsl_external_close(external);
}

/* Someone who connects to the simulator's place. */
static int connect_stranger(void)
{
    char error[TEXT_BYTES];
    struct sockaddr_storage address;
    socklen_t length = 0;
    if (strncmp(spec, "tcp:", 4) != 0) {
        return fcsl_socket_connect(path, SOCK_SEQPACKET, error, sizeof error);
    }
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    CHECK(fcsl_address_read(spec + 4, &address, &length) == 0);
    CHECK(connect(fd, (const struct sockaddr *)&address, length) == 0);
    return fd;
}

/* Something that connects and talks nonsense, or says nothing, is no controller; the real one is still served. */
static void test_stranger_is_ignored(void)
{
    for (int speaks = 0; speaks < 2; speaks++) {
        fcsl_external_t *external = listen_here();
        const int stranger = connect_stranger();
        CHECK(stranger >= 0 && (!speaks || send(stranger, "hello", 5, 0) == 5));
        const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 2");
        CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
        simulate(external, 0, 2);
        fcsl_external_close(external);
        (void)close(stranger);
        join(child);
    }
}

static void test_bad_messages_are_dropped(void)
{
    uint8_t message[MESSAGE_BYTES];
    fcsl_external_t *external = listen_here();
    const pid_t child =
        start_controller(&MACHINE, 300, FCSL_HAL_TIMEOUT,
                         "no time message of tick 2 within 300 ms (6 malformed or late messages dropped)");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 2);
    size_t size = sensor_message(2, message);
    message[30] ^= 1u;
    CHECK(send_bytes(external, 1, message, size) == FCSL_HAL_OK);
    CHECK(send_bytes(external, 1, message, 3) == FCSL_HAL_OK);
    size = sensor_message(1, message);
    CHECK(send_bytes(external, 1, message, size) == FCSL_HAL_OK);
    join(child);
    fcsl_external_close(external);
}

/* A peer may send more than the channel table has: a blob of its own, as large as the buffers allow for. */
static void test_unknown_entries_are_taken(void)
{
    enum { CRC_BYTES = 7, UNKNOWN_ID = 77, BLOB = 0x40, HEAD = 5 };
    uint8_t message[MESSAGE_BYTES];
    data_t data;
    fcsl_message_t answer;
    fcsl_external_t *external = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 1");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    size_t size = sensor_message(0, message);
    uint8_t *entry = message + size - CRC_BYTES;
    memmove(entry + FCSL_UNKNOWN_BYTES, entry, CRC_BYTES);
    memset(entry, 0, FCSL_UNKNOWN_BYTES);
    fcsl_put_u16(entry, UNKNOWN_ID);
    entry[2] = BLOB;
    fcsl_put_u16(entry + 3, FCSL_UNKNOWN_BYTES - HEAD);
    size += FCSL_UNKNOWN_BYTES;
    CHECK(size == fcsl_message_capacity(&MACHINE, FCSL_SENSOR_MESSAGE) && size <= sizeof message);
    fcsl_put_u32(message + size - 4, fcsl_crc32(0, message, size - 4));
    CHECK(send_bytes(external, 0, message, size) == FCSL_HAL_OK);
    CHECK(fcsl_external_receive(external, 0, WAIT_MS, &answer) == FCSL_HAL_OK);
    fcsl_message_apply(&MACHINE, &data, &answer);
    CHECK(data.command[0] == 0.0);
    fcsl_external_close(external);
    join(child);
}

static void test_message_ahead_of_time(void)
{
    uint8_t message[MESSAGE_BYTES];
    fcsl_external_t *external = listen_here();
    const pid_t child =
        start_controller(&MACHINE, WAIT_MS, FCSL_HAL_ERROR, "sensor message of tick 9 came while tick 2 was due");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 2);
    CHECK(send_bytes(external, 9, message, sensor_message(9, message)) == FCSL_HAL_OK);
    join(child);
    fcsl_external_close(external);
}

/* A simulator that runs ahead of a controller that answers is served tick by tick, and nothing is lost. */
static void test_simulator_ahead(void)
{
    uint8_t message[MESSAGE_BYTES];
    fcsl_external_t *external = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 50");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    for (uint64_t tick = 0; tick < 50; tick++) {
        const size_t size = sensor_message(tick, message);
        CHECK(send_bytes(external, tick, message, size) == FCSL_HAL_OK);
    }
    fcsl_message_t answer;
    for (uint64_t tick = 0; tick < 50; tick++) {
        CHECK(fcsl_external_receive(external, tick, WAIT_MS, &answer) == FCSL_HAL_OK);
    }
    fcsl_external_close(external);
    join(child);
}

static void *interrupt_soon(void *argument)
{
    const fcsl_hal_t *hal = argument;
    (void)usleep(50000);
    hal->interrupt(hal->ctx);
    return NULL;
}

static void *accept_one(void *argument)
{
    return fcsl_external_accept(argument, WAIT_MS) == FCSL_HAL_OK ? argument : NULL;
}

static void test_interrupt(void)
{
    char error[TEXT_BYTES];
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message;
    fcsl_hal_t hal;
    pthread_t thread;
    void *accepted = NULL;
    fcsl_external_t *external = listen_here();
    CHECK(pthread_create(&thread, NULL, accept_one, external) == 0);
    CHECK(fcsl_hal_wire(their_spec, &MACHINE, WAIT_MS, &hal, error, sizeof error) == 0 &&
          hal.open(&hal, error, sizeof error) == 0);
    CHECK(pthread_join(thread, &accepted) == 0 && accepted == external);
    CHECK(pthread_create(&thread, NULL, interrupt_soon, &hal) == 0);
    CHECK(hal.sample(hal.ctx, 0, bytes, sizeof bytes, &message) == FCSL_HAL_CLOSED);
    CHECK(hal.sample(hal.ctx, 0, bytes, sizeof bytes, &message) == FCSL_HAL_CLOSED);
    CHECK(pthread_join(thread, NULL) == 0);
    hal.close(hal.ctx);
    fcsl_external_close(external);
}

static void test_socket_paths(void)
{
    char error[TEXT_BYTES] = "";
    char longer[300];
    struct stat status;
    fcsl_external_t *second = NULL;
    fcsl_external_t *external = listen_here();
    CHECK(stat(path, &status) == 0 && (status.st_mode & 0777) == 0600);
    CHECK(fcsl_external_open(spec, &MACHINE, &second, error, sizeof error) != 0);
    CHECK(strstr(error, "in use") != NULL && strstr(error, path) != NULL);
    CHECK(fcsl_socket_listen(path, SOCK_STREAM, 1, error, sizeof error) < 0 && strstr(error, "in use") != NULL);
    fcsl_external_close(external);

    /* A listener that takes nobody holds nobody for ever. */
    const int listener = fcsl_socket_listen(path, SOCK_STREAM, 1, error, sizeof error);
    CHECK(listener >= 0);
    int refused = 0;
    for (int i = 0; i < 8; i++) {
        const int fd = fcsl_socket_connect(path, SOCK_STREAM, error, sizeof error);
        refused += fd < 0;
        if (fd >= 0) {
            (void)close(fd);
        }
    }
    CHECK(refused > 0 && close(listener) == 0 && unlink(path) == 0);

    FILE *file = fopen(path, "w");
    CHECK(file != NULL && fclose(file) == 0);
    CHECK(fcsl_socket_listen(path, SOCK_STREAM, 1, error, sizeof error) < 0 && strstr(error, "not a socket") != NULL);
    CHECK(access(path, F_OK) == 0 && unlink(path) == 0);

    memset(longer, 'a', sizeof longer - 1);
    longer[sizeof longer - 1] = '\0';
    CHECK(fcsl_socket_listen(longer, SOCK_STREAM, 1, error, sizeof error) < 0 && strstr(error, "too long") != NULL);
    CHECK(fcsl_socket_listen("", SOCK_STREAM, 1, error, sizeof error) < 0 && strstr(error, "empty") != NULL);
    CHECK(fcsl_socket_listen("/nonexistent/folder/s", SOCK_STREAM, 1, error, sizeof error) < 0);
}

static void test_stub(void)
{
    uint8_t bytes[MESSAGE_BYTES] = {0};
    fcsl_message_t message = {.bytes = bytes, .size = 8};
    char line[FCSL_LOG_BYTES];
    char error[TEXT_BYTES];
    fcsl_hal_t hal;
    CHECK(fcsl_hal_stub(&hal, error, sizeof error) == 0 && hal.open(&hal, error, sizeof error) == 0);
    const uint64_t soon_ns = hal.now_ns(hal.ctx) + 1000000u;
    hal.wait(hal.ctx, soon_ns);
    CHECK(hal.now_ns(hal.ctx) >= soon_ns);
    CHECK(hal.arm(hal.ctx, 1) == FCSL_HAL_OK && hal.arm(hal.ctx, 0) == FCSL_HAL_OK);
    CHECK(!hal.read_log(hal.ctx, line));
    hal.log(hal.ctx, "armed");
    CHECK(hal.read_log(hal.ctx, line) && strcmp(line, "armed") == 0 && !hal.read_log(hal.ctx, line));
    CHECK(hal.sample(hal.ctx, 0, bytes, sizeof bytes, &message) == FCSL_HAL_NONE);
    CHECK(hal.command(hal.ctx, &message) == FCSL_HAL_OK);
    CHECK(!hal.paces && !hal.serves);
    hal.interrupt(hal.ctx);
    hal.close(hal.ctx);
}

int main(void)
{
    char folder[] = "/tmp/fcsl_wire_XXXXXX";
    CHECK(mkdtemp(folder) != NULL);
    (void)snprintf(path, sizeof path, "%s/wire", folder);
    (void)snprintf(spec, sizeof spec, "unix:%s", path);
    memcpy(their_spec, spec, sizeof spec);
    test_stub();
    test_socket_paths();
    test_specs();
    test_every_wire();
    test_controller_may_start_first();
    test_time_timeout_names_the_tick();
    test_actuator_timeout_names_the_tick();
    test_end_with_a_command_unread();
    test_no_controller();
    test_no_simulator();
    test_killed_simulator();
    test_killed_controller();
    test_mismatch_is_refused();
    test_stranger_is_ignored();
    test_bad_messages_are_dropped();
    test_unknown_entries_are_taken();
    test_message_ahead_of_time();
    test_simulator_ahead();
    test_interrupt();
    CHECK(rmdir(folder) == 0);
    return 0;
}
