/* SPDX-License-Identifier: Apache-2.0 */
#include "conclude.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "last_state.h"
#include "tell.h"

static void print_times(const char *what, const fcsl_histogram_t *histogram)
{
    const double us = 1e-3;
    fcsl_summary_t times;
    fcsl_histogram_summary(histogram, &times);
    if (times.count > 0) {
        (void)printf("fcsl-fc: %s p50 %.1f us, p99 %.1f us, p99.9 %.1f us, max %.1f us\n", what, (double)times.p50 * us,
                     (double)times.p99 * us, (double)times.p999 * us, (double)times.max * us);
    }
}

static void print_telemetry(const fcsl_telemetry_t *telemetry)
{
    fcsl_telemetry_counters_t sent;
    fcsl_telemetry_count(telemetry, &sent);
    (void)printf("fcsl-fc: telemetry %" PRIu64 " packets, %" PRIu64 " missed, %" PRIu64 " configurations, %" PRIu64
                 " datagrams sent, %" PRIu64 " came back or were not taken\n",
                 sent.packets, sent.missed, sent.configurations, sent.datagrams, sent.failures);
}

/* `data` is the machine struct of the last tick. */
static void print_counters(const loop_t *loop, const uint8_t *data)
{
    const fcsl_tick_stats_t *stats = &loop->stats;
    uint64_t faults = 0;
    uint64_t overruns = 0;
    fcsl_tick_stats_faults(fcsl_run_machine(loop->run), data, &faults, &overruns);
    (void)printf("fcsl-fc: %" PRIu64 " ticks, %" PRIu64 " late, %" PRIu64 " deadlines skipped, %" PRIu64
                 " stuck, %" PRIu64 " faults, %" PRIu64 " overruns, %" PRIu64 " hardware failures, %" PRIu64
                 " sensor frames refused, %" PRIu64 " records dropped",
                 fcsl_tick_stats_get(&stats->ticks), fcsl_tick_stats_get(&stats->late),
                 fcsl_tick_stats_get(&stats->skipped), fcsl_tick_stats_get(&stats->stuck), faults, overruns,
                 fcsl_tick_stats_get(&stats->hardware_failures), fcsl_tick_stats_get(&stats->frames_refused),
                 fcsl_tick_stats_get(&stats->records_dropped));
    if (loop->vars != NULL) {
        fcsl_vars_counters_t vars;
        fcsl_vars_count(loop->vars, &vars);
        (void)printf(", %" PRIu64 " requests (%" PRIu64 " refused), %" PRIu64 " clients dropped", vars.requests,
                     vars.requests_refused, vars.clients_dropped);
    }
    (void)printf("\n");
    if (loop->telemetry != NULL) {
        print_telemetry(loop->telemetry);
    }
    print_times("lateness ", &stats->lateness);
    print_times("step time", &stats->step_time);
    (void)fflush(stdout);
}

int conclude(const loop_t *loop, const char *last_state, const char *ended)
{
    fcsl_error_t error;
    fcsl_moment_t moment;
    uint8_t *data = malloc(fcsl_history_bytes(&loop->history));
    int status = -1;
    if (data == NULL || fcsl_history_latest(&loop->history, &moment, data) != FCSL_HISTORY_OK) {
        tell("out of memory for what the run left");
    } else {
        print_counters(loop, data);
        status = last_state == NULL ? 0 : last_state_write(last_state, loop, &moment, data, ended, &error);
        if (status != 0) {
            tell("%s", error.text);
        }
    }
    free(data);
    return status;
}
