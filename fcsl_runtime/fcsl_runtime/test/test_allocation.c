/* SPDX-License-Identifier: Apache-2.0
 *
 * The step thread allocates nothing once it runs: not while stepping, writing, sensing, actuating or recording.
 * Argument: the fixture library.
 */
#define _GNU_SOURCE
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_run.h"
#include "fcsl_allocations.h"
#include "fcsl_check.h"

enum { TICKS = 5000, MESSAGE_BYTES = 256 };

/* One tick as a flight program makes it. */
static void fly_tick(fcsl_run_t *run, uint64_t tick)
{
    fcsl_error_t error;
    uint8_t message[MESSAGE_BYTES];
    uint8_t ros_message[MESSAGE_BYTES];
    fcsl_message_t encoded;
    const uint8_t armed = tick % 50 < 25;
    const int64_t count = tick % 97 == 0 ? -1 : 1;
    CHECK(fcsl_message_encode_sensors(fcsl_run_channels(run), fcsl_run_data(run), tick, NULL, message, sizeof message,
                                      &encoded) == 0);
    CHECK(fcsl_run_sense(run, message, encoded.size, &error) == 0);
    CHECK(fcsl_run_sense(run, message, encoded.size - 1, &error) != 0);
    CHECK(fcsl_run_sense_message(run, &encoded, &error) == 0);
    CHECK(fcsl_run_set(run, 5, 0, &armed, 1, &error) == 0);
    CHECK(fcsl_run_set(run, 6, 0, &count, 8, &error) == 0);
    if (tick % 300 == 0) {
        CHECK(fcsl_run_set_state(run, 0, &error) == 0 && fcsl_run_inject_overrun(run, 1, &error) == 0);
    }
    CHECK(fcsl_run_step(run, 1, &error) == 0);
    CHECK(fcsl_run_actuate(run, message, sizeof message) > 0 &&
          fcsl_run_message(run, 1, ros_message, sizeof ros_message) > 0);
}

static uint64_t count_allocations(const char *library, const char *bag, int lossless)
{
    fcsl_error_t error = {""};
    fcsl_run_t *run = fcsl_run_open(library, NULL, NULL, &error);
    CHECK(run != NULL && fcsl_run_attach(run, &error) == 0);
    fcsl_run_set_clock(run, fcsl_run_monotonic_ns, NULL);
    if (bag != NULL) {
        const fcsl_record_options_t options = {.bag = bag, .name_space = "", .lossless = lossless};
        CHECK(fcsl_run_record(run, &options, &error) == 0);
    }
    allocations = 0;
    counting = 1;
    for (uint64_t tick = 0; tick < TICKS; tick++) {
        fly_tick(run, tick);
    }
    counting = 0;
    CHECK(fcsl_run_close(run, &error) == 0);
    return allocations;
}

static void remove_bag(const char *bag)
{
    char path[256];
    (void)snprintf(path, sizeof path, "%s%s_0.mcap", bag, strrchr(bag, '/'));
    CHECK(unlink(path) == 0);
    (void)snprintf(path, sizeof path, "%s/metadata.yaml", bag);
    CHECK(unlink(path) == 0 && rmdir(bag) == 0);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    /* The counter works, and sees the libraries' allocations too. */
    counting = 1;
    void *volatile probe = strdup("seen");
    free(probe);
    counting = 0;
    CHECK(allocations == 2);

    char folder[] = "/tmp/fcsl_allocation_XXXXXX";
    char bag[64];
    CHECK(mkdtemp(folder) != NULL);
    (void)snprintf(bag, sizeof bag, "%s/bag", folder);
    CHECK(count_allocations(argv[1], NULL, 0) == 0);
    CHECK(count_allocations(argv[1], bag, 1) == 0);
    remove_bag(bag);
    CHECK(count_allocations(argv[1], bag, 0) == 0);
    remove_bag(bag);
    CHECK(rmdir(folder) == 0);
    return 0;
}
