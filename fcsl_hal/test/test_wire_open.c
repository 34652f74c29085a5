/* SPDX-License-Identifier: Apache-2.0
 *
 * Opening a wire: its name, what stands in its place already, and the first bytes on a stream.
 */
#define _GNU_SOURCE
#include <netinet/in.h>
#include <poll.h>
#include <pty.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "wire_fixture.h"
#include "fcsl/fcsl_address.h"
#include "fcsl/fcsl_cobs.h"
#include "fcsl/fcsl_socket.h"
#include "fcsl/fcsl_wire.h"

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
        {"uart:/dev/ttyS0:", "write uart:DEVICE:BAUD"},
        {"uart:/dev/ttyS0:x", "write uart:DEVICE:BAUD"},
        {"uart:/dev/ttyS0:115200x", "write uart:DEVICE:BAUD"},
        {"uart:/dev/ttyS0:00115200", "write uart:DEVICE:BAUD"}, /* 8 digits */
        {"uart:/dev/ttyS0:4295082496", "write uart:DEVICE:BAUD"}, /* 2^32 + 115200 */
        {"uart:/dev/ttyS0:12345", "no serial device has the speed 12345"},
        {"zenoh:127.0.0.1:7447", "write zenoh:tcp:HOST:PORT in numbers"},
        {"zenoh:tcp:host:7447", "write zenoh:tcp:HOST:PORT in numbers"},
    };
    fcsl_error_t error;
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        CHECK(fcsl_wire_check(CASES[i].spec, &error) != 0 && strstr(error.text, CASES[i].error) != NULL);
    }
    CHECK(fcsl_wire_check("unix:w", &error) == 0 && fcsl_wire_check("uart:/dev/x:115200", NULL) == 0);
    CHECK(fcsl_wire_check("udp:[::1]:7600", &error) == 0);

    /* A device of 255 bytes has room. */
    char longest[5 + 256 + 8];
    for (size_t size = 255; size <= 256; size++) {
        memcpy(longest, "uart:", 5);
        memset(longest + 5, 'd', size);
        memcpy(longest + 5 + size, ":115200", 8);
        CHECK((fcsl_wire_check(longest, &error) == 0) == (size == 255));
    }
    CHECK(strstr(error.text, "write uart:DEVICE:BAUD") != NULL);
}

static void test_socket_paths(void)
{
    fcsl_error_t error = {""};
    char longer[300];
    struct stat status;
    fcsl_external_t *second = NULL;
    fcsl_external_t *external = listen_here();
    CHECK(stat(path, &status) == 0 && (status.st_mode & 0777) == 0600);
    CHECK(fcsl_external_open(spec, &MACHINE, &second, &error) != 0);
    CHECK(strstr(error.text, "in use") != NULL && strstr(error.text, path) != NULL);
    CHECK(fcsl_socket_listen(path, SOCK_STREAM, 1, &error) < 0 && strstr(error.text, "in use") != NULL);
    fcsl_external_close(external);

    /* A listener that takes nobody holds nobody for ever. */
    const int listener = fcsl_socket_listen(path, SOCK_STREAM, 1, &error);
    CHECK(listener >= 0);
    int refused = 0;
    for (int i = 0; i < 8; i++) {
        const int fd = fcsl_socket_connect(path, SOCK_STREAM, &error);
        refused += fd < 0;
        if (fd >= 0) {
            (void)close(fd);
        }
    }
    CHECK(refused > 0 && close(listener) == 0 && unlink(path) == 0);

    FILE *file = fopen(path, "w");
    CHECK(file != NULL && fclose(file) == 0);
    CHECK(fcsl_socket_listen(path, SOCK_STREAM, 1, &error) < 0 && strstr(error.text, "not a socket") != NULL);
    CHECK(access(path, F_OK) == 0 && unlink(path) == 0);

    memset(longer, 'a', sizeof longer - 1);
    longer[sizeof longer - 1] = '\0';
    CHECK(fcsl_socket_listen(longer, SOCK_STREAM, 1, &error) < 0 && strstr(error.text, "too long") != NULL);
    CHECK(fcsl_socket_listen("", SOCK_STREAM, 1, &error) < 0 && strstr(error.text, "empty") != NULL);
    CHECK(fcsl_socket_listen("/nonexistent/folder/s", SOCK_STREAM, 1, &error) < 0);
}

static void test_serial_device_in_use(void)
{
    int ends[2];
    char device[64];
    fcsl_error_t error = {""};
    fcsl_external_t *second = NULL;
    CHECK(openpty(&ends[0], &ends[1], device, NULL, NULL) == 0);
    (void)snprintf(spec, sizeof spec, "uart:%s:115200", device);
    fcsl_external_t *external = listen_here();
    CHECK(fcsl_external_open(spec, &MACHINE, &second, &error) != 0 && strstr(error.text, "in use") != NULL);
    fcsl_external_close(external);
    CHECK(close(ends[0]) == 0 && close(ends[1]) == 0);
}

/* ---- the first bytes on a stream ----------------------------------------------------------------------------------- */

