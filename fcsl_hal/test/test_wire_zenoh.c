/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire over the bus: messages of all keys arrive in their order, a second controller is refused, and each end learns when the
 * other one goes. (test_wire_lock_step.c flies over it.)
 */
#define _GNU_SOURCE
#include "bus_rig.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_wire.h"

enum { MESSAGE_MAX = 64, ROUNDS = 200, IN_A_ROUND = 6, SOON_MS = 500, TEXT_BYTES = 256 };

static int second_may_start[2]; /* a pipe */

static fcsl_wire_t open_wire(const char *endpoint, fcsl_wire_side_t side)
{
    char spec[96];
    fcsl_error_t error = {""};
    fcsl_wire_t wire;
    (void)snprintf(spec, sizeof spec, "zenoh:%s", endpoint);
    if (fcsl_wire_open(spec, side, MESSAGE_MAX, LONG_MS, &wire, &error) != 0) {
        (void)fprintf(stderr, "%s\n", error.text);
        exit(1);
    }
    return wire;
}

/* Message `number`: in turn it begins as sensors, time and a control packet do, and goes under their keys. It ends with its sum,
 * without which it would be none. */
static size_t fill(uint8_t *message, uint32_t number)
{
    static const uint8_t begins[3][2] = {{0x00, 0xff}, {0x02, 0xff}, {'F', 'C'}};
    const size_t size = 13u + number % 50u;
    memset(message, (int)(number & 0xffu), size);
    memcpy(message, begins[number % 3u], 2);
    memcpy(message + 2, &number, sizeof number);
    fcsl_put_u16(message + size - 7u, 0xFFFFu);
    message[size - 5u] = FCSL_U32;
    fcsl_put_u32(message + size - 4u, fcsl_crc32(0, message, size - 4u));
    return size;
}

static void receive_number(const fcsl_wire_t *wire, uint32_t number)
{
    uint8_t expected[MESSAGE_MAX];
    uint8_t got[MESSAGE_MAX];
    size_t size = 0;
    CHECK(wire->receive(wire->ctx, later_ns(), got, sizeof got, &size) == FCSL_WIRE_OK);
    CHECK(fill(expected, number) == size && memcmp(expected, got, size) == 0);
}

static void send_number(const fcsl_wire_t *wire, uint32_t number)
{
    uint8_t message[MESSAGE_MAX];
    const size_t size = fill(message, number);
    CHECK(wire->send(wire->ctx, message, size) == FCSL_WIRE_OK);
}

static void be_first_controller(const char *endpoint)
{
    const fcsl_wire_t wire = open_wire(endpoint, FCSL_WIRE_CONNECT);
    uint8_t got[MESSAGE_MAX];
    size_t size = 0;
    send_number(&wire, 0);
    for (uint32_t round = 0; round < ROUNDS; round++) {
        for (uint32_t i = 0; i < IN_A_ROUND; i++) {
            receive_number(&wire, round * IN_A_ROUND + i);
        }
        send_number(&wire, round);
    }
    receive_number(&wire, ROUNDS); /* sent just before the simulator ended */
    CHECK(wire.receive(wire.ctx, later_ns(), got, sizeof got, &size) == FCSL_WIRE_CLOSED);
    CHECK(wire.send(wire.ctx, got, 1) == FCSL_WIRE_CLOSED);
    CHECK(wire.receive(wire.ctx, 0, got, sizeof got, &size) == FCSL_WIRE_CLOSED);
    wire.close(wire.ctx);
}

static void be_second_controller(const char *endpoint)
{
    char spec[96];
    fcsl_error_t error = {""};
    char byte = 0;
    fcsl_wire_t wire;
    CHECK(read(second_may_start[0], &byte, 1) == 1);
    (void)snprintf(spec, sizeof spec, "zenoh:%s", endpoint);
    CHECK(fcsl_wire_open(spec, FCSL_WIRE_CONNECT, MESSAGE_MAX, SOON_MS, &wire, &error) != 0);
    if (strstr(error.text, "has another controller") == NULL) {
        (void)fprintf(stderr, "%s\n", error.text);
    }
    CHECK(strstr(error.text, "has another controller") != NULL);
}

static void test_a_flight(void)
{
    uint8_t message[MESSAGE_MAX + 1] = {0};
    const char *endpoint = free_endpoint();
    CHECK(pipe(second_may_start) == 0);
    const pid_t first = in_process(be_first_controller, endpoint);
    const pid_t second = in_process(be_second_controller, endpoint);
    const fcsl_wire_t wire = open_wire(endpoint, FCSL_WIRE_LISTEN);
    receive_number(&wire, 0);
    CHECK(write(second_may_start[1], "x", 1) == 1);
    for (uint32_t round = 0; round < ROUNDS; round++) {
        for (uint32_t i = 0; i < IN_A_ROUND; i++) {
            send_number(&wire, round * IN_A_ROUND + i);
        }
        receive_number(&wire, round);
    }
    check_success(second);
    CHECK(wire.send(wire.ctx, message, sizeof message) == FCSL_WIRE_ERROR);
    CHECK(strstr(wire.explain(wire.ctx), "65 bytes") != NULL);
    send_number(&wire, ROUNDS);
    wire.close(wire.ctx);
    check_success(first);
}

/* Who listens serves one controller after the other. */
static void be_brief(const char *endpoint)
{
    const fcsl_wire_t wire = open_wire(endpoint, FCSL_WIRE_CONNECT);
    send_number(&wire, 7);
    receive_number(&wire, 8);
    wire.close(wire.ctx);
}

/* It waits for the first one to end. */
static void be_brief_after_another(const char *endpoint)
{
    char byte = 0;
    CHECK(read(second_may_start[0], &byte, 1) == 1);
    be_brief(endpoint);
}

static void test_one_controller_after_the_other(void)
{
    uint8_t got[MESSAGE_MAX];
    size_t size = 0;
    fcsl_wire_status_t status = FCSL_WIRE_NONE;
    const char *endpoint = free_endpoint();
    CHECK(pipe(second_may_start) == 0);
    const pid_t first = in_process(be_brief, endpoint);
    const pid_t second = in_process(be_brief_after_another, endpoint);
    const fcsl_wire_t wire = open_wire(endpoint, FCSL_WIRE_LISTEN);
    receive_number(&wire, 7);
    CHECK(write(second_may_start[1], "x", 1) == 1);
    send_number(&wire, 8);
    check_success(first);
    do { /* that the first one has gone is told, unless the second one is there already */
        status = wire.receive(wire.ctx, later_ns(), got, sizeof got, &size);
    } while (status == FCSL_WIRE_CLOSED);
    CHECK(status == FCSL_WIRE_OK);
    send_number(&wire, 8);
    check_success(second);
    CHECK(wire.receive(wire.ctx, later_ns(), got, sizeof got, &size) == FCSL_WIRE_CLOSED);
    CHECK(wire.send(wire.ctx, got, 1) == FCSL_WIRE_CLOSED);
    CHECK(wire.receive(wire.ctx, 0, got, sizeof got, &size) == FCSL_WIRE_NONE);
    wire.close(wire.ctx);
}

int main(void)
{
    check_alone(test_a_flight);
    check_alone(test_one_controller_after_the_other);
    return 0;
}
