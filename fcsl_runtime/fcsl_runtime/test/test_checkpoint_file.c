/* SPDX-License-Identifier: Apache-2.0
 *
 * Checkpoint files in C: what was saved goes on, what is no checkpoint is refused. Argument: the fixture library.
 */
#define _GNU_SOURCE
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_mcap_writer.h"
#include "fcsl/fcsl_run.h"
#include "fcsl_check.h"

static fcsl_run_t *open_fixture(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = fcsl_run_open(library, NULL, NULL, &error);
    CHECK(run != NULL);
    return run;
}

/* Whether two runs have the same checkpoint. */
static int same(const fcsl_run_t *one, const fcsl_run_t *other)
{
    uint8_t *bytes[2] = {malloc(fcsl_run_checkpoint_capacity(one)), malloc(fcsl_run_checkpoint_capacity(other))};
    CHECK(bytes[0] != NULL && bytes[1] != NULL);
    const size_t size = fcsl_run_checkpoint(one, bytes[0]);
    const int found = size == fcsl_run_checkpoint(other, bytes[1]) && memcmp(bytes[0], bytes[1], size) == 0;
    free(bytes[0]);
    free(bytes[1]);
    return found;
}

static void test_full_of_hardware(fcsl_run_t *run)
{
    fcsl_error_t error;
    fcsl_hw_sim_t *hardware = fcsl_run_simulated_hardware(run);
    for (uint32_t i = 0; i < FCSL_HW_SIM_COUNT; i++) {
        hardware->gpio[i] = true;
        hardware->adc[i] = 1u + i;
        CHECK(fcsl_hw_sim_set_register(hardware, UINT32_MAX - 4u * i, 7u + i) == 0);
    }
    CHECK(fcsl_hw_sim_set_register(hardware, 0, 1) != 0);
    /* The longest there is, in memory of exactly its size. */
    uint8_t *room = malloc(fcsl_run_checkpoint_capacity(run));
    CHECK(room != NULL);
    const size_t size = fcsl_run_checkpoint(run, room);
    CHECK(size <= fcsl_run_checkpoint_capacity(run));
    memset(hardware, 0, sizeof *hardware);
    uint64_t tick = 0;
    CHECK(fcsl_run_checkpoint_tick(run, room, size, 0, &tick, &error) == 0 && tick == fcsl_run_tick(run));
    CHECK(fcsl_run_restore_checkpoint(run, room, size, 0, &error) == 0);
    CHECK(hardware->gpio[1023] && hardware->adc[1023] == 1024u && fcsl_hw_sim_register(hardware, 0) == 0);
    CHECK(fcsl_hw_sim_register(hardware, UINT32_MAX) == 7u &&
          fcsl_hw_sim_register(hardware, UINT32_MAX - 4u * 1023u) == 1030u);
    free(room);
}

/* Sizes that do not add up to the whole are damage, behind a right CRC, too. */
static void test_parts_of_other_sizes(fcsl_run_t *run)
{
    enum { AT_STRUCT_BYTES = 40, AT_ENTRIES = 44, AT_NAME_BYTES = 52 };
    static const size_t PARTS[] = {AT_STRUCT_BYTES, AT_ENTRIES, AT_NAME_BYTES};
    fcsl_error_t error;
    uint8_t *bytes = malloc(fcsl_run_checkpoint_capacity(run));
    CHECK(bytes != NULL);
    const size_t size = fcsl_run_checkpoint(run, bytes);
    for (size_t i = 0; i < sizeof PARTS / sizeof PARTS[0]; i++) {
        for (int change = -1; change <= 1; change++) {
            bytes[PARTS[i]] = (uint8_t)(bytes[PARTS[i]] + change);
            const uint32_t crc = fcsl_mcap_crc32(bytes, size - 4);
            for (unsigned k = 0; k < 4; k++) {
                bytes[size - 4 + k] = (uint8_t)(crc >> 8 * k);
            }
            const int failed = fcsl_run_restore_checkpoint(run, bytes, size, 0, &error);
            CHECK((failed != 0) == (change != 0));
            CHECK(change == 0 || strstr(error.text, "its parts have other sizes than the whole") != NULL);
            bytes[PARTS[i]] = (uint8_t)(bytes[PARTS[i]] - change);
        }
    }
    free(bytes);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    fcsl_error_t error;
    char folder[] = "/tmp/fcsl_checkpoint_XXXXXX";
    char path[64];
    CHECK(mkdtemp(folder) != NULL);
    (void)snprintf(path, sizeof path, "%s/checkpoint", folder);
    fcsl_run_t *steady = open_fixture(argv[1]);
    fcsl_run_t *second = open_fixture(argv[1]);
    fcsl_run_simulated_hardware(steady)->gpio[17] = true;
    CHECK(fcsl_run_step(steady, 7, &error) == 0 && fcsl_run_step(second, 3, &error) == 0);
    CHECK(!same(steady, second));
    CHECK(fcsl_run_save_file(steady, path, &error) == 0 && fcsl_run_restore_file(second, path, 0, &error) == 0);
    CHECK(same(steady, second) && fcsl_run_simulated_hardware(second)->gpio[17]);
    CHECK(fcsl_run_step(steady, 20, &error) == 0 && fcsl_run_step(second, 20, &error) == 0 && same(steady, second));
    CHECK(fcsl_run_restore_file(second, argv[1], 0, &error) != 0 && strstr(error.text, "not a checkpoint") != NULL);
    CHECK(fcsl_run_restore_file(second, folder, 0, &error) != 0 && strstr(error.text, "not a regular file") != NULL);
    CHECK(fcsl_run_save_file(second, "/proc/none/checkpoint", &error) != 0 && same(steady, second));
    test_parts_of_other_sizes(second);
    test_full_of_hardware(second);
    CHECK(fcsl_run_close(steady, &error) == 0 && fcsl_run_close(second, &error) == 0);
    CHECK(unlink(path) == 0 && rmdir(folder) == 0);
    return 0;
}
