/* SPDX-License-Identifier: Apache-2.0
 *
 * When the watchdog reports, on times that the test chooses. The source is compiled in: it is part of fcsl-fc.
 */
#include "watchdog.c"

#include <string.h>

#include "fcsl_check.h"

int main(int argc, char **argv)
{
    watchdog_t off = {0};
    CHECK(!watchdog_finds(&off, 1000, UINT64_MAX));

    watchdog_t watchdog = {.limit_ns = 100};
    CHECK(!watchdog_finds(&watchdog, 0, 5000)); /* no step runs */
    CHECK(!watchdog_finds(&watchdog, 1000, 1099));
    CHECK(watchdog_finds(&watchdog, 1000, 1100));
    CHECK(!watchdog_finds(&watchdog, 1000, 90000)); /* once a step */
    CHECK(!watchdog_finds(&watchdog, 91000, 91050));
    CHECK(watchdog_finds(&watchdog, 91000, 91100));
    CHECK(!watchdog_finds(&watchdog, 92000, 91999)); /* a step that began behind the look */

    fcsl_error_t error;
    static loop_t loop;
    char text[256];
    CHECK(argc == 2);
    loop.run = fcsl_run_open(argv[1], NULL, NULL, &error);
    CHECK(loop.run != NULL);
    fcsl_tick_stats_put(&loop.stats.tick, 7);
    watchdog_describe(&loop, 5000000, text, sizeof text);
    CHECK(strcmp(text, "the step thread is between two ticks, behind tick 7") == 0);
    fcsl_tick_stats_put(&loop.stats.begun_ns, 2000000);
    watchdog_describe(&loop, 5000000, text, sizeof text);
    CHECK(strcmp(text, "tick 7 has run for 3 ms, now outside its instances") == 0);
    const int32_t pilot = 1;
    char expected[256];
    const fcsl_machine_t *machine = fcsl_run_machine(loop.run);
    (void)snprintf(expected, sizeof expected,
                   "tick 7 has run for 3 ms, now in instance 'pilot' (algorithms/pilot.py:%u)",
                   machine->instances[pilot].source_line);
    uint8_t *data = (uint8_t *)(uintptr_t)fcsl_run_data(loop.run);
    memcpy(data + machine->current_offset, &pilot, sizeof pilot);
    watchdog_describe(&loop, 5000000, text, sizeof text);
    CHECK(machine->instances[pilot].source_line > 1u && strcmp(text, expected) == 0);
    const int32_t impossible = 99;
    memcpy(data + machine->current_offset, &impossible, sizeof impossible);
    watchdog_describe(&loop, 5000000, text, sizeof text);
    CHECK(strcmp(text, "tick 7 has run for 3 ms, now outside its instances") == 0);
    CHECK(fcsl_run_close(loop.run, &error) == 0);
    return 0;
}
