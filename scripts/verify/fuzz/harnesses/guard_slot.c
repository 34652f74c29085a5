/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_guard.h: what the guard takes from a slot that a mad flight program wrote. Input: the shared memory, twice: as it is
 * when the guard looks first, and later.
 */
#include "channel_fixture.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_guard.h"
#include "fuzz.h"

/* Puts the next bytes of the input into the slot. */
static void trample(fcsl_guard_server_t *server, bytes_t *bytes)
{
    size_t size = server->bytes;
    uint8_t *copy = take_copy(bytes, &size);
    if (size > 0) {
        memcpy((void *)server->slot, copy, size);
    }
    free(copy);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_guard_server_t server = {.bytes = fcsl_guard_slot_bytes(&MACHINE),
                                  .capacity = fcsl_message_capacity(&MACHINE, FCSL_ACTUATOR_MESSAGE)};
    server.slot = calloc(1, server.bytes);
    uint8_t *taken = malloc(server.capacity);
    FUZZ_CHECK(server.slot != NULL && taken != NULL);
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    data_t got;
    fcsl_gate_t gate = fcsl_gate(&MACHINE, &got);
    for (int i = 0; i < 2; i++) {
        trample(&server, &bytes);
        size_t length = 0;
        uint64_t time_ns = 0;
        if (fcsl_guard_take(&server, taken, &length, &time_ns) != 0) {
            fcsl_message_t message;
            FUZZ_CHECK(length <= server.capacity && server.taken % 2u == 0);
            FUZZ_CHECK(fcsl_guard_take(&server, taken, &length, &time_ns) == 0);
            if (fcsl_message_check(&table, FCSL_ACTUATOR_MESSAGE, taken, length, &message) == FCSL_MESSAGE_OK) {
                fcsl_gate_command(&gate, &message, time_ns, &got);
            }
        }
    }
    free((void *)server.slot);
    free(taken);
    return 0;
}
