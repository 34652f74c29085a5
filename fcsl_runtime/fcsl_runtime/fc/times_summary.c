/* SPDX-License-Identifier: Apache-2.0
 *
 * The times of instances, as they are printed at the end of a run.
 */
#include "times_summary.h"

#include <inttypes.h>
#include <stdlib.h>

#include "log.h"

static int by_total(const void *left, const void *right)
{
    const fcsl_run_time_t *a = left;
    const fcsl_run_time_t *b = right;
    return (a->total_ns < b->total_ns) - (a->total_ns > b->total_ns);
}

static double in_us(uint64_t ns)
{
    return (double)ns * 1e-3;
}

static void report(const fcsl_run_time_t *time, double whole_ns)
{
    log_info("%s: %" PRIu64 " runs, mean %.2f us, p50 %.2f us, p99 %.2f us, max %.2f us, %.1f %% of the step",
             time->name, time->runs, in_us(time->mean_ns), in_us(time->p50_ns), in_us(time->p99_ns),
             in_us(time->max_ns), 100.0 * (double)time->total_ns / whole_ns);
}

void report_instance_times(const fcsl_run_t *run)
{
    const uint32_t count = fcsl_run_machine(run)->instance_count;
    fcsl_run_time_t step;
    if (fcsl_run_time(run, count, &step) != 0 || step.total_ns == 0) {
        return;
    }
    fcsl_run_time_t *times = calloc(count + 1u, sizeof *times);
    if (times == NULL) {
        log_error("out of memory for the times of instances");
        return;
    }
    log_info("step: mean %.2f us (%.2f %% of the period), p50 %.2f us, p99 %.2f us, max %.2f us", in_us(step.mean_ns),
             100.0 * (double)step.mean_ns / (double)fcsl_run_tick_time_ns(run, 1), in_us(step.p50_ns),
             in_us(step.p99_ns), in_us(step.max_ns));
    for (uint32_t i = 0; i < count; i++) {
        (void)fcsl_run_time(run, i, &times[i]);
    }
    qsort(times, count, sizeof *times, by_total);
    for (uint32_t i = 0; i < count; i++) {
        if (times[i].runs > 0) {
            report(&times[i], (double)step.total_ns);
        } else {
            log_info("%s: did not run", times[i].name);
        }
    }
    free(times);
}