/* A zero ends what was on the line before: to who has read some of that, the first frame comes whole. */
static void check_first_bytes(int fd)
{
    enum { HELLO = 0x10 }; /* version 1, kind 0 */
    fcsl_cobs_decoder_t decoder = {0};
    size_t size = 0;
    (void)fcsl_cobs_decode(&decoder, (const uint8_t[]){7, 1, 2}, 3, &size);
    for (size_t count = 0; size == 0; count++) {
        uint8_t byte = UINT8_MAX;
        struct pollfd entry = {.fd = fd, .events = POLLIN};
        CHECK(count <= FCSL_COBS_BYTES_MAX);
        CHECK(poll(&entry, 1, WAIT_MS) == 1 && read(fd, &byte, sizeof byte) == sizeof byte);
        CHECK(count > 0 || byte == 0);
        (void)fcsl_cobs_decode(&decoder, &byte, sizeof byte, &size);
    }
    CHECK(decoder.frame[0] == HELLO && decoder.garbage == 1);
}

static fcsl_wire_t open_wire(fcsl_wire_side_t side)
{
    fcsl_error_t error;
    fcsl_wire_t wire;
    CHECK(fcsl_wire_open(spec, side, MESSAGE_BYTES, WAIT_MS, &wire, &error) == 0);
    return wire;
}

static void test_tcp_begins_with_a_zero(void)
{
    const int on = 1;
    struct sockaddr_storage address;
    socklen_t length = 0;
    use_port("tcp:");
    fcsl_wire_t wire = open_wire(FCSL_WIRE_LISTEN);
    int peer = connect_tcp();
    check_first_bytes(peer);
    wire.close(wire.ctx);
    CHECK(close(peer) == 0);

    const int listener = socket(AF_INET, SOCK_STREAM, 0);
    CHECK(fcsl_address_read(spec + 4, &address, &length) == 0);
    CHECK(setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0);
    CHECK(bind(listener, (const struct sockaddr *)&address, length) == 0 && listen(listener, 1) == 0);
    wire = open_wire(FCSL_WIRE_CONNECT);
    peer = accept(listener, NULL, NULL);
    check_first_bytes(peer);
    wire.close(wire.ctx);
    CHECK(close(peer) == 0 && close(listener) == 0);
}

static void test_uart_begins_with_a_zero(void)
{
    static const fcsl_wire_side_t SIDES[] = {FCSL_WIRE_LISTEN, FCSL_WIRE_CONNECT};
    for (size_t i = 0; i < sizeof SIDES / sizeof SIDES[0]; i++) {
        int ends[2];
        char device[64];
        CHECK(openpty(&ends[0], &ends[1], device, NULL, NULL) == 0);
        (void)snprintf(spec, sizeof spec, "uart:%s:115200", device);
        const fcsl_wire_t wire = open_wire(SIDES[i]);
        check_first_bytes(ends[0]);
        wire.close(wire.ctx);
        CHECK(close(ends[0]) == 0 && close(ends[1]) == 0);
    }
}

/* ---- nobody takes what is sent ------------------------------------------------------------------------------------ */

/* A message is one, however many frames it has. */
static void test_four_messages_wait(void)
{
    static const uint8_t message[MESSAGE_BYTES];
    static const size_t SIZES[] = {1, MESSAGE_BYTES};
    use_port("tcp:");
    for (size_t i = 0; i < sizeof SIZES / sizeof SIZES[0]; i++) {
        const fcsl_wire_t wire = open_wire(FCSL_WIRE_LISTEN);
        for (int count = 0; count < 4; count++) {
            CHECK(wire.send(wire.ctx, message, SIZES[i]) == FCSL_WIRE_OK);
        }
        CHECK(wire.send(wire.ctx, message, SIZES[i]) == FCSL_WIRE_NONE);
        wire.close(wire.ctx);
    }
}

/* Without an answer the first frame is sent again at most every 2 ms, however long it waits. */
static void test_an_idle_line_is_quiet(void)
{
    use_port("tcp:");
    const fcsl_wire_t wire = open_wire(FCSL_WIRE_LISTEN);
    const int peer = connect_tcp();
    const uint64_t begun_ns = fcsl_monotonic_ns();
    uint64_t frames = 0;
    uint64_t waited_ns = 0;
    while (waited_ns < 100000000u) {
        uint8_t bytes[256];
        struct pollfd entry = {.fd = peer, .events = POLLIN};
        const ssize_t got = poll(&entry, 1, 10) == 1 ? read(peer, bytes, sizeof bytes) : 0;
        for (ssize_t i = 0; i < got; i++) {
            frames += bytes[i] == 0;
        }
        waited_ns = fcsl_monotonic_ns() - begun_ns;
    }
    CHECK(frames > 0 && frames < 4u + waited_ns / 2000000u);
    wire.close(wire.ctx);
    CHECK(close(peer) == 0);
}

int main(void)
{
    CHECK(mkdtemp(folder) != NULL);
    use_unix();
    test_specs();
    test_socket_paths();
    test_serial_device_in_use();
    test_tcp_begins_with_a_zero();
    test_uart_begins_with_a_zero();
    test_four_messages_wait();
    test_an_idle_line_is_quiet();
    CHECK(rmdir(folder) == 0);
    return 0;
}
