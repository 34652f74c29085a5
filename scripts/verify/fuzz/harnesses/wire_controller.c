/* SPDX-License-Identifier: Apache-2.0
 *
 * wire.c, the controller's end of the wire: packets from a simulator that sends anything. Input: operations (1 byte each,
 * some with an argument); packets are of any bytes, or messages of a tick near the one that is due with a right checksum.
 */
#include "wire.c"

#include "channel_fixture.h"
#include "fcsl/fcsl_scalar.h"
#include "fuzz.h"

enum { OP_RAW, OP_MESSAGE, OP_SAMPLE, OP_CONTROL, OP_COUNT };

/* One packet goes out at the peer's end and is taken in; a full set of slots is emptied first, as store_message would wait. */
static void exchange(wire_t *wire, int peer, uint64_t *tick, const uint8_t *packet, size_t size)
{
    uint8_t message[512];
    fcsl_message_t got;
    if (wire->used == SLOTS) {
        (void)wire_sample(wire, *tick + SLOTS, message, sizeof message, &got);
    }
    if (wire->used < SLOTS && size > 0 && send(peer, packet, size, MSG_NOSIGNAL | MSG_DONTWAIT) == (ssize_t)size) {
        (void)receive_packet(wire);
    }
}

static void send_message(wire_t *wire, int peer, uint64_t *tick, bytes_t *bytes)
{
    data_t data;
    uint8_t select[CHANNEL_COUNT];
    uint8_t message[512];
    memset(&data, 0, sizeof data);
    const uint64_t chosen = take_number(bytes, 2);
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        select[i] = (uint8_t)(chosen >> i & 1u);
    }
    const uint64_t at = *tick + take_number(bytes, 1) % 4u - 1u;
    fcsl_message_t made;
    FUZZ_CHECK(fcsl_message_encode_sensors(&wire->table, &data, at, select, message, sizeof message, &made) == 0);
    exchange(wire, peer, tick, message, made.size);
}

static void sample(wire_t *wire, uint64_t *tick, bytes_t *bytes)
{
    size_t capacity = (size_t)take_number(bytes, 1) * 2u;
    uint8_t *bytes_out = malloc(capacity);
    fcsl_message_t message;
    const fcsl_hal_status_t status = wire_sample(wire, *tick, bytes_out, capacity, &message);
    FUZZ_CHECK(status != FCSL_HAL_OK ||
               (message.bytes == bytes_out && message.size <= capacity && message.tick == *tick));
    FUZZ_CHECK(status == FCSL_HAL_OK || wire_explain(wire)[0] != '\0');
    *tick += status == FCSL_HAL_OK;
    free(bytes_out);
}

static void send_control(wire_t *wire, int peer, uint64_t *tick, bytes_t *bytes)
{
    uint8_t packet[FCSL_WIRE_PACKET_MAX] = {'F', 'C', 'S', 'W', 1, 0};
    packet[6] = (uint8_t)take_number(bytes, 1);
    fcsl_put_u32(packet + 8, fcsl_channel_table(&MACHINE).hash);
    fcsl_put_u64(packet + 12, MACHINE.tick_hz + take_number(bytes, 1) % 2u);
    const size_t size = 20u + (size_t)take_number(bytes, 1) % (FCSL_WIRE_TEXT_MAX + 1u);
    char error[512] = "";
    if (send(peer, packet, size, MSG_NOSIGNAL | MSG_DONTWAIT) == (ssize_t)size && *tick == 1) {
        (void)shake_hands(wire, 0, error, sizeof error);
    } else {
        (void)receive_packet(wire);
    }
}

static void open_end(wire_t *wire, int *peer)
{
    int pair[2];
    FUZZ_CHECK(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair) == 0);
    *peer = pair[1];
    *wire = (wire_t){.table = fcsl_channel_table(&MACHINE), .fd = pair[0], .stop = -1};
    const size_t capacity = fcsl_message_capacity(&MACHINE, FCSL_SENSOR_MESSAGE);
    wire->slot_bytes = capacity > FCSL_WIRE_PACKET_MAX ? capacity : FCSL_WIRE_PACKET_MAX;
    wire->inbox = malloc(wire->slot_bytes);
    for (uint32_t i = 0; i < SLOTS; i++) {
        wire->slots[i].bytes = malloc(wire->slot_bytes);
    }
    pthread_condattr_t attributes;
    FUZZ_CHECK(pthread_condattr_init(&attributes) == 0);
    FUZZ_CHECK(pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC) == 0);
    FUZZ_CHECK(pthread_cond_init(&wire->changed, &attributes) == 0 && pthread_mutex_init(&wire->lock, NULL) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    int peer = -1;
    uint64_t tick = 1;
    wire_t *wire = malloc(sizeof *wire);
    FUZZ_CHECK(wire != NULL);
    open_end(wire, &peer);
    while (bytes.left > 0) {
        const uint64_t op = take_number(&bytes, 1) % OP_COUNT;
        if (op == OP_RAW) {
            size_t length = (size_t)take_number(&bytes, 1) * 2u;
            uint8_t *packet = take_copy(&bytes, &length);
            exchange(wire, peer, &tick, packet, length);
            free(packet);
        } else if (op == OP_MESSAGE) {
            send_message(wire, peer, &tick, &bytes);
        } else if (op == OP_SAMPLE) {
            sample(wire, &tick, &bytes);
        } else {
            send_control(wire, peer, &tick, &bytes);
        }
    }
    (void)close(peer);
    free_wire(wire);
    return 0;
}
