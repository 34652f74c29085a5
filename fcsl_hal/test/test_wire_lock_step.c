/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of a controller and a simulator over every wire, to their end: whoever starts first, runs ahead, sends more than the other
 * knows, or is interrupted.
 */
#define _GNU_SOURCE
#include <poll.h>
#include <pthread.h>
#include <pty.h>
#include <signal.h>

#include "wire_fixture.h"
#include "fcsl/fcsl_scalar.h"

enum { TICKS = 5000 };

static void test_lock_step(const char *name, uint64_t ticks)
{
    char end[TEXT_BYTES];
    (void)snprintf(end, sizeof end, "ended the run at tick %llu", (unsigned long long)ticks);
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, end);
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    const uint64_t begun_ns = fcsl_monotonic_ns();
    simulate(external, 0, ticks);
    const uint64_t ended_ns = fcsl_monotonic_ns();
    CHECK(fcsl_external_messages_dropped(external) == 0);
    fcsl_external_close(external);
    join(child);
    const double seconds = 1e-9 * (double)(ended_ns - begun_ns);
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
    char ours[64];
    char theirs[64];
    const pid_t line = open_line(ours, theirs);
    (void)snprintf(spec, sizeof spec, "uart:%s:115200", ours);
    (void)snprintf(their_spec, sizeof their_spec, "uart:%s:115200", theirs);
    test_lock_step("uart", 300);
    CHECK(kill(line, SIGKILL) == 0 && waitpid(line, NULL, 0) == line);
}

static void test_zenoh(void)
{
    test_lock_step("zenoh", TICKS / 5);
}

static void test_named_values(void)
{
    named = 1;
    test_lock_step("zenoh, named values", TICKS / 5);
}

static void test_every_wire(void)
{
    use_unix();
    test_lock_step("unix", TICKS);
    CHECK(access(path, F_OK) != 0);
    use_port("udp:");
    test_lock_step("udp", TICKS / 5);
    use_port("tcp:");
    test_lock_step("tcp", TICKS / 5);
    use_port("zenoh:tcp:");
    check_alone(test_zenoh);
    check_alone(test_named_values);
    test_serial_line();
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
    fcsl_error_t error;
    delivered_t delivered;
    fcsl_hal_t hal;
    pthread_t thread;
    void *accepted = NULL;
    fcsl_external_t *external = listen_here();
    CHECK(pthread_create(&thread, NULL, accept_one, external) == 0);
    CHECK(fcsl_hal_wire(their_spec, &MACHINE, WAIT_MS, WAIT_MS, &hal, &error) == 0 && hal.open(&hal, &error) == 0);
    CHECK(pthread_join(thread, &accepted) == 0 && accepted == external);
    CHECK(pthread_create(&thread, NULL, interrupt_soon, &hal) == 0);
    CHECK(sample_patiently(&hal, 0, &delivered) == FCSL_HAL_CLOSED);
    CHECK(sample_patiently(&hal, 0, &delivered) == FCSL_HAL_CLOSED);
    CHECK(pthread_join(thread, NULL) == 0);
    hal.close(hal.ctx);
    fcsl_external_close(external);
}

int main(void)
{
    CHECK(mkdtemp(folder) != NULL);
    test_every_wire();
    use_unix();
    test_controller_may_start_first();
    test_simulator_ahead();
    test_unknown_entries_are_taken();
    test_interrupt();
    CHECK(rmdir(folder) == 0);
    return 0;
}
