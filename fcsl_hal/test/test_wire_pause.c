/* SPDX-License-Identifier: Apache-2.0
 *
 * An end that pauses for longer than the other one's patience, and a simulator that begins another run.
 */
#define _GNU_SOURCE
#include <time.h>

#include "wire_fixture.h"

enum { PATIENCE_MS = 1000, PAUSE_MS = 2500, LOOK_MS = 20 };

static void sleep_ms(long ms)
{
    const struct timespec pause = {.tv_nsec = ms * 1000000};
    CHECK(nanosleep(&pause, NULL) == 0);
}

static void test_a_simulator_that_pauses(void)
{
    const pid_t child = start_controller(&MACHINE, PATIENCE_MS, FCSL_HAL_CLOSED, "ended the run at tick 6");
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 3);
    for (int i = 0; i < PAUSE_MS / LOOK_MS; i++) {
        fcsl_external_keep_alive(external);
        sleep_ms(LOOK_MS);
    }
    simulate(external, 3, 6);
    fcsl_external_close(external);
    join(child);
}

static void test_a_simulator_that_begins_another_run(void)
{
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_AGAIN, "ended the run at tick 3");
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 3);
    fcsl_external_end(external, 1);
    fcsl_external_close(external);
    join(child);
}

/* Answers tick 0 after a pause. */
static int answer_late(void)
{
    fcsl_error_t error;
    delivered_t delivered;
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message;
    data_t data;
    fcsl_hal_t hal;
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    const int failed = named ? fcsl_hal_bus(their_spec, "fleet", &MACHINE, WAIT_MS, WAIT_MS, &hal, &error)
                             : fcsl_hal_wire(their_spec, &MACHINE, WAIT_MS, WAIT_MS, &hal, &error);
    CHECK(!failed && hal.open(&hal, &error) == 0);
    CHECK(sample_patiently(&hal, 0, &delivered) == FCSL_HAL_OK);
    for (int i = 0; i < PAUSE_MS / LOOK_MS; i++) {
        hal.alive(hal.ctx);
        sleep_ms(LOOK_MS);
    }
    memset(&data, 0, sizeof data);
    CHECK(fcsl_message_encode_actuators(&table, &data, 0, 1, bytes, sizeof bytes, &message) == FCSL_MESSAGE_OK);
    CHECK(hal.command(hal.ctx, &message) == FCSL_HAL_OK);
    CHECK(sample_patiently(&hal, 1, &delivered) == FCSL_HAL_CLOSED);
    hal.close(hal.ctx);
    return 0;
}

static void test_a_controller_that_pauses(void)
{
    uint8_t bytes[MESSAGE_BYTES];
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        _exit(answer_late());
    }
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    const fcsl_message_t sensors = {.bytes = bytes, .size = sensor_message(0, bytes), .tick = 0};
    fcsl_message_t answer;
    CHECK(fcsl_external_send(external, &sensors, time_of(0)) == FCSL_HAL_OK);
    CHECK(fcsl_external_receive(external, 0, PATIENCE_MS, &answer) == FCSL_HAL_OK);
    fcsl_external_close(external);
    join(child);
}

/* Each in a process of its own: a program that has a session of Zenoh must not fork. */
static void test_all(void)
{
    check_alone(test_a_simulator_that_pauses);
    check_alone(test_a_simulator_that_begins_another_run);
    check_alone(test_a_controller_that_pauses);
}

int main(void)
{
    CHECK(mkdtemp(folder) != NULL);
    use_unix();
    test_all();
    named = 1;
    use_port("zenoh:tcp:");
    test_all();
    CHECK(rmdir(folder) == 0);
    return 0;
}
