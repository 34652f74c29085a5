/* SPDX-License-Identifier: Apache-2.0
 *
 * The connected UDP socket of the sender, which never waits.
 */
#define _GNU_SOURCE
#include "udp.h"

#include <errno.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_address.h"
#include "fcsl/fcsl_error.h"

enum { ADDRESS_BYTES = 96 };
static const char SCHEME[] = "udp:";

/* A port of a computer: not port 0, nor "any" address, which only who listens may give. */
static int is_one(const struct sockaddr_storage *address)
{
    if (address->ss_family == AF_INET6) {
        const struct sockaddr_in6 *six = (const struct sockaddr_in6 *)address;
        return six->sin6_port != 0 && !IN6_IS_ADDR_UNSPECIFIED(&six->sin6_addr);
    }
    const struct sockaddr_in *four = (const struct sockaddr_in *)address;
    return four->sin_port != 0 && four->sin_addr.s_addr != htonl(INADDR_ANY);
}

/* A whole number from 1 on, and nothing behind it; 0 when it is none. */
static uint32_t read_every(const char *text)
{
    char *end = NULL;
    errno = 0;
    const unsigned long long number = strtoull(text, &end, 10);
    return text[0] >= '1' && text[0] <= '9' && *end == '\0' && errno == 0 && number <= UINT32_MAX ? (uint32_t)number
                                                                                                  : 0u;
}

static int read_address(udp_t *udp, const char *text, fcsl_error_t *error)
{
    char address[ADDRESS_BYTES];
    const size_t scheme = sizeof SCHEME - 1;
    const char *slash = strchr(text, '/');
    const size_t length = slash != NULL ? (size_t)(slash - text) : strlen(text);
    udp->every = slash != NULL ? read_every(slash + 1) : 1u;
    if (udp->every > 0 && length < sizeof address && strncmp(text, SCHEME, scheme) == 0) {
        memcpy(address, text, length);
        address[length] = '\0';
        if (fcsl_address_read(address + scheme, &udp->address, &udp->length) == 0 && is_one(&udp->address)) {
            return 0;
        }
    }
    return fcsl_fail(error,
                     "telemetry cannot go to '%.128s': write udp:HOST:PORT, or udp:HOST:PORT/EVERY for every EVERY-th "
                     "tick, with a numeric address or localhost, such as udp:127.0.0.1:7600/10",
                     text);
}

static int try_connect(udp_t *udp)
{
    udp->connected = connect(udp->fd, (const struct sockaddr *)&udp->address, udp->length) == 0;
    return udp->connected;
}

int fcsl_udp_open(udp_t *udp, const char *address, fcsl_error_t *error)
{
    memset(udp, 0, sizeof *udp);
    udp->fd = -1;
    if (read_address(udp, address, error) != 0) {
        return -1;
    }
    udp->fd = socket(udp->address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (udp->fd >= 0 && (try_connect(udp) || errno == ENETUNREACH || errno == EHOSTUNREACH)) {
        return 0;
    }
    return fcsl_fail(error, "telemetry cannot go to '%.128s': %s", address,
                     errno == EACCES ? "it goes to one receiver, and this is a broadcast address" : strerror(errno));
}

void fcsl_udp_close(udp_t *udp)
{
    if (udp->fd >= 0) {
        (void)close(udp->fd);
    }
    udp->fd = -1;
}

static void count(_Atomic uint64_t *number)
{
    atomic_fetch_add_explicit(number, 1, memory_order_relaxed);
}

static int try_send(const udp_t *udp, const uint8_t *datagram, size_t size)
{
    return send(udp->fd, datagram, size, MSG_NOSIGNAL) == (ssize_t)size;
}

static void send_one(udp_t *udp, const uint8_t *datagram, size_t size)
{
    int sent = (udp->connected || try_connect(udp)) && try_send(udp, datagram, size);
    if (!sent && udp->connected && errno == ECONNREFUSED) {
        /* Nobody listened to one that was sent before; this one has not been tried yet. */
        count(&udp->failures);
        sent = try_send(udp, datagram, size);
    }
    count(sent ? &udp->datagrams : &udp->failures);
}

uint32_t fcsl_udp_send(udp_t *udp, const packet_t *packet, uint32_t offset, uint32_t most)
{
    uint8_t datagram[DATAGRAM_BYTES];
    for (uint32_t i = 0; i < most && offset < packet->total; i++) {
        const size_t size = fcsl_datagram_write(packet, offset, datagram);
        send_one(udp, datagram, size);
        offset += (uint32_t)(size - HEADER_BYTES);
    }
    return offset;
}
