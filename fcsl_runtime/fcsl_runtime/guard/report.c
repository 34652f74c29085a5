/* SPDX-License-Identifier: Apache-2.0
 *
 * Prints what has changed.
 */
#include "report.h"

#include <inttypes.h>

#include "log.h"

static const uint64_t PAUSE_NS = 100000000u;

static void report_state(const guard_t *guard)
{
    switch (guard->gate.state) {
    case FCSL_GATE_ARMED:
        log_info("armed, at tick %" PRIu64, guard->tick);
        break;
    case FCSL_GATE_SILENT:
        log_error("silent: no command for %.3g ms since tick %" PRIu64 "; safe values",
                  (double)guard->machine->command_timeout_ns / 1e6, guard->tick);
        break;
    default:
        log_info("disarmed, at tick %" PRIu64 "; safe values", guard->tick);
        break;
    }
}

static void report_program(int32_t before, int32_t now)
{
    if (before != 0) {
        log_info("the flight program of process %" PRId32 " has left the slot", before);
    }
    if (now != 0) {
        log_info("the flight program of process %" PRId32 " has the slot", now);
    }
}

static void report_missed(const outputs_t *outputs)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        const output_device_t *device = &outputs->devices[i];
        if (device->missed > 0u) {
            log_error("device '%s' of driver '%s' did not take a write: %s (%" PRIu64 " so far)", device->device,
                      device->name, device->reason[0] != '\0' ? device->reason : "the driver gives no reason",
                      device->missed);
        }
    }
}

/* Stores `now` as told and returns 1 when it is news. */
static int is_news(uint64_t *told, uint64_t now)
{
    const int news = *told != now;
    *told = now;
    return news;
}

static int report_counts(report_t *report, const guard_t *guard)
{
    const int refused = is_news(&report->refused, guard->refused);
    const int turned_away = is_news(&report->turned_away, guard->turned_away);
    const int missed = is_news(&report->missed, outputs_missed(&guard->outputs));
    const int late = is_news(&report->periods_missed, guard->periods_missed);
    if (refused) {
        log_error("refused a command: %s (%" PRIu64 " so far)", guard->refusal, guard->refused);
    }
    if (turned_away) {
        log_error("turned away a flight program: another one has the slot (%" PRIu64 " so far)", guard->turned_away);
    }
    if (missed) {
        report_missed(&guard->outputs);
    }
    if (late) {
        log_error("woke too late: %" PRIu64 " periods missed so far", guard->periods_missed);
    }
    return refused || turned_away || missed || late;
}

void report_changes(report_t *report, const guard_t *guard, uint64_t now_ns)
{
    if (now_ns < report->next_ns) {
        return;
    }
    const int32_t pid = guard->server.client >= 0 ? guard->server.client_pid : 0;
    const int program = pid != report->pid;
    const int state = guard->gate.state != report->state;
    if (program) {
        report_program(report->pid, pid);
        report->pid = pid;
    }
    if (state) {
        report_state(guard);
        report->state = guard->gate.state;
    }
    if (report_counts(report, guard) || program || state) {
        report->next_ns = now_ns + PAUSE_NS;
    }
}

void report_end(const guard_t *guard)
{
    log_info("%" PRIu64 " periods, %" PRIu64 " missed; %" PRIu64 " commands, %" PRIu64 " refused, %" PRIu64
             " silences; %" PRIu64 " writes missed",
             guard->periods, guard->periods_missed, guard->commands, guard->refused, guard->silences,
             outputs_missed(&guard->outputs));
}
