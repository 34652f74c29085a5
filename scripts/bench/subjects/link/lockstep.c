/* SPDX-License-Identifier: Apache-2.0
 *
 * How fast a controller and a simulator go in lock-step over a wire, and how long a tick takes there and back. Beside it the same
 * number of bytes over two bare sockets of the same kind, without messages, link or threads: what the system itself takes.
 *
 *   lockstep SPEC THEIR_SPEC TICKS        prints JSON; a controller is forked
 *   lockstep bare unix|udp|tcp TICKS
 */
#include <arpa/inet.h>
#include <inttypes.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fcsl/fcsl_external.h"
#include "timing.h"

typedef struct {
    double gyro[3];
    double acceleration[3];
    double motors[4];
    int64_t stamp[2];
    uint32_t age[2];
    uint8_t fresh[2];
} data_t;

static const uint32_t THREE[] = {3};
static const uint32_t FOUR[] = {4};

#define FIELD(path_, member_, count_, shape_)                                                                          \
    {.path = path_,                                                                                                    \
     .type = FCSL_F64,                                                                                                 \
     .rank = 1,                                                                                                        \
     .shape = shape_,                                                                                                  \
     .count = count_,                                                                                                  \
     .offset = offsetof(data_t, member_),                                                                              \
     .size = 8u * (count_)}
#define SENSOR(name_, id_, field_, slot_)                                                                              \
    {.name = name_,                                                                                                    \
     .id = id_,                                                                                                        \
     .direction = FCSL_SENSOR,                                                                                         \
     .field = field_,                                                                                                  \
     .fresh_offset = offsetof(data_t, fresh) + (slot_),                                                                \
     .sample_age_offset = offsetof(data_t, age) + 4u * (slot_),                                                        \
     .stamp_offset = offsetof(data_t, stamp) + 8u * (slot_)}

static const fcsl_field_t FIELDS[] = {FIELD("gyro", gyro, 3, THREE), FIELD("acceleration", acceleration, 3, THREE),
                                      FIELD("motors", motors, 4, FOUR)};
static const fcsl_channel_t CHANNELS[] = {SENSOR("gyro", 1, 0, 0),
                                          SENSOR("acceleration", 2, 1, 1),
                                          {.name = "motors", .id = 16, .direction = FCSL_ACTUATOR, .field = 2}};
static const fcsl_machine_t MACHINE = {.name = "vehicle",
                                       .tick_hz = 1000,
                                       .size = sizeof(data_t),
                                       .fields = FIELDS,
                                       .field_count = 3,
                                       .channels = CHANNELS,
                                       .channel_count = 3,
                                       .arm_field = FCSL_NONE};

enum { ROOM = 1024, WAIT_MS = 30000, WARM_UP = 50 };

static void check(int holds, const char *what)
{
    if (!holds) {
        (void)fprintf(stderr, "lockstep: %s\n", what);
        _exit(1);
    }
}

static int by_value(const void *one, const void *other)
{
    const double a = *(const double *)one;
    const double b = *(const double *)other;
    return (a > b) - (a < b);
}

static void print(double *trips_ns, int ticks, double seconds)
{
    qsort(trips_ns, (size_t)ticks, sizeof *trips_ns, by_value);
    (void)printf("{\"ticks_per_s\": %.0f, \"p50_us\": %.2f, \"p99_us\": %.2f, \"max_us\": %.2f}\n", ticks / seconds,
                 trips_ns[ticks / 2] / 1e3, trips_ns[(int)(0.99 * ticks)] / 1e3, trips_ns[ticks - 1] / 1e3);
}

/* ---- over a wire --------------------------------------------------------------------------------------------------- */

static void sensed(void *ctx, const fcsl_message_t *message)
{
    fcsl_message_apply(&MACHINE, ctx, message);
}

static _Noreturn void control(const char *spec)
{
    fcsl_error_t error;
    uint8_t bytes[ROOM];
    fcsl_hal_t hal;
    data_t data = {0};
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    const fcsl_sink_t to = {.ctx = &data, .sensed = sensed};
    check(fcsl_hal_wire(spec, &MACHINE, WAIT_MS, WAIT_MS, &hal, &error) == 0, "no HAL");
    check(hal.open(&hal, &error) == 0, "the HAL does not open");
    for (uint64_t tick = 0;; tick++) {
        fcsl_message_t message;
        fcsl_hal_status_t status = FCSL_HAL_WAITING;
        while (status == FCSL_HAL_WAITING) {
            status = hal.sample(hal.ctx, tick, &to);
        }
        if (status != FCSL_HAL_OK) {
            break;
        }
        data.motors[0] = data.gyro[0];
        check(fcsl_message_encode_actuators(&table, &data, tick, 1, bytes, sizeof bytes, &message) == 0, "no command");
        check(hal.command(hal.ctx, &message) == FCSL_HAL_OK, "a command was not taken");
    }
    hal.close(hal.ctx);
    _exit(0);
}

