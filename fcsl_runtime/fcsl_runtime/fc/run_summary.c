/* SPDX-License-Identifier: Apache-2.0
 *
 * What is printed at the end of a run.
 */
#include "run_summary.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "summary_file.h"
#include "log.h"
#include "times_summary.h"
#include "run/lost_requests.h"

enum { CLIENTS_BYTES = 128, HAL_BYTES = 1024, REQUIREMENTS_BYTES = 1024, ANEW_BYTES = 128 };

static void report_times(const char *what, const fcsl_histogram_t *histogram)
{
    const double us = 1e-3;
    fcsl_summary_t times;
    fcsl_histogram_summary(histogram, &times);
    if (times.count > 0) {
        log_info("%s p50 %.1f us, p99 %.1f us, p99.9 %.1f us, max %.1f us", what, (double)times.p50 * us,
                 (double)times.p99 * us, (double)times.p999 * us, (double)times.max * us);
    }
}

static void report_telemetry(const fcsl_telemetry_t *telemetry)
{
    fcsl_telemetry_counters_t sent;
    fcsl_telemetry_count(telemetry, &sent);
    log_info("telemetry %" PRIu64 " packets, %" PRIu64 " overwritten, %" PRIu64 " configurations, %" PRIu64
             " datagrams sent, %" PRIu64 " came back or were not taken",
             sent.packets, sent.overwritten, sent.configurations, sent.datagrams, sent.failures);
}

static void report_ros(const fcsl_ros_graph_t *ros)
{
    fcsl_ros_graph_counters_t put;
    fcsl_ros_graph_count(ros, &put);
    log_info("ROS 2 topics %" PRIu64 " ticks, %" PRIu64 " dropped, %" PRIu64 " messages refused", put.ticks,
             put.dropped, put.refused);
}

static void report_observers(const fcsl_observers_t *observers)
{
    fcsl_observers_counters_t put;
    fcsl_observers_count(observers, &put);
    log_info("observers %" PRIu64 " ticks, %" PRIu64 " dropped", put.ticks, put.dropped);
}

/* What the HAL has counted, as far as it is not 0. */
static void report_hal(const loop_t *loop, const uint8_t *data)
{
    const fcsl_hal_t *hal = &loop->hal;
    char text[HAL_BYTES] = "";
    size_t at = 0;
    for (uint32_t i = 0; i < hal->field_count; i++) {
        const uint64_t value = loop_hal_count(loop, data, i);
        const int added = value == 0u ? 0
                                      : snprintf(text + at, sizeof text - at, "%s%s %" PRIu64, at > 0 ? ", " : "",
                                                 hal->fields[i].path, value);
        at += added > 0 && (size_t)added < sizeof text - at ? (size_t)added : 0u;
    }
    if (at > 0) {
        log_info("hal: %s", text);
    }
}

/* One line for each transition that has lost requests. */
static void report_lost_requests(const fcsl_machine_t *machine, const uint8_t *data)
{
    uint32_t next = 0;
    fcsl_lost_request_t lost;
    while (fcsl_lost_request_next(machine, data, &next, &lost)) {
        log_info("lost requests: %s %" PRIu64, lost.name, lost.count);
    }
}

static void report_events(const fcsl_run_t *run)
{
    const fcsl_event_counts_t events = fcsl_run_event_counts(run);
    if (fcsl_run_machine(run)->event_site_count > 0) {
        log_info("events: %" PRIu64 " told, %" PRIu64 " suppressed, %" PRIu64 " without room", events.told,
                 events.suppressed, events.lost);
    }
}

/* A line for each violated requirement, and one that says how many were met, which were not exercised, and whether a
 * checkpoint made them begin anew. */
