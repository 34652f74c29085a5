/* SPDX-License-Identifier: Apache-2.0
 *
 * wire_server.c, the simulator's end of the wire: a controller that sends anything. Input: packets, each of how (1), length
 * (1) and bytes; bit 0 of how puts the reserved entries and the checksum of an actuator message right. The first one is the handshake.
 */
#include "wire_server.c"

#include "channel_fixture.h"
#include "fcsl/fcsl_scalar.h"
#include "fuzz.h"
#include "messages.h"

enum { HEAD_BYTES = 22, CRC_BYTES = 7, ROOM = 512 };

static void repair(uint8_t *bytes, size_t size, uint64_t tick)
{
    uint8_t right[ROOM];
    data_t data;
    memset(&data, 0, sizeof data);
    if (size < HEAD_BYTES + CRC_BYTES) {
        return;
    }
    const size_t made = encode_message(&MACHINE, &data, FCSL_ACTUATOR_MESSAGE, tick, NULL, right, sizeof right);
    memcpy(bytes, right, HEAD_BYTES);
    memcpy(bytes + size - CRC_BYTES, right + made - CRC_BYTES, CRC_BYTES);
    fcsl_put_u32(bytes + size - 4, fcsl_crc32(0, bytes, size - 4));
}

static void receive(fcsl_wire_t *wire, uint64_t *tick)
{
    fcsl_message_t message;
    fcsl_message_t again;
    const fcsl_hal_status_t status = fcsl_wire_receive(wire, *tick, 0, &message);
    if (status == FCSL_HAL_OK) {
        FUZZ_CHECK(fcsl_message_check(&wire->table, FCSL_ACTUATOR_MESSAGE, message.bytes, message.size, &again) ==
                   FCSL_MESSAGE_OK);
        FUZZ_CHECK(message.size <= wire->inbox_size && message.tick == *tick && again.tick == *tick);
        *tick += 1;
    } else {
        FUZZ_CHECK(fcsl_wire_explain(wire)[0] != '\0');
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    int pair[2];
    uint64_t tick = 0;
    int shaken = 0;
    FUZZ_CHECK(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair) == 0);
    fcsl_wire_t *wire = calloc(1, sizeof *wire);
    FUZZ_CHECK(wire != NULL);
    const size_t capacity = fcsl_message_capacity(&MACHINE, FCSL_ACTUATOR_MESSAGE);
    *wire = (fcsl_wire_t){.table = fcsl_channel_table(&MACHINE), .listener = -1, .peer = pair[0]};
    wire->inbox_size = capacity > FCSL_WIRE_PACKET_MAX ? capacity : FCSL_WIRE_PACKET_MAX;
    wire->inbox = malloc(wire->inbox_size);
    while (bytes.left > 0) {
        const uint64_t how = take_number(&bytes, 1);
        size_t length = (size_t)take_number(&bytes, 1);
        uint8_t *packet = take_copy(&bytes, &length);
        if ((how & 1u) != 0) {
            repair(packet, length, tick + (how >> 1) % 2u);
        }
        if (length > 0 && send(pair[1], packet, length, MSG_NOSIGNAL | MSG_DONTWAIT) == (ssize_t)length) {
            if (shaken) {
                receive(wire, &tick);
            } else {
                (void)shake_hands(wire, 0);
            }
            shaken = 1;
        }
        free(packet);
    }
    fcsl_wire_close(wire);
    (void)close(pair[1]);
    return 0;
}
