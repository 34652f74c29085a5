/* SPDX-License-Identifier: Apache-2.0
 *
 * Control packets.
 */
#define _GNU_SOURCE
#include "handshake.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"

enum { VERSION = 1 };

static const uint8_t MAGIC[4] = {'F', 'C', 'S', 'W'};

int handshake_fits(uint64_t what, const uint8_t *bytes, size_t size)
{
    (void)what;
    return size >= HANDSHAKE_HEADER_BYTES && size <= HANDSHAKE_PACKET_MAX && memcmp(bytes, MAGIC, sizeof MAGIC) == 0 &&
           fcsl_get_u16(bytes + 4) == VERSION && bytes[6] >= HANDSHAKE_HELLO && bytes[6] <= HANDSHAKE_KEEP_ALIVE &&
           bytes[7] <= 1u;
}

int handshake_parse(const uint8_t *bytes, size_t size, handshake_packet_t *packet)
{
    if (!handshake_fits(0, bytes, size)) {
        return -1;
    }
    memset(packet, 0, sizeof *packet);
    packet->kind = (handshake_kind_t)bytes[6];
    packet->flag = bytes[7];
    packet->table_hash = fcsl_get_u32(bytes + 8);
    packet->tick_hz = fcsl_get_u64(bytes + 12);
    memcpy(packet->text, bytes + HANDSHAKE_HEADER_BYTES, size - HANDSHAKE_HEADER_BYTES);
    return 0;
}

static fcsl_wire_status_t send_packet(const fcsl_wire_t *wire, const handshake_packet_t *packet)
{
    uint8_t bytes[HANDSHAKE_PACKET_MAX] = {0};
    const size_t length = strnlen(packet->text, HANDSHAKE_TEXT_MAX);
    memcpy(bytes, MAGIC, sizeof MAGIC);
    fcsl_put_u16(bytes + 4, VERSION);
    bytes[6] = (uint8_t)packet->kind;
    bytes[7] = packet->flag != 0;
    fcsl_put_u32(bytes + 8, packet->table_hash);
    fcsl_put_u64(bytes + 12, packet->tick_hz);
    memcpy(bytes + HANDSHAKE_HEADER_BYTES, packet->text, length);
    return wire->send(wire->ctx, bytes, HANDSHAKE_HEADER_BYTES + length);
}

fcsl_wire_status_t handshake_send_hello(const fcsl_wire_t *wire, const fcsl_channel_table_t *table, int flag)
{
    const handshake_packet_t packet = {
        .kind = HANDSHAKE_HELLO, .flag = flag, .table_hash = table->hash, .tick_hz = table->machine->tick_hz};
    return send_packet(wire, &packet);
}

fcsl_wire_status_t handshake_send_refusal(const fcsl_wire_t *wire, const char *text)
{
    handshake_packet_t packet = {.kind = HANDSHAKE_REFUSAL};
    (void)snprintf(packet.text, sizeof packet.text, "%s", text);
    return send_packet(wire, &packet);
}

fcsl_wire_status_t handshake_send_end(const fcsl_wire_t *wire, int another_follows)
{
    const handshake_packet_t packet = {.kind = HANDSHAKE_END, .flag = another_follows};
    return send_packet(wire, &packet);
}

fcsl_wire_status_t handshake_send_leave(const fcsl_wire_t *wire)
{
    const handshake_packet_t packet = {.kind = HANDSHAKE_END, .table_hash = HANDSHAKE_LEAVES};
    return send_packet(wire, &packet);
}

fcsl_wire_status_t handshake_send_keep_alive(const fcsl_wire_t *wire)
{
    const handshake_packet_t packet = {.kind = HANDSHAKE_KEEP_ALIVE};
    return send_packet(wire, &packet);
}

int handshake_differs(const handshake_packet_t *hello, const fcsl_channel_table_t *table, char *text, size_t text_size)
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
