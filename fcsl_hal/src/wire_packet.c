/* SPDX-License-Identifier: Apache-2.0
 *
 * Control packets of the wire, and waiting with a deadline.
 */
#define _GNU_SOURCE
#include "wire_packet.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"

enum { VERSION = 1 };

static const uint8_t MAGIC[4] = {'F', 'C', 'S', 'W'};

int fcsl_wire_parse(const uint8_t *bytes, size_t size, fcsl_wire_packet_t *packet)
{
    if (size < FCSL_WIRE_HEADER_BYTES || size > FCSL_WIRE_PACKET_MAX || memcmp(bytes, MAGIC, sizeof MAGIC) != 0 ||
        fcsl_get_u16(bytes + 4) != VERSION || bytes[6] < FCSL_WIRE_HELLO || bytes[6] > FCSL_WIRE_END || bytes[7] != 0) {
        return -1;
    }
    memset(packet, 0, sizeof *packet);
    packet->kind = (fcsl_wire_kind_t)bytes[6];
    packet->table_hash = fcsl_get_u32(bytes + 8);
    packet->tick_hz = fcsl_get_u64(bytes + 12);
    memcpy(packet->text, bytes + FCSL_WIRE_HEADER_BYTES, size - FCSL_WIRE_HEADER_BYTES);
    return 0;
}

static int send_packet(int fd, fcsl_wire_kind_t kind, uint32_t table_hash, uint64_t tick_hz, const char *text)
{
    uint8_t bytes[FCSL_WIRE_PACKET_MAX] = {0};
    const size_t length = strnlen(text, FCSL_WIRE_TEXT_MAX);
    memcpy(bytes, MAGIC, sizeof MAGIC);
    fcsl_put_u16(bytes + 4, VERSION);
    bytes[6] = (uint8_t)kind;
    fcsl_put_u32(bytes + 8, table_hash);
    fcsl_put_u64(bytes + 12, tick_hz);
    memcpy(bytes + FCSL_WIRE_HEADER_BYTES, text, length);
    return send(fd, bytes, FCSL_WIRE_HEADER_BYTES + length, MSG_NOSIGNAL | MSG_DONTWAIT) < 0 ? -1 : 0;
}

int fcsl_wire_send_hello(int fd, const fcsl_channel_table_t *table)
{
    return send_packet(fd, FCSL_WIRE_HELLO, table->hash, table->machine->tick_hz, "");
}

int fcsl_wire_send_refusal(int fd, const char *text)
{
    return send_packet(fd, FCSL_WIRE_REFUSAL, 0, 0, text);
}

int fcsl_wire_send_end(int fd)
{
    return send_packet(fd, FCSL_WIRE_END, 0, 0, "");
}

int fcsl_wire_differs(const fcsl_wire_packet_t *hello, const fcsl_channel_table_t *table, char *text, size_t text_size)
{
    const fcsl_machine_t *machine = table->machine;
    if (hello->table_hash != table->hash) {
        (void)snprintf(text, text_size,
                       "the peers have different channel tables (%08" PRIx32 " and %08" PRIx32
                       "): both must load the same build of the machine",
                       hello->table_hash, table->hash);
        return 1;
    }
    if (hello->tick_hz != machine->tick_hz) {
        (void)snprintf(text, text_size, "the peers have different tick rates (%" PRIu64 " Hz and %" PRIu64 " Hz)",
                       hello->tick_hz, machine->tick_hz);
        return 1;
    }
    return 0;
}

uint64_t fcsl_wire_now_ms(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000u + (uint64_t)now.tv_nsec / 1000000u;
}

int fcsl_wire_wait_readable(int fd, uint64_t deadline_ms)
{
    const uint64_t now = fcsl_wire_now_ms();
    const uint64_t left = deadline_ms > now ? deadline_ms - now : 0;
    struct pollfd entry = {.fd = fd, .events = POLLIN};
    return poll(&entry, 1, left > INT_MAX ? INT_MAX : (int)left);
}

int fcsl_wire_size_buffers(int fd, size_t bytes)
{
    /* A packet must fit into the send buffer as a whole, with the kernel's own bookkeeping; two may be under way. */
    const size_t wanted = 2u * bytes + 4096u;
    int value = wanted > INT_MAX / 4 ? INT_MAX / 4 : (int)wanted;
    int have = 0;
    socklen_t length = sizeof have;
    if (getsockopt(fd, SOL_SOCKET, SO_SNDBUF, &have, &length) == 0 && have / 2 >= value) {
        return 0;
    }
    if (setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &value, sizeof value) != 0 ||
        getsockopt(fd, SOL_SOCKET, SO_SNDBUF, &have, &length) != 0) {
        return -1;
    }
    /* Linux reports twice what it grants. */
    if (have / 2 < value) {
        errno = EMSGSIZE;
        return -1;
    }
    return 0;
}
