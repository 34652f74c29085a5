/* SPDX-License-Identifier: Apache-2.0
 *
 * external.c, the simulator's end of a wire: a controller that sends anything. Input: a control packet, then messages, each of
 * how (1), length (1) and bytes; bit 0 of how puts the reserved entries and the checksum of an actuator message right.
 */
#include "external.c"

#include "channel_fixture.h"
#include "fcsl/fcsl_scalar.h"
#include "fake_wire.h"
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

static void take(fcsl_external_t *external, uint64_t *tick)
{
    fcsl_message_t message;
    fcsl_message_t again;
    const fcsl_hal_status_t status = fcsl_external_receive(external, *tick, 0, &message);
    if (status == FCSL_HAL_OK) {
        FUZZ_CHECK(fcsl_message_check(&external->table, FCSL_ACTUATOR_MESSAGE, message.bytes, message.size, &again) ==
                   FCSL_MESSAGE_OK);
        FUZZ_CHECK(message.size <= external->inbox_size && message.tick == *tick && again.tick == *tick);
        *tick += 1;
    } else {
        FUZZ_CHECK(fcsl_external_explain(external)[0] != '\0');
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {""};
    fake_wire_t fake = {0};
    uint64_t tick = 0;
    fcsl_external_t *external = NULL;
    const fcsl_wire_t wire = fake_wire(&fake);
    FUZZ_CHECK(fcsl_external_over_wire(&wire, &MACHINE, &external, &error) == 0);
    fake_put_control(&fake, &bytes, &external->table);
    FUZZ_CHECK(fcsl_external_accept(external, 0) == FCSL_HAL_OK || fcsl_external_explain(external)[0] != '\0');
    while (bytes.left > 0) {
        const uint64_t how = take_number(&bytes, 1);
        size_t length = (size_t)take_number(&bytes, 1);
        uint8_t *packet = take_copy(&bytes, &length);
        if ((how & 1u) != 0) {
            repair(packet, length, tick + (how >> 1) % 2u);
        }
        fake_put(&fake, packet, length);
        take(external, &tick);
        free(packet);
    }
    fcsl_external_close(external);
    return 0;
}
