/* SPDX-License-Identifier: Apache-2.0
 *
 * How fast the sender of telemetry is when its packets are waiting for it:
 *   telemetry LIBRARY ADDRESS FIELDS ROUNDS
 * Each round publishes some thousand ticks into a history that holds them all, and times the sender from its start until all are
 * sent. Prints JSON, with the times of all rounds.
 */
#include <fcsl/fcsl_telemetry.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { SLOTS = 4096, TICKS = SLOTS - 1 };

static fcsl_error_t error;

static void need(int holds)
{
    if (!holds) {
        (void)fprintf(stderr, "telemetry: %s\n", error.text);
        exit(1);
    }
}

static void publish(fcsl_run_t *run, fcsl_history_t *history)
{
    const fcsl_moment_t moment = {.tick = fcsl_run_tick(run)};
    fcsl_history_publish(history, &moment);
}

/* Nanoseconds that the sender takes for TICKS packets. */
static uint64_t send_all(fcsl_run_t *run, fcsl_history_t *history, const fcsl_telemetry_options_t *options,
                         const fcsl_vars_block_t *block, fcsl_telemetry_counters_t *counters)
{
    fcsl_telemetry_t *telemetry = fcsl_telemetry_open(options, block, 1, history, &error);
    need(telemetry != NULL);
    for (int i = 0; i < TICKS; i++) {
        need(fcsl_run_step(run, 1, &error) == 0);
        publish(run, history);
    }
    const uint64_t begun = fcsl_run_monotonic_ns(NULL);
    need(fcsl_telemetry_start(telemetry, &error) == 0);
    fcsl_telemetry_stop(telemetry);
    const uint64_t taken = fcsl_run_monotonic_ns(NULL) - begun;
    fcsl_telemetry_count(telemetry, counters);
    fcsl_telemetry_close(telemetry);
    return taken;
}

int main(int argc, char **argv)
{
    fcsl_history_t history;
    fcsl_telemetry_counters_t counters = {0};
    fcsl_run_t *run = argc == 5 ? fcsl_run_open(argv[1], NULL, NULL, &error) : NULL;
    need(run != NULL);
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    const fcsl_part_t part = {.data = fcsl_run_data(run), .size = machine->size};
    need(fcsl_history_open(&history, &part, 1, SLOTS) == 0);
    publish(run, &history);
    const fcsl_vars_block_t block = {
        .prefix = "", .fields = machine->fields, .field_count = machine->field_count, .machine = machine};
    const fcsl_telemetry_options_t options = {.address = argv[2], .fields = argv[3], .machine = machine};
    (void)printf("{\"ns\": [");
    for (long round = 0; round < strtol(argv[4], NULL, 10); round++) {
        (void)printf("%s%" PRIu64, round > 0 ? ", " : "", send_all(run, &history, &options, &block, &counters));
    }
    (void)printf("], \"packets\": %" PRIu64 ", \"overwritten\": %" PRIu64 ", \"datagrams\": %" PRIu64 "}\n",
                 counters.packets, counters.overwritten, counters.datagrams);
    fcsl_history_free(&history);
    return fcsl_run_close(run, &error) == 0 ? 0 : 1;
}
