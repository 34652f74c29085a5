/* SPDX-License-Identifier: Apache-2.0
 *
 * The variable server in one thread, around the fixture machine: what waits for the step thread is acted on at once.
 */
#ifndef VARS_HOST_H
#define VARS_HOST_H

#include "fuzz.h"
#include "vars/server.h"

enum { TICKS_PER_INPUT = 200, HISTORY_SLOTS = 8 };

extern const fcsl_machine_t *const fcsl_machines[];

typedef struct {
    fcsl_run_t *run;
    fcsl_history_t history;
    uint64_t paused;
    uint64_t ticks; /* that it may still make */
} hosted_t;

static hosted_t hosted;

static fcsl_vars_status_t hosted_restore(void *ctx, const void *data, uint32_t size, const fcsl_hw_sim_t *hardware,
                                         fcsl_error_t *error)
{
    (void)ctx;
    if (fcsl_run_restore(hosted.run, data, size, error) != 0) {
        return FCSL_VARS_REFUSED;
    }
    *fcsl_run_simulated_hardware(hosted.run) = *hardware;
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t hosted_pause(void *ctx, int paused, fcsl_error_t *error)
{
    (void)ctx;
    (void)error;
    hosted.paused = (uint64_t)paused;
    return FCSL_VARS_OK;
}

static void hosted_publish(void *ctx)
{
    (void)ctx;
    const fcsl_moment_t moment = {.tick = fcsl_run_tick(hosted.run), .paused = hosted.paused};
    fcsl_history_publish(&hosted.history, &moment);
}

static fcsl_vars_status_t hosted_tick(void *ctx, uint64_t count, fcsl_error_t *error)
{
    for (uint64_t i = 0; i < count; i++) {
        if (!hosted.paused) {
            return FCSL_VARS_NOT_PAUSED;
        }
        if (hosted.ticks == 0) {
            (void)fcsl_fail(error, "the run has ended");
            return FCSL_VARS_ENDED;
        }
        hosted.ticks--;
        FUZZ_CHECK(fcsl_run_step(hosted.run, 1, error) == 0);
        hosted_publish(ctx);
    }
    return FCSL_VARS_OK;
}

static fcsl_vars_host_t hosted_host(void)
{
    return (fcsl_vars_host_t){.run = hosted.run,
                              .accepts_samples = 1,
                              .restore = hosted_restore,
                              .pause = hosted_pause,
                              .tick = hosted_tick,
                              .publish = hosted_publish};
}

static fcsl_vars_block_t hosted_block(void)
{
    const fcsl_machine_t *machine = fcsl_machines[0];
    return (fcsl_vars_block_t){
        .prefix = "", .fields = machine->fields, .field_count = machine->field_count, .machine = machine};
}

static void hosted_open(void)
{
    fcsl_error_t error;
    hosted.run = fcsl_run_open_machine(fcsl_machines[0], NULL, &error);
    FUZZ_CHECK(hosted.run != NULL);
    const fcsl_part_t part = {.data = fcsl_run_data(hosted.run), .size = fcsl_machines[0]->size};
    FUZZ_CHECK(fcsl_history_open(&hosted.history, &part, 1, HISTORY_SLOTS) == 0);
    hosted.paused = 1;
    hosted.ticks = TICKS_PER_INPUT;
    hosted_publish(NULL);
}

static void hosted_close(void)
{
    fcsl_error_t error;
    fcsl_history_free(&hosted.history);
    FUZZ_CHECK(fcsl_run_close(hosted.run, &error) == 0);
}

#endif /* VARS_HOST_H */
