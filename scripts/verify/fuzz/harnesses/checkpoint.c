/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_run.h: checkpoints of the machines of all examples and of the fixture, and ticks from there. Input: which machine
 * (1), patches (number, then as fuzz.h says), then bytes that are added to the struct from its beginning. A checkpoint that
 * is refused changes nothing; from one that is taken the machine runs, and what it saves is taken again.
 */
#include "fcsl/fcsl_run.h"
#include "fuzz.h"

enum { TICKS = 8, MACHINES_MAX = 16, MESSAGE_BYTES = 1 << 16 };

extern const fcsl_machine_t *const fcsl_machines[];

static uint8_t *saved_copy(const fcsl_run_t *run, uint32_t size)
{
    fcsl_error_t error;
    uint8_t *copy = malloc(size);
    FUZZ_CHECK(copy != NULL && fcsl_run_save(run, copy, size, &error) == 0);
    return copy;
}

static void use(fcsl_run_t *run, const fcsl_machine_t *machine)
{
    static uint8_t message[MESSAGE_BYTES];
    fcsl_error_t error = {{0}};
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        FUZZ_CHECK(fcsl_run_message(run, i, message, sizeof message) > 0);
    }
    FUZZ_CHECK(fcsl_run_actuate(run, message, sizeof message) > 0);
    FUZZ_CHECK(fcsl_run_step(run, 1, &error) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint32_t machines = 0;
    while (machines < MACHINES_MAX && fcsl_machines[machines] != NULL) {
        machines++;
    }
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    const fcsl_machine_t *machine = fcsl_machines[take_number(&bytes, 1) % machines];
    fcsl_run_t *run = fcsl_run_open_machine(machine, NULL, &error);
    FUZZ_CHECK(run != NULL && fcsl_run_step(run, 2, &error) == 0);
    uint8_t *before = saved_copy(run, machine->size);
    uint8_t *image = saved_copy(run, machine->size);
    patch_words(&bytes, image, machine->size, (uint32_t)take_number(&bytes, 1) % 8u);
    for (uint32_t i = 0; i < machine->size && bytes.left > 0; i++) {
        image[i] = (uint8_t)(image[i] + take_number(&bytes, 1));
    }
    FUZZ_CHECK(fcsl_run_restore(run, image, machine->size - 1u, &error) != 0);
    if (fcsl_run_restore(run, image, machine->size, &error) == 0) {
        for (int i = 0; i < TICKS; i++) {
            use(run, machine);
        }
        uint8_t *after = saved_copy(run, machine->size);
        FUZZ_CHECK(fcsl_run_restore(run, after, machine->size, &error) == 0);
        free(after);
    } else {
        uint8_t *still = saved_copy(run, machine->size);
        FUZZ_CHECK(memcmp(before, still, machine->size) == 0);
        free(still);
    }
    free(before);
    free(image);
    FUZZ_CHECK(fcsl_run_close(run, &error) == 0);
    return 0;
}
