/* SPDX-License-Identifier: Apache-2.0
 *
 * The flight program behind the variable server: what commands do on the step thread between two ticks, and its counters.
 */
#include <inttypes.h>
#include <string.h>

#include "loop.h"

static fcsl_vars_status_t result(int status)
{
    return status == 0 ? FCSL_VARS_OK : FCSL_VARS_REFUSED;
}

static fcsl_vars_status_t restore(void *ctx, const void *data, uint32_t size, const fcsl_hw_sim_t *hardware,
                                  fcsl_error_t *error)
{
    loop_t *loop = ctx;
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    uint64_t tick = 0;
    if (loop->hal.no_pause != NULL) {
        (void)fcsl_fail(error, "%s", loop->hal.no_pause);
        return FCSL_VARS_REFUSED;
    }
    memcpy(&tick, (const uint8_t *)data + machine->tick_offset, sizeof tick);
    if (loop->hal.paces == FCSL_PACED_BY_SIMULATOR && tick != fcsl_run_tick(loop->run)) {
        (void)fcsl_fail(error,
                        "the checkpoint is of tick %" PRIu64 ", and the simulator of this lock-step is at tick %" PRIu64
                        ": only one of this very tick can be restored",
                        tick, fcsl_run_tick(loop->run));
        return FCSL_VARS_REFUSED;
    }
    const int was_armed = fcsl_run_is_armed(loop->run);
    const fcsl_vars_status_t status = result(fcsl_run_restore(loop->run, data, size, error));
    if (status == FCSL_VARS_OK) {
        *fcsl_run_simulated_hardware(loop->run) = *hardware;
        if (!was_armed && loop->hal.paces != FCSL_PACED_BY_SIMULATOR) {
            loop_require_arming(loop);
        }
    }
    return status;
}

/* Ticks that commands make may wait for the disk; those that the clock makes may not. */
static void pace_recording(loop_t *loop)
{
    if (loop->record_by_command) {
        fcsl_run_record_lossless(loop->run, loop->paused || !loop->realtime);
    }
}

static fcsl_vars_status_t set_paused(void *ctx, int paused, fcsl_error_t *error)
{
    loop_t *loop = ctx;
    if (paused && loop->hal.no_pause != NULL) {
        (void)fcsl_fail(error, "%s", loop->hal.no_pause);
        return FCSL_VARS_REFUSED;
    }
    loop->paused = paused;
    pace_recording(loop);
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t run_ticks(void *ctx, uint64_t count, fcsl_error_t *error)
{
    loop_t *loop = ctx;
    if (!loop->paused) {
        return FCSL_VARS_NOT_PAUSED;
    }
    for (uint64_t i = 0; i < count; i++) {
        if (!loop_may_tick(loop) || !loop_tick(loop)) {
            if (!loop->ended && loop_may_tick(loop) && fcsl_run_record_check(loop->run, error) != 0) {
                return FCSL_VARS_FAILED;
            }
            const int failed = loop->failure[0] != '\0';
            (void)fcsl_fail(error, "%.480s", failed ? loop->failure : "the run has ended");
            return failed ? FCSL_VARS_FAILED : FCSL_VARS_ENDED;
        }
    }
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t record(void *ctx, const char *bag, const char *name_space, fcsl_error_t *error)
{
    loop_t *loop = ctx;
    const fcsl_record_options_t options = {.bag = bag, .name_space = name_space, .lossless = 1};
    if (!loop->paused) {
        return FCSL_VARS_NOT_PAUSED;
    }
    const fcsl_vars_status_t status = result(fcsl_run_record(loop->run, &options, error));
    if (status == FCSL_VARS_OK) {
        loop->recording = 1;
        loop->record_by_command = 1;
        loop->record_over = 0;
    }
    return status;
}

static fcsl_vars_status_t stop_recording(void *ctx, fcsl_error_t *error)
{
    loop_t *loop = ctx;
    if (!loop->paused) {
        return FCSL_VARS_NOT_PAUSED;
    }
    loop->recording = 0;
    loop->record_by_command = 0;
    hal_topic_close(&loop->hal_topic);
    return result(fcsl_run_record_stop(loop->run, error));
}

static void publish(void *ctx)
{
    loop_publish(ctx);
}

static void write_stats(void *ctx, fcsl_vars_out_t *out)
{
    const loop_t *loop = ctx;
    const fcsl_tick_stats_t *stats = &loop->stats;
    fcsl_vars_tick_stats(out, stats);
    fcsl_vars_number(out, "deadlines_missed", fcsl_tick_stats_get(&stats->deadlines_missed));
    fcsl_vars_number(out, "ticks_skipped", fcsl_tick_stats_get(&stats->ticks_skipped));
    fcsl_vars_number(out, "watchdog_trips", fcsl_tick_stats_get(&stats->watchdog_trips));
    fcsl_vars_histogram(out, "lateness_ns", &stats->lateness);
    if (loop->telemetry != NULL) {
        fcsl_telemetry_stats(loop->telemetry, out);
    }
    if (loop->ros != NULL) {
        fcsl_ros_graph_stats(loop->ros, out);
    }
    if (loop->observers != NULL) {
        fcsl_observers_stats(loop->observers, out);
    }
}

fcsl_vars_host_t loop_host(loop_t *loop)
{
    return (fcsl_vars_host_t){.ctx = loop,
                              .run = loop->run,
                              .accepts_samples = 1,
                              .restore = restore,
                              .pause = set_paused,
                              .tick = run_ticks,
                              .record = record,
                              .stop_recording = stop_recording,
                              .publish = publish,
                              .stats = write_stats};
}

void loop_serve(loop_t *loop)
{
    if (loop->vars != NULL) {
        fcsl_vars_serve(loop->vars);
    }
}
