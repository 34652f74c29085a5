/* SPDX-License-Identifier: Apache-2.0
 *
 * Prints what has changed.
 */
#include "report.h"

#include <inttypes.h>

#include "printing.h"

static const uint64_t LINE_NS = 100000000u; /* what a line costs */
static const uint64_t SAVED_NS = 2000000000u; /* what can be saved for lines */
static const uint64_t COUNT_NS = 1000000000u; /* between two lines of a counter */

static void report_state(const guard_t *guard)
{
    switch (guard->gate.state) {
    case FCSL_GATE_ARMED:
        print_info("armed, at tick %" PRIu64, guard->tick);
        break;
    case FCSL_GATE_SILENT:
        print_error("silent: no command for %.6g ms since tick %" PRIu64 "; safe values",
                    (double)guard->machine->command_timeout_ns / 1e6, guard->tick);
        break;
    default:
        print_info("disarmed, at tick %" PRIu64 "; safe values", guard->tick);
        break;
    }
}

static void report_program(int32_t before, int32_t now)
{
    if (before != 0) {
        print_info("the flight program of process %" PRId32 " has left the slot", before);
    }
    if (now != 0) {
        print_info("the flight program of process %" PRId32 " has the slot", now);
    }
}

static void report_missed(const outputs_t *outputs)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_t *device = outputs->devices[i];
        const uint64_t missed = output_device_missed(device);
        if (missed > 0u) {
            const char *reason = output_device_reason(device);
            /* What may be long stands last: a line that is too long loses its end. */
            print_error("a device did not take a write: %s (%" PRIu64 " so far): device '%s' of driver '%s'",
                        reason[0] != '\0' ? reason : "the driver gives no reason", missed,
                        output_device_address(device), output_device_driver_name(device));
        }
    }
}

/* Whether a counter is to be printed now. */
static int is_due(report_count_t *count, uint64_t value, uint64_t now_ns)
{
    if (count->reported == value || now_ns < count->next_ns) {
        return 0;
    }
    count->reported = value;
    count->next_ns = now_ns + COUNT_NS;
    return 1;
}

static void report_counts(report_t *report, const guard_t *guard, uint64_t now_ns)
{
    if (is_due(&report->refused, guard->refused, now_ns)) {
        print_error("refused a command: %s (%" PRIu64 " so far)", guard->refusal, guard->refused);
    }
    if (is_due(&report->turned_away, guard->turned_away, now_ns)) {
        print_error("turned away a process: a flight program has the slot (%" PRIu64 " so far)", guard->turned_away);
    }
    if (is_due(&report->missed, outputs_missed(&guard->outputs), now_ns)) {
        report_missed(&guard->outputs);
    }
    if (is_due(&report->periods_missed, guard->periods_missed, now_ns)) {
        print_error("woke too late: %" PRIu64 " periods missed so far", guard->periods_missed);
    }
}

/* Whether there is time for a line, which is then paid. */
static int pay(report_t *report, uint64_t now_ns)
{
    const uint64_t oldest_ns = now_ns > SAVED_NS ? now_ns - SAVED_NS : 0u;
    if (report->paid_ns < oldest_ns) {
        report->paid_ns = oldest_ns;
    }
    if (report->paid_ns + LINE_NS > now_ns) {
        return 0;
    }
    report->paid_ns += LINE_NS;
    return 1;
}

void report_changes(report_t *report, const guard_t *guard, uint64_t now_ns)
{
    const int32_t pid = guard->server.client >= 0 ? guard->server.client_pid : 0;
    if (pid != report->pid && pay(report, now_ns)) {
        report_program(report->pid, pid);
        report->pid = pid;
    }
    if (guard->changes != report->changes && pay(report, now_ns)) {
        report_state(guard);
        report->changes = guard->changes;
    }
    report_counts(report, guard, now_ns);
}

void report_end(const guard_t *guard)
{
    print_info("%" PRIu64 " periods, %" PRIu64 " missed; %" PRIu64 " commands, %" PRIu64 " refused, %" PRIu64
               " silences; %" PRIu64 " writes missed",
               guard->periods, guard->periods_missed, guard->commands, guard->refused, guard->silences,
               outputs_missed(&guard->outputs));
}
