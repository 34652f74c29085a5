/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire between two processes: lock-step, its end, and every way in which a peer can fail.
 */
#define _GNU_SOURCE
#include <errno.h>
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
#include "fcsl/fcsl_check.h"
#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_socket.h"
#include "fcsl/fcsl_wire.h"

enum { MESSAGE_BYTES = 512, TEXT_BYTES = 512, TICKS = 5000, WAIT_MS = 5000 };

static char path[64];

static fcsl_wire_t *listen_here(void)
{
    char error[TEXT_BYTES] = "";
    fcsl_wire_t *wire = NULL;
    CHECK(fcsl_wire_listen(path, &MACHINE, &wire, error, sizeof error) == 0);
    return wire;
}

static size_t sensor_message(uint64_t tick, uint8_t *message)
{
    data_t data;
    memset(&data, 0, sizeof data);
    data.i64 = (int64_t)tick * 3;
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
    if (fcsl_hal_wire_connect(path, machine, timeout_ms, &hal, text, TEXT_BYTES) != 0) {
        return FCSL_HAL_ERROR;
    }
    CHECK(hal.paces && hal.serves);
    fcsl_hal_status_t status = FCSL_HAL_OK;
    for (uint64_t tick = 0; status == FCSL_HAL_OK; tick++) {
        fcsl_message_t message;
        status = hal.sample(hal.ctx, tick, bytes, sizeof bytes, &message);
        if (status == FCSL_HAL_OK) {
            CHECK(message.bytes == bytes && message.tick == tick && message.kind == FCSL_SENSOR_MESSAGE);
            fcsl_message_apply(machine, &data, &message);
            data.command[0] = 2.0 * (double)data.i64;
            CHECK(fcsl_message_encode_actuators(&table, &data, tick, 1, bytes, sizeof bytes, &message) == 0);
            status = hal.actuate(hal.ctx, &message);
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

/* The simulator's half of ticks [from, to). */
static void simulate(fcsl_wire_t *wire, uint64_t from, uint64_t to)
{
    uint8_t bytes[MESSAGE_BYTES];
    data_t data;
    for (uint64_t tick = from; tick < to; tick++) {
        const size_t size = sensor_message(tick, bytes);
        fcsl_message_t message;
        CHECK(fcsl_wire_send(wire, bytes, size) == FCSL_HAL_OK);
        CHECK(fcsl_wire_receive(wire, tick, WAIT_MS, &message) == FCSL_HAL_OK);
        CHECK(message.tick == tick && message.kind == FCSL_ACTUATOR_MESSAGE && message.armed == 1);
        fcsl_message_apply(&MACHINE, &data, &message);
        CHECK(data.command[0] == 6.0 * (double)tick);
    }
}

static void test_lock_step(void)
{
    struct timespec begun;
    struct timespec ended;
    fcsl_wire_t *wire = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 5000");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    (void)clock_gettime(CLOCK_MONOTONIC, &begun);
    simulate(wire, 0, TICKS);
    (void)clock_gettime(CLOCK_MONOTONIC, &ended);
    fcsl_wire_close(wire);
    join(child);
    CHECK(access(path, F_OK) != 0);
    const double seconds = (double)(ended.tv_sec - begun.tv_sec) + 1e-9 * (double)(ended.tv_nsec - begun.tv_nsec);
    (void)printf("lock-step: %.0f ticks/s\n", TICKS / seconds);
}

static void test_controller_may_start_first(void)
{
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 3");
    (void)usleep(100000);
    fcsl_wire_t *wire = listen_here();
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    simulate(wire, 0, 3);
    fcsl_wire_close(wire);
    join(child);
}

static void test_sensor_timeout_names_the_tick(void)
{
    fcsl_wire_t *wire = listen_here();
    const pid_t child = start_controller(&MACHINE, 200, FCSL_HAL_TIMEOUT, "no sensor message of tick 17 within 200 ms");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    simulate(wire, 0, 17);
    join(child);
    fcsl_message_t message;
    errno = EAGAIN; /* of some earlier call: it says nothing about this one */
    CHECK(fcsl_wire_receive(wire, 17, WAIT_MS, &message) == FCSL_HAL_CLOSED);
    CHECK(strstr(fcsl_wire_explain(wire), "tick 17") != NULL);
    fcsl_wire_close(wire);
}

static void test_actuator_timeout_names_the_tick(void)
{
    fcsl_wire_t *wire = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 4");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    simulate(wire, 0, 4);
    fcsl_message_t message;
    CHECK(fcsl_wire_receive(wire, 4, 50, &message) == FCSL_HAL_TIMEOUT);
    CHECK(strstr(fcsl_wire_explain(wire), "no actuator message of tick 4 within 50 ms") != NULL);
    fcsl_wire_close(wire);
    join(child);
}

static void test_no_controller(void)
{
    fcsl_wire_t *wire = listen_here();
    CHECK(fcsl_wire_accept(wire, 50) == FCSL_HAL_TIMEOUT);
    CHECK(strstr(fcsl_wire_explain(wire), "no controller") != NULL);
    fcsl_wire_close(wire);
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
        fcsl_wire_t *wire = listen_here();
        CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
        simulate(wire, 0, 10);
        (void)kill(getpid(), SIGKILL);
    }
    char text[TEXT_BYTES] = "";
    CHECK(fly(&MACHINE, WAIT_MS, text) == FCSL_HAL_ERROR);
    CHECK(strstr(text, "went away before sensor message of tick 10") != NULL);
    CHECK(waitpid(child, NULL, 0) == child);
    /* It could not unlink its socket: the next one replaces it. */
    CHECK(access(path, F_OK) == 0);
    fcsl_wire_close(listen_here());
}

static void test_killed_controller(void)
{
    fcsl_wire_t *wire = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    simulate(wire, 0, 10);
    (void)kill(child, SIGKILL);
    CHECK(waitpid(child, NULL, 0) == child);
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message;
    CHECK(fcsl_wire_send(wire, bytes, sensor_message(10, bytes)) == FCSL_HAL_CLOSED);
    CHECK(fcsl_wire_receive(wire, 10, WAIT_MS, &message) == FCSL_HAL_CLOSED);
    CHECK(strstr(fcsl_wire_explain(wire), "actuator message of tick 10") != NULL);
    fcsl_wire_close(wire);
}

static void test_mismatch_is_refused(void)
{
    fcsl_channel_t channels[CHANNEL_COUNT];
    fcsl_machine_t other = MACHINE;
    memcpy(channels, CHANNELS, sizeof channels);
    channels[0].id = 901;
    other.channels = channels;
    fcsl_wire_t *wire = listen_here();
    pid_t child =
        start_controller(&other, WAIT_MS, FCSL_HAL_ERROR, "the simulator refused: the peers have different channel");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_ERROR);
    CHECK(strstr(fcsl_wire_explain(wire), "different channel tables") != NULL);
    join(child);
    other = MACHINE;
    other.tick_hz = 200;
    child = start_controller(&other, WAIT_MS, FCSL_HAL_ERROR, "different tick rates (200 Hz and 100 Hz)");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_ERROR);
    join(child);
    fcsl_wire_close(wire);
}

