/* SPDX-License-Identifier: Apache-2.0
 *
 * A controller and a simulator at the two ends of a wire: the controller, in a process of its own, answers twice the number that
 * it gets.
 */
#ifndef WIRE_FIXTURE_H
#define WIRE_FIXTURE_H

#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bus_rig.h"
#include "channel_fixture.h"
#include "fcsl/fcsl_address.h"
#include "fcsl/fcsl_external.h"
#include "fcsl_check.h"
#include "messages.h"

enum { MESSAGE_BYTES = 512, TEXT_BYTES = 512, WAIT_MS = 5000 };

static char folder[] = "/tmp/fcsl_wire_XXXXXX";
static char path[64]; /* of the Unix socket, in `folder` */
static char spec[80]; /* of the simulator's end */
static char their_spec[80]; /* of the controller's */
static int named; /* both are addresses of the bus, for named values */

/* Both ends on a Unix socket. */
static inline void use_unix(void)
{
    (void)snprintf(path, sizeof path, "%s/wire", folder);
    (void)snprintf(spec, sizeof spec, "unix:%s", path);
    memcpy(their_spec, spec, sizeof spec);
}

/* Both ends on a port of this computer, below those that the system gives to whoever asks for any. */
static inline void use_port(const char *prefix)
{
    (void)snprintf(spec, sizeof spec, "%s127.0.0.1:%u", prefix, 20000u + (unsigned)getpid() % 12000u);
    memcpy(their_spec, spec, sizeof spec);
}

/* A connection to the simulator's end, where `spec` begins with tcp:. */
static inline int connect_tcp(void)
{
    struct sockaddr_storage address;
    socklen_t length = 0;
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    CHECK(fd >= 0 && fcsl_address_read(spec + 4, &address, &length) == 0);
    CHECK(connect(fd, (const struct sockaddr *)&address, length) == 0);
    return fd;
}

static inline fcsl_external_t *listen_here(void)
{
    fcsl_error_t error = {""};
    fcsl_external_t *external = NULL;
    const int failed = named ? fcsl_external_open_bus(spec, "fleet", &MACHINE, &external, &error)
                             : fcsl_external_open(spec, &MACHINE, &external, &error);
    CHECK(!failed);
    return external;
}

static inline uint64_t time_of(uint64_t tick)
{
    return 10000000u * tick;
}

static inline size_t sensor_message(uint64_t tick, uint8_t *message)
{
    data_t data;
    memset(&data, 0, sizeof data);
    data.i64 = (int64_t)tick * 3;
    data.packet[0] = 5; /* a full blob: the longest message */
    return encode_message(&MACHINE, &data, FCSL_SENSOR_MESSAGE, tick, NULL, message, MESSAGE_BYTES);
}

/* What a HAL has delivered: the last message, with bytes of its own. */
typedef struct {
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t message;
    int count;
} delivered_t;

static inline void deliver(void *ctx, const fcsl_message_t *message)
{
    delivered_t *delivered = ctx;
    CHECK(message->size <= sizeof delivered->bytes);
    memcpy(delivered->bytes, message->bytes, message->size);
    delivered->message = *message;
    delivered->message.bytes = delivered->bytes;
    delivered->count++;
}

/* A sample, however long it takes. */
static inline fcsl_hal_status_t sample_patiently(const fcsl_hal_t *hal, uint64_t tick, delivered_t *delivered)
{
    const fcsl_sink_t to = {.ctx = delivered, .sensed = deliver};
    fcsl_hal_status_t status = FCSL_HAL_WAITING;
    delivered->count = 0;
    while (status == FCSL_HAL_WAITING) {
        status = hal->sample(hal->ctx, tick, &to);
    }
    return status;
}

/* Steps a controller that answers 2 * i64 until the run ends; returns the last status. */
static inline fcsl_hal_status_t fly(const fcsl_machine_t *machine, uint32_t timeout_ms, fcsl_error_t *said)
{
    fcsl_hal_t hal;
    data_t data;
    uint8_t bytes[MESSAGE_BYTES];
    const fcsl_channel_table_t table = fcsl_channel_table(machine);
    memset(&data, 0, sizeof data);
    const int failed = named ? fcsl_hal_bus(their_spec, "fleet", machine, timeout_ms, timeout_ms, &hal, said)
                             : fcsl_hal_wire(their_spec, machine, timeout_ms, timeout_ms, &hal, said);
    CHECK(!failed);
    if (hal.open(&hal, said) != 0) {
        hal.close(hal.ctx);
        return FCSL_HAL_ERROR;
    }
    CHECK(hal.paces && hal.serves && hal.clock.now_ns(hal.clock.ctx) == 0);
    fcsl_hal_status_t status = FCSL_HAL_OK;
    for (uint64_t tick = 0; status == FCSL_HAL_OK; tick++) {
        delivered_t delivered;
        fcsl_message_t message;
        status = sample_patiently(&hal, tick, &delivered);
        if (status == FCSL_HAL_OK) {
            message = delivered.message;
            CHECK(delivered.count == 1 && message.tick == tick && message.kind == FCSL_SENSOR_MESSAGE);
            CHECK(hal.clock.now_ns(hal.clock.ctx) == time_of(tick));
            fcsl_message_apply(machine, &data, &message);
            data.command[0] = 2.0 * (double)data.i64;
            CHECK(fcsl_message_encode_actuators(&table, &data, tick, 1, bytes, sizeof bytes, &message) == 0);
            status = hal.command(hal.ctx, &message);
        }
    }
    (void)fcsl_fail(said, "%s", hal.explain(hal.ctx));
    hal.close(hal.ctx);
    return status;
}

/* Runs a controller in a process of its own that exits 0 when it ended with `status` and a text that contains `text`. */
static inline pid_t start_controller(const fcsl_machine_t *machine, uint32_t timeout_ms, fcsl_hal_status_t status,
                                     const char *text)
{
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        fcsl_error_t got = {""};
        const fcsl_hal_status_t ended = fly(machine, timeout_ms, &got);
        if (ended != status || strstr(got.text, text) == NULL) {
            (void)fprintf(stderr, "the controller ended with %d: %s\n", (int)ended, got.text);
            _exit(1);
        }
        _exit(0);
    }
    return child;
}

static inline void join(pid_t child)
{
    int status = 0;
    CHECK(waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

/* Bytes of a tick as a sensor message, whatever they are. */
static inline fcsl_hal_status_t send_bytes(fcsl_external_t *external, uint64_t tick, const uint8_t *bytes, size_t size)
{
    const fcsl_message_t message = {.bytes = bytes, .size = size, .tick = tick, .kind = FCSL_SENSOR_MESSAGE};
    return fcsl_external_send(external, &message, time_of(tick));
}

/* The simulator's half of ticks [from, to). */
static inline void simulate(fcsl_external_t *external, uint64_t from, uint64_t to)
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

#endif /* WIRE_FIXTURE_H */