static void report_requirements(const fcsl_run_t *run, const uint8_t *verdicts)
{
    const fcsl_monitor_t *monitor = fcsl_run_monitor(run);
    char silent[REQUIREMENTS_BYTES] = "";
    char anew[ANEW_BYTES] = "";
    size_t at = 0;
    uint32_t met = 0;
    for (uint32_t i = 0; monitor != NULL && i < monitor->requirement_count; i++) {
        fcsl_verdict_t verdict;
        char text[FCSL_VERDICT_TEXT_MAX];
        fcsl_run_verdict(run, verdicts, i, &verdict);
        met += verdict.status == FCSL_MET;
        if (verdict.forgot_before > 0) {
            (void)snprintf(anew, sizeof anew, "; begun anew at tick %" PRIu64 ": the checkpoint has no memory of them",
                           verdict.forgot_before);
        }
        if (verdict.status == FCSL_VIOLATED) {
            fcsl_run_verdict_text(run, &verdict, text);
            log_info("requirement %s", text);
        } else if (verdict.status == FCSL_NOT_EXERCISED) {
            const int added = snprintf(silent + at, sizeof silent - at, "%s%s",
                                       at > 0 ? ", " : "; not exercised: ", verdict.requirement->id);
            at += added > 0 && (size_t)added < sizeof silent - at ? (size_t)added : 0u;
        }
    }
    if (monitor != NULL) {
        log_info("requirements: %" PRIu32 " of %" PRIu32 " met%s%s", met, monitor->requirement_count, silent, anew);
    }
}

/* `data` is what was published after the last tick. */
static void report_counters(const loop_t *loop, const uint8_t *data)
{
    const fcsl_tick_stats_t *stats = &loop->stats;
    uint64_t faults = 0;
    uint64_t overruns = 0;
    fcsl_tick_stats_faults(fcsl_run_machine(loop->run), data, &faults, &overruns);
    char clients[CLIENTS_BYTES] = "";
    if (loop->vars != NULL) {
        fcsl_vars_counters_t vars;
        fcsl_vars_count(loop->vars, &vars);
        (void)snprintf(clients, sizeof clients,
                       ", %" PRIu64 " requests (%" PRIu64 " refused), %" PRIu64 " clients dropped", vars.requests,
                       vars.requests_refused, vars.clients_dropped);
    }
    log_info("%" PRIu64 " ticks, %" PRIu64 " deadlines missed, %" PRIu64 " ticks skipped, %" PRIu64
             " watchdog trips, %" PRIu64 " faults, %" PRIu64 " overruns, %" PRIu64 " hardware failures, %" PRIu64
             " sensor messages refused, %" PRIu64 " records dropped%s",
             fcsl_tick_stats_get(&stats->ticks), fcsl_tick_stats_get(&stats->deadlines_missed),
             fcsl_tick_stats_get(&stats->ticks_skipped), fcsl_tick_stats_get(&stats->watchdog_trips), faults, overruns,
             fcsl_tick_stats_get(&stats->hardware_failures), fcsl_tick_stats_get(&stats->messages_refused),
             fcsl_tick_stats_get(&stats->records_dropped), clients);
    report_lost_requests(fcsl_run_machine(loop->run), data);
    report_events(loop->run);
    report_requirements(loop->run, loop_verdicts(loop, data));
    if (loop->telemetry != NULL) {
        report_telemetry(loop->telemetry);
    }
    if (loop->ros != NULL) {
        report_ros(loop->ros);
    }
    if (loop->observers != NULL) {
        report_observers(loop->observers);
    }
    report_hal(loop, data);
    if (loop->guard_state != GUARD_NONE) {
        log_info("guard: %s", loop->guard_state == GUARD_THERE ? "there to the end" : "ended before the run did");
    }
    report_times("lateness ", &stats->lateness);
    report_times("tick time", &stats->tick_time);
    report_instance_times(loop->run);
}

int write_run_summary(const loop_t *loop, const char *summary_file, const char *ended)
{
    fcsl_error_t error;
    fcsl_moment_t moment;
    uint8_t *data = malloc(fcsl_history_bytes(&loop->history));
    int status = -1;
    if (data == NULL || fcsl_history_latest(&loop->history, &moment, data) != FCSL_HISTORY_OK) {
        log_error("out of memory for what the run left");
    } else {
        status = summary_file == NULL ? 0 : last_state_write(summary_file, loop, &moment, data, ended, &error);
        if (status != 0) {
            log_error("%s", error.text);
        }
        report_counters(loop, data);
    }
    free(data);
    return status;
}