/* Something that connects and talks nonsense is no controller; the real one is still served. */
static void test_stranger_is_ignored(void)
{
    char error[TEXT_BYTES];
    fcsl_wire_t *wire = listen_here();
    const int stranger = fcsl_socket_connect(path, SOCK_SEQPACKET, error, sizeof error);
    CHECK(stranger >= 0 && send(stranger, "hello", 5, 0) == 5);
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 2");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    simulate(wire, 0, 2);
    fcsl_wire_close(wire);
    (void)close(stranger);
    join(child);
}

static void test_bad_messages_are_dropped(void)
{
    uint8_t message[MESSAGE_BYTES];
    fcsl_wire_t *wire = listen_here();
    const pid_t child =
        start_controller(&MACHINE, 300, FCSL_HAL_TIMEOUT,
                         "no sensor message of tick 2 within 300 ms (3 malformed or late messages dropped)");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    simulate(wire, 0, 2);
    size_t size = sensor_message(2, message);
    message[30] ^= 1u;
    CHECK(fcsl_wire_send(wire, message, size) == FCSL_HAL_OK);
    CHECK(fcsl_wire_send(wire, message, 3) == FCSL_HAL_OK);
    size = sensor_message(1, message);
    CHECK(fcsl_wire_send(wire, message, size) == FCSL_HAL_OK);
    join(child);
    fcsl_wire_close(wire);
}

/* A peer may send more than the channel table has: a blob of its own, as large as the buffers allow for. */
static void test_unknown_entries_are_taken(void)
{
    enum { CRC_BYTES = 7, UNKNOWN_ID = 77, BLOB = 0x40, HEAD = 5 };
    uint8_t message[MESSAGE_BYTES];
    data_t data;
    fcsl_message_t answer;
    fcsl_wire_t *wire = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 1");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
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
    CHECK(fcsl_wire_send(wire, message, size) == FCSL_HAL_OK);
    CHECK(fcsl_wire_receive(wire, 0, WAIT_MS, &answer) == FCSL_HAL_OK);
    fcsl_message_apply(&MACHINE, &data, &answer);
    CHECK(data.command[0] == 0.0);
    fcsl_wire_close(wire);
    join(child);
}

