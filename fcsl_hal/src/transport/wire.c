/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens the wire that a text names.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_wire.h"
#include "fcsl/fcsl_error.h"

#include <stdlib.h>
#include <string.h>
#include <sys/un.h>

#include "fcsl/fcsl_monotonic.h"
#include "bus/bus_config.h"
#include "fcsl/fcsl_address.h"
#include "wire_link.h"
#include "wire_unix.h"
#include "wire_zenoh.h"

enum { DEVICE_BYTES = 256, BAUD_DIGITS = 7 };

typedef enum { KIND_UNIX, KIND_UDP, KIND_TCP, KIND_UART, KIND_ZENOH } kind_t;

static const char *const KINDS[] = {
    [KIND_UNIX] = "unix:", [KIND_UDP] = "udp:", [KIND_TCP] = "tcp:", [KIND_UART] = "uart:", [KIND_ZENOH] = "zenoh:"};

/* What a SPEC says. */
typedef struct {
    kind_t kind;
    const char *address; /* behind the kind: path, HOST:PORT, DEVICE:BAUD, tcp:HOST:PORT */
    char device[DEVICE_BYTES];
    uint32_t baud;
} parsed_t;

static int read_uart(const char *spec, parsed_t *parsed, fcsl_error_t *error)
{
    const char *colon = strrchr(parsed->address, ':');
    const size_t length = colon != NULL ? (size_t)(colon - parsed->address) : 0;
    const size_t digits = colon != NULL ? strspn(colon + 1, "0123456789") : 0;
    if (length == 0 || length >= sizeof parsed->device || digits == 0 || digits > BAUD_DIGITS ||
        colon[1 + digits] != '\0') {
        return fcsl_fail(error, "%s: write uart:DEVICE:BAUD, like uart:/dev/ttyUSB0:115200", spec);
    }
    memcpy(parsed->device, parsed->address, length);
    parsed->device[length] = '\0';
    parsed->baud = (uint32_t)strtoul(colon + 1, NULL, 10);
    if (!line_has_speed(parsed->baud)) {
        return fcsl_fail(error, "%s: no serial device has the speed %s; write one like 57600, 115200 or 921600", spec,
                         colon + 1);
    }
    return 0;
}

static int read_zenoh(const char *spec, const parsed_t *parsed, fcsl_error_t *error)
{
    struct sockaddr_storage address;
    socklen_t length = 0;
    if (fcsl_bus_endpoint_read(parsed->address, &address, &length) != 0) {
        return fcsl_fail(error, "%s: write zenoh:tcp:HOST:PORT in numbers, like zenoh:tcp:127.0.0.1:7447", spec);
    }
    return 0;
}

static int parse(const char *spec, parsed_t *parsed, fcsl_error_t *error)
{
    struct sockaddr_storage address;
    socklen_t length = 0;
    for (size_t i = 0; i < sizeof KINDS / sizeof KINDS[0]; i++) {
        const size_t prefix = strlen(KINDS[i]);
        if (strncmp(spec, KINDS[i], prefix) != 0 || spec[prefix] == '\0') {
            continue;
        }
        *parsed = (parsed_t){.kind = (kind_t)i, .address = spec + prefix};
        if (parsed->kind == KIND_UART) {
            return read_uart(spec, parsed, error);
        }
        if (parsed->kind == KIND_UNIX && strlen(parsed->address) >= sizeof((struct sockaddr_un *)0)->sun_path) {
            return fcsl_fail(error, "socket path '%s' is too long: 1 to %zu bytes are possible", parsed->address,
                             sizeof((struct sockaddr_un *)0)->sun_path - 1u);
        }
        if (parsed->kind == KIND_ZENOH) {
            return read_zenoh(spec, parsed, error);
        }
        if (parsed->kind != KIND_UNIX && fcsl_address_read(parsed->address, &address, &length) != 0) {
            return fcsl_fail(error, "%s: HOST:PORT must be numbers, like 127.0.0.1:7600", spec);
        }
        return 0;
    }
    return fcsl_fail(error, "a wire is " FCSL_WIRE_SPECS ", not '%s'", spec);
}

int fcsl_wire_check(const char *spec, fcsl_error_t *error)
{
    parsed_t parsed;
    return parse(spec, &parsed, error);
}

const fcsl_wire_counters_t *fcsl_wire_counters(const char *spec)
{
    const char *path = KINDS[KIND_UNIX];
    const char *zenoh = KINDS[KIND_ZENOH];
    if (strncmp(spec, zenoh, strlen(zenoh)) == 0) {
        return &fcsl_wire_zenoh_counters;
    }
    return strncmp(spec, path, strlen(path)) == 0 ? &fcsl_wire_unix_counters : &fcsl_wire_link_counters;
}

static int open_line(const parsed_t *parsed, fcsl_wire_side_t side, uint64_t deadline_ns, line_t *line,
                     fcsl_error_t *error)
{
    switch (parsed->kind) {
    case KIND_UDP:
        return line_open_udp(line, parsed->address, side, error);
    case KIND_TCP:
        return line_open_tcp(line, parsed->address, side, deadline_ns, error);
    default:
        return line_open_uart(line, parsed->device, parsed->baud, error);
    }
}

int fcsl_wire_open(const char *spec, fcsl_wire_side_t side, size_t message_max, uint32_t timeout_ms, fcsl_wire_t *wire,
                   fcsl_error_t *error)
{
    parsed_t parsed;
    line_t line;
    const uint64_t deadline_ns = fcsl_monotonic_ns() + (uint64_t)timeout_ms * FCSL_NS_PER_MS;
    if (parse(spec, &parsed, error) != 0) {
        return -1;
    }
    if (parsed.kind == KIND_UNIX) {
        return fcsl_wire_open_unix(parsed.address, side, message_max, deadline_ns, wire, error);
    }
    if (parsed.kind == KIND_ZENOH) {
        return fcsl_wire_open_zenoh(parsed.address, side, message_max, deadline_ns, wire, error);
    }
    if (open_line(&parsed, side, deadline_ns, &line, error) != 0) {
        return -1;
    }
    return fcsl_wire_over_link(&line, side, message_max, wire, error);
}

int fcsl_wire_pair(size_t message_max, fcsl_wire_t ends[2], fcsl_error_t *error)
{
    int fds[2] = {-1, -1};
    if (socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, fds) != 0) {
        return fcsl_fail(error, "cannot open a socket pair");
    }
    const line_t first = {.fd = fds[0], .listener = -1, .datagrams = 1};
    const line_t second = {.fd = fds[1], .listener = -1, .datagrams = 1};
    if (fcsl_wire_over_link(&first, FCSL_WIRE_LISTEN, message_max, &ends[0], error) != 0) {
        line_t owned = second;
        line_close(&owned);
        return -1;
    }
    if (fcsl_wire_over_link(&second, FCSL_WIRE_CONNECT, message_max, &ends[1], error) != 0) {
        ends[0].close(ends[0].ctx);
        return -1;
    }
    return 0;
}
