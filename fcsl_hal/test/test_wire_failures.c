/* SPDX-License-Identifier: Apache-2.0
 *
 * Peers that fail: they are late, killed, built for something else, strangers, or send what is no message. Each failure ends with
 * a text that says what happened in which tick, or harms nobody.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <signal.h>

#include "wire_fixture.h"
#include "fcsl/fcsl_socket.h"

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
    fcsl_error_t text = {""};
    CHECK(fly(&MACHINE, 50, &text) == FCSL_HAL_ERROR);
    CHECK(strstr(text.text, "nobody listens") != NULL);
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
    fcsl_error_t text = {""};
    CHECK(fly(&MACHINE, WAIT_MS, &text) == FCSL_HAL_ERROR);
    CHECK(strstr(text.text, "went away before tick 10") != NULL);
    CHECK(waitpid(child, NULL, 0) == child);
    /* It could not unlink its socket: the next one replaces it. */
    CHECK(strncmp(spec, "unix:", 5) != 0 || access(path, F_OK) == 0);
    fcsl_external_close(listen_here());
}

static void test_killed_controller(void)
{
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_CLOSED, "");
    fcsl_external_t *external = listen_here();
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
    fcsl_error_t error;
    return strncmp(spec, "tcp:", 4) == 0 ? connect_tcp() : fcsl_socket_connect(path, SOCK_SEQPACKET, &error);
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

static void test_message_ahead_of_time(void)
{
    uint8_t message[MESSAGE_BYTES];
    fcsl_external_t *external = listen_here();
    const pid_t child =
        start_controller(&MACHINE, WAIT_MS, FCSL_HAL_ERROR, "sensor message of tick 9 came while tick 2 was due");
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    simulate(external, 0, 2);
    /* The controller may be gone before the time message follows. */
    const fcsl_hal_status_t sent = send_bytes(external, 9, message, sensor_message(9, message));
    CHECK(sent == FCSL_HAL_OK || sent == FCSL_HAL_CLOSED);
    join(child);
    fcsl_external_close(external);
}

/* Where a connection tells the simulator who is there. */
static void test_bad_controllers(void)
{
    test_killed_controller();
    test_mismatch_is_refused();
    test_stranger_is_ignored();
}

int main(void)
{
    CHECK(mkdtemp(folder) != NULL);
    use_unix();
    test_time_timeout_names_the_tick();
    test_actuator_timeout_names_the_tick();
    test_end_with_a_command_unread();
    test_no_controller();
    test_no_simulator();
    test_killed_simulator();
    test_bad_messages_are_dropped();
    test_message_ahead_of_time();
    test_bad_controllers();
    use_port("tcp:");
    test_bad_controllers();
    use_port("zenoh:tcp:");
    check_alone(test_killed_simulator);
    check_alone(test_killed_controller);
    CHECK(rmdir(folder) == 0);
    return 0;
}
