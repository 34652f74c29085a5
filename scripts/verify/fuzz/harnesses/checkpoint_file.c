/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_run.h: the content of checkpoint files, for the machines of all examples and the fixture. Input: which machine (1);
 * how (1: bit 0 takes other sources, bit 1 lays the rest over a real checkpoint instead of reading it as it is, bit 2 makes
 * the CRC right); then bytes. Over a real one: the number of patches (1), patches as fuzz.h says, and then 16 bytes for each
 * entry of simulated hardware. What is refused changes nothing; from what is taken the machine runs, and what it saves is
 * taken again, the same.
 */
#include "fcsl/fcsl_run.h"
#include "fcsl/fcsl_scalar.h"
#include "fuzz.h"

enum { MACHINES_MAX = 16, CRC_BYTES = 4, AT_BYTES = 16, AT_ENTRIES = 44, ENTRY_BYTES = 16, PATCHED_BYTES = 512 };

extern const fcsl_machine_t *const fcsl_machines[];

/* The checkpoint of a run in memory of exactly its size. */
static uint8_t *saved(const fcsl_run_t *run, size_t *size)
{
    uint8_t *room = malloc(fcsl_run_checkpoint_capacity(run));
    FUZZ_CHECK(room != NULL);
    *size = fcsl_run_checkpoint(run, room);
    uint8_t *exact = realloc(room, *size);
    FUZZ_CHECK(exact != NULL);
    return exact;
}

/* A real checkpoint, patched, with hardware from the input. */
static uint8_t *altered(const fcsl_run_t *run, bytes_t *bytes, size_t *size)
{
    uint8_t *image = saved(run, size);
    patch_words(bytes, image, *size < PATCHED_BYTES ? *size : PATCHED_BYTES, (uint32_t)take_number(bytes, 1) % 4u);
    const size_t entries = bytes->left / ENTRY_BYTES;
    image = realloc(image, *size + entries * ENTRY_BYTES);
    FUZZ_CHECK(image != NULL);
    if (entries > 0) {
        memcpy(image + *size - CRC_BYTES, bytes->at, entries * ENTRY_BYTES);
        *size += entries * ENTRY_BYTES;
        fcsl_put_u64(image + AT_BYTES, *size);
        fcsl_put_u32(image + AT_ENTRIES, (uint32_t)entries);
    }
    return image;
}

static void expect_same(const fcsl_run_t *run, const uint8_t *before, size_t size)
{
    size_t still_size = 0;
    uint8_t *still = saved(run, &still_size);
    FUZZ_CHECK(still_size == size && memcmp(still, before, size) == 0);
    free(still);
}

static void go_on(fcsl_run_t *run)
{
    fcsl_error_t error;
    size_t size = 0;
    FUZZ_CHECK(fcsl_run_step(run, 2, &error) == 0);
    uint8_t *after = saved(run, &size);
    FUZZ_CHECK(fcsl_run_restore_checkpoint(run, after, size, 0, &error) == 0);
    expect_same(run, after, size);
    free(after);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint32_t machines = 0;
    while (machines < MACHINES_MAX && fcsl_machines[machines] != NULL) {
        machines++;
    }
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    const uint64_t number = take_number(&bytes, 1);
    const unsigned how = (unsigned)take_number(&bytes, 1);
    fcsl_run_t *run = fcsl_run_open_machine(fcsl_machines[number % machines], NULL, &error);
    FUZZ_CHECK(run != NULL && fcsl_run_step(run, 2, &error) == 0);
    size_t before_size = 0;
    uint8_t *before = saved(run, &before_size);
    size_t image_size = bytes.left;
    uint8_t *image = (how & 2u) != 0 ? altered(run, &bytes, &image_size) : take_copy(&bytes, &image_size);
    if ((how & 4u) != 0 && image_size >= CRC_BYTES) {
        fcsl_put_u32(image + image_size - CRC_BYTES, fcsl_crc32(0, image, image_size - CRC_BYTES));
    }
    uint64_t tick = 0;
    const int known = fcsl_run_checkpoint_tick(run, image, image_size, (int)(how & 1u), &tick, &error);
    if (fcsl_run_restore_checkpoint(run, image, image_size, (int)(how & 1u), &error) == 0) {
        FUZZ_CHECK(known == 0 && tick == fcsl_run_tick(run));
        go_on(run);
    } else {
        FUZZ_CHECK(error.text[0] != '\0');
        expect_same(run, before, before_size);
    }
    free(before);
    free(image);
    FUZZ_CHECK(fcsl_run_close(run, &error) == 0);
    return 0;
}
