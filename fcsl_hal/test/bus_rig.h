/* SPDX-License-Identifier: Apache-2.0
 *
 * For tests of the bus: sessions in processes of their own.
 */
#ifndef BUS_RIG_H
#define BUS_RIG_H

#include <arpa/inet.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl_check.h"

#ifdef __SANITIZE_ADDRESS__
/* Zenoh leaves some memory behind when a session ends. LeakSanitizer asks this. */
int __lsan_is_turned_off(void);

int __lsan_is_turned_off(void)
{
    return 1;
}
#endif

/* Long: the machine may be busy. */
enum { LONG_S = 90, LONG_MS = 90000, CLOSE_MS = 20000, RING_BYTES = 1 << 16 };

static inline uint64_t later_ns(void)
{
    return fcsl_monotonic_ns() + (uint64_t)LONG_S * FCSL_NS_PER_S;
}

/* A TCP socket bound to a free port of 127.0.0.1. */
static inline int bind_free_port(uint16_t *port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t length = sizeof address;
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    CHECK(fd >= 0 && bind(fd, (struct sockaddr *)&address, sizeof address) == 0);
    CHECK(getsockname(fd, (struct sockaddr *)&address, &length) == 0);
    *port = ntohs(address.sin_port);
    return fd;
}

static inline const char *endpoint_of(uint16_t port)
{
    static char text[64];
    (void)snprintf(text, sizeof text, "tcp:127.0.0.1:%u", port);
    return text;
}

static inline const char *free_endpoint(void)
{
    uint16_t port = 0;
    CHECK(close(bind_free_port(&port)) == 0);
    return endpoint_of(port);
}

static inline fcsl_bus_t *open_bus(const fcsl_bus_options_t *options)
{
    fcsl_bus_t *bus = NULL;
    fcsl_error_t error = {""};
    if (fcsl_bus_open(options, &bus, &error) != 0) {
        (void)fprintf(stderr, "%s\n", error.text);
        exit(1);
    }
    return bus;
}

static inline fcsl_bus_counters_t counted(const fcsl_bus_t *bus)
{
    fcsl_bus_counters_t counters;
    fcsl_bus_count(bus, &counters);
    return counters;
}

/* Waits until the condition holds; what it tells of changes by itself. */
#define WAIT_UNTIL(bus, condition)                                                                                     \
    for (const uint64_t give_up_ns = later_ns(); !(condition);) {                                                      \
        CHECK(fcsl_monotonic_ns() < give_up_ns);                                                                       \
        (void)fcsl_bus_wait(bus, fcsl_monotonic_ns() + 20000000u);                                                     \
    }

/* The next message of an input, which is `bytes` long. */
static inline void take_one(fcsl_bus_t *bus, uint32_t input, void *bytes, size_t bytes_size)
{
    size_t size = 0;
    const uint64_t give_up_ns = later_ns();
    while (!fcsl_bus_take(bus, input, bytes, &size)) {
        CHECK(fcsl_monotonic_ns() < give_up_ns);
        (void)fcsl_bus_wait(bus, give_up_ns);
    }
    CHECK(size == bytes_size);
}

/* Runs a function in a process of its own, which ends with it, or when this one ends. Call it before this process opens a session, whose threads a fork would not copy. */
static inline pid_t in_process(void (*run)(const char *endpoint), const char *endpoint)
{
    const pid_t process = fork();
    CHECK(process >= 0);
    if (process == 0) {
        CHECK(prctl(PR_SET_PDEATHSIG, SIGKILL) == 0); /* it does not outlive a test that fails */
        run(endpoint);
        exit(0);
    }
    return process;
}

static inline void check_success(pid_t process)
{
    int status = 0;
    CHECK(waitpid(process, &status, 0) == process && WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

/* A test in a process of its own, which may fork again. */
static inline void check_alone(void (*test)(void))
{
    const pid_t process = fork();
    CHECK(process >= 0);
    if (process == 0) {
        test();
        exit(0);
    }
    check_success(process);
}

#endif /* BUS_RIG_H */