static void over_wire(const char *spec, const char *theirs, int ticks, double *trips_ns)
{
    fcsl_error_t error;
    uint8_t bytes[ROOM];
    data_t data = {.gyro = {0.1, -0.2, 0.3}, .acceleration = {0.0, 0.1, -9.8}};
    fcsl_external_t *external = NULL;
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    const pid_t child = fork(); /* before there is a thread of a wire */
    if (child == 0) {
        control(theirs);
    }
    check(fcsl_external_open(spec, &MACHINE, &external, &error) == 0, error.text);
    check(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK, "no controller came");
    double begun = 0.0;
    for (int i = 0; i < WARM_UP + ticks; i++) {
        fcsl_message_t message;
        const double sent = now_ns();
        begun = i == WARM_UP ? sent : begun;
        check(fcsl_message_encode_sensors(&table, &data, (uint64_t)i, NULL, bytes, sizeof bytes, &message) == 0,
              "no message");
        check(fcsl_external_send(external, &message, (uint64_t)i) == FCSL_HAL_OK, "cannot send");
        check(fcsl_external_receive(external, (uint64_t)i, WAIT_MS, &message) == FCSL_HAL_OK, "no answer");
        trips_ns[i >= WARM_UP ? i - WARM_UP : 0] = now_ns() - sent;
    }
    const double seconds = (now_ns() - begun) / 1e9;
    fcsl_external_close(external);
    (void)waitpid(child, NULL, 0);
    print(trips_ns, ticks, seconds);
}

/* ---- over bare sockets --------------------------------------------------------------------------------------------- */

enum { THERE = 120, BACK = 70 }; /* bytes of sensors and time, and of a command */

static void open_pair(const char *kind, int ends[2])
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof address;
    const int on = 1;
    if (strcmp(kind, "unix") == 0) {
        check(socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends) == 0, "no sockets");
        return;
    }
    const int type = strcmp(kind, "udp") == 0 ? SOCK_DGRAM : SOCK_STREAM;
    const int first = socket(AF_INET, type, 0);
    ends[1] = socket(AF_INET, type, 0);
    check(bind(first, (struct sockaddr *)&address, length) == 0, "bind");
    check(getsockname(first, (struct sockaddr *)&address, &length) == 0, "name");
    check(type == SOCK_DGRAM || listen(first, 1) == 0, "listen");
    check(connect(ends[1], (struct sockaddr *)&address, length) == 0, "connect");
    if (type == SOCK_STREAM) {
        ends[0] = accept(first, NULL, NULL);
        check(setsockopt(ends[0], IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) == 0 &&
                  setsockopt(ends[1], IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) == 0,
              "no delay");
        return;
    }
    struct sockaddr_in other;
    length = sizeof other;
    check(getsockname(ends[1], (struct sockaddr *)&other, &length) == 0, "name");
    check(connect(first, (struct sockaddr *)&other, length) == 0, "connect");
    ends[0] = first;
}

static void bare(const char *kind, int ticks, double *trips_ns)
{
    int ends[2];
    uint8_t bytes[ROOM] = {0};
    open_pair(kind, ends);
    const pid_t child = fork();
    if (child == 0) {
        (void)close(ends[0]);
        while (recv(ends[1], bytes, THERE, MSG_WAITALL) == THERE && send(ends[1], bytes, BACK, 0) == BACK) {
        }
        _exit(0);
    }
    double begun = 0.0;
    for (int i = 0; i < WARM_UP + ticks; i++) {
        const double sent = now_ns();
        begun = i == WARM_UP ? sent : begun;
        check(send(ends[0], bytes, THERE, 0) == THERE, "send");
        check(recv(ends[0], bytes, BACK, MSG_WAITALL) == BACK, "receive");
        trips_ns[i >= WARM_UP ? i - WARM_UP : 0] = now_ns() - sent;
    }
    const double seconds = (now_ns() - begun) / 1e9;
    check(kill(child, SIGKILL) == 0, "kill");
    (void)waitpid(child, NULL, 0);
    print(trips_ns, ticks, seconds);
}

int main(int argc, char **argv)
{
    check(argc == 4, "usage: lockstep SPEC THEIR_SPEC TICKS, or lockstep bare KIND TICKS");
    const int ticks = atoi(argv[3]);
    double *trips_ns = allocate((size_t)(ticks + 1) * sizeof *trips_ns);
    if (strcmp(argv[1], "bare") == 0) {
        bare(argv[2], ticks, trips_ns);
    } else {
        over_wire(argv[1], argv[2], ticks, trips_ns);
    }
    free(trips_ns);
    return 0;
}
