/* SPDX-License-Identifier: Apache-2.0
 *
 * wire_server.c, the simulator's end of the wire: a controller that sends anything. Input: packets, each of how (1), length
 * (1) and bytes; bit 0 of how puts head and checksum of an actuator frame right. The first one is the handshake.
 */
#include "wire_server.c"

#include "channel_fixture.h"
#include "fcsl/fcsl_scalar.h"
#include "fuzz.h"

static void repair(uint8_t *frame, size_t size, uint64_t tick)
{
    if (size < 28) {
        return;
    }
    memcpy(frame, "FCSF\1\0\1\0", 8);
    fcsl_put_u64(frame + 8, tick);
    fcsl_put_u32(frame + 16, fcsl_channel_table(&MACHINE).hash);
    fcsl_put_u16(frame + 22, 0);
    fcsl_put_u32(frame + size - 4, fcsl_crc32(0, frame, size - 4));
}

static void receive(fcsl_wire_t *wire, uint64_t *tick)
{
    fcsl_frame_t frame;
    fcsl_frame_t again;
    const fcsl_hal_status_t status = fcsl_wire_receive(wire, *tick, 0, &frame);
    if (status == FCSL_HAL_OK) {
        FUZZ_CHECK(fcsl_frame_check(&wire->table, FCSL_ACTUATOR, frame.bytes, frame.size, &again) == FCSL_FRAME_OK);
        FUZZ_CHECK(frame.size <= wire->inbox_size && frame.tick == *tick && again.tick == *tick);
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
    const size_t capacity = fcsl_frame_capacity(&MACHINE, FCSL_ACTUATOR);
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