static void test_message_ahead_of_time(void)
{
    uint8_t message[MESSAGE_BYTES];
    fcsl_wire_t *wire = listen_here();
    const pid_t child =
        start_controller(&MACHINE, WAIT_MS, FCSL_HAL_ERROR, "sensor message of tick 9 came while tick 2 was due");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    simulate(wire, 0, 2);
    CHECK(fcsl_wire_send(wire, message, sensor_message(9, message)) == FCSL_HAL_OK);
    join(child);
    fcsl_wire_close(wire);
}

/* A simulator that runs ahead is held back by the slots and the socket's buffer, and nothing is lost. */
static void test_slots_are_bounded(void)
{
    uint8_t message[MESSAGE_BYTES];
    fcsl_wire_t *wire = listen_here();
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "ended the run at tick 50");
    CHECK(fcsl_wire_accept(wire, WAIT_MS) == FCSL_HAL_OK);
    for (uint64_t tick = 0; tick < 50; tick++) {
        const size_t size = sensor_message(tick, message);
        for (int tries = 0; fcsl_wire_send(wire, message, size) != FCSL_HAL_OK; tries++) {
            CHECK(tries < 1000);
            (void)usleep(1000);
        }
    }
    fcsl_message_t answer;
    for (uint64_t tick = 0; tick < 50; tick++) {
        CHECK(fcsl_wire_receive(wire, tick, WAIT_MS, &answer) == FCSL_HAL_OK);
    }
    fcsl_wire_close(wire);
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
    return fcsl_wire_accept(argument, WAIT_MS) == FCSL_HAL_OK ? argument : NULL;
}

static void test_interrupt(void)
{
    char error[TEXT_BYTES];
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message;
    fcsl_hal_t hal;
    pthread_t thread;
    void *accepted = NULL;
    fcsl_wire_t *wire = listen_here();
    CHECK(pthread_create(&thread, NULL, accept_one, wire) == 0);
    CHECK(fcsl_hal_wire_connect(path, &MACHINE, WAIT_MS, &hal, error, sizeof error) == 0);
    CHECK(pthread_join(thread, &accepted) == 0 && accepted == wire);
    CHECK(pthread_create(&thread, NULL, interrupt_soon, &hal) == 0);
    CHECK(hal.sample(hal.ctx, 0, bytes, sizeof bytes, &message) == FCSL_HAL_CLOSED);
    CHECK(hal.sample(hal.ctx, 0, bytes, sizeof bytes, &message) == FCSL_HAL_CLOSED);
    CHECK(pthread_join(thread, NULL) == 0);
    hal.close(hal.ctx);
    fcsl_wire_close(wire);
}

static void test_socket_paths(void)
{
    char error[TEXT_BYTES] = "";
    char longer[300];
    struct stat status;
    fcsl_wire_t *second = NULL;
    fcsl_wire_t *wire = listen_here();
    CHECK(stat(path, &status) == 0 && (status.st_mode & 0777) == 0600);
    CHECK(fcsl_wire_listen(path, &MACHINE, &second, error, sizeof error) != 0);
    CHECK(strstr(error, "in use") != NULL && strstr(error, path) != NULL);
    CHECK(fcsl_socket_listen(path, SOCK_STREAM, 1, error, sizeof error) < 0 && strstr(error, "in use") != NULL);
    fcsl_wire_close(wire);

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
    const fcsl_hal_t hal = fcsl_hal_stub();
    CHECK(hal.sample(hal.ctx, 0, bytes, sizeof bytes, &message) == FCSL_HAL_NONE);
    CHECK(hal.actuate(hal.ctx, &message) == FCSL_HAL_OK);
    CHECK(!hal.paces && !hal.serves);
    hal.interrupt(hal.ctx);
    hal.close(hal.ctx);
}

int main(void)
{
    char folder[] = "/tmp/fcsl_wire_XXXXXX";
    CHECK(mkdtemp(folder) != NULL);
    (void)snprintf(path, sizeof path, "%s/wire", folder);
    test_stub();
    test_socket_paths();
    test_lock_step();
    test_controller_may_start_first();
    test_sensor_timeout_names_the_tick();
    test_actuator_timeout_names_the_tick();
    test_no_controller();
    test_no_simulator();
    test_killed_simulator();
    test_killed_controller();
    test_mismatch_is_refused();
    test_stranger_is_ignored();
    test_bad_messages_are_dropped();
    test_unknown_entries_are_taken();
    test_message_ahead_of_time();
    test_slots_are_bounded();
    test_interrupt();
    CHECK(rmdir(folder) == 0);
    return 0;
}
