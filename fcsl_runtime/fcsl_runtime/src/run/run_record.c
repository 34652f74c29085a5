/* SPDX-License-Identifier: Apache-2.0
 *
 * What a run tells of itself: to its recorder, to whoever follows its host writes, and as messages of its last tick.
 */
#include "events.h"
#include "instance_times.h"
#include "record/write_queue.h"
#include "record/recorder.h"
#include "requirements.h"
#include "run_internal.h"

int fcsl_run_record(fcsl_run_t *run, const fcsl_record_options_t *options, fcsl_error_t *error)
{
    if (run->recorder != NULL) {
        return fcsl_fail(error, "this run is being recorded already");
    }
    const fcsl_record_start_t start = {.machine = run->machine,
                                       .data = run->data,
                                       .views = fcsl_run_views(run),
                                       .verdicts = fcsl_monitor_table(run),
                                       .remembered = fcsl_run_monitor_data(run),
                                       .first = fcsl_run_stamp(run, fcsl_run_tick(run))};
    fcsl_monitor_record(run);
    fcsl_events_restart(run);
    run->recorder = fcsl_recorder_open(&start, options, error);
    if (run->recorder == NULL) {
        return -1;
    }
    if (fcsl_times_record(run, options->name_space, error) != 0) {
        fcsl_error_t unused;
        (void)fcsl_recorder_close(run->recorder, &unused);
        run->recorder = NULL;
        return -1;
    }
    return 0;
}

int fcsl_run_record_stop(fcsl_run_t *run, fcsl_error_t *error)
{
    if (run->recorder == NULL) {
        return fcsl_fail(error, "this run is not being recorded");
    }
    fcsl_recorder_t *recorder = run->recorder;
    run->recorder = NULL;
    return fcsl_recorder_close(recorder, error);
}

void fcsl_run_record_time(fcsl_run_t *run, uint64_t time_ns)
{
    run->record_time_ns = time_ns;
}

void fcsl_run_record_lossless(fcsl_run_t *run, int lossless)
{
    if (run->recorder != NULL) {
        fcsl_recorder_set_lossless(run->recorder, lossless);
    }
}

int fcsl_run_record_check(const fcsl_run_t *run, fcsl_error_t *error)
{
    return run->recorder != NULL ? fcsl_recorder_check(run->recorder, error) : 0;
}

fcsl_record_drops_t fcsl_run_record_drops(const fcsl_run_t *run)
{
    return run->recorder != NULL ? fcsl_recorder_drops(run->recorder) : (fcsl_record_drops_t){0};
}

uint64_t fcsl_run_record_dropped(const fcsl_run_t *run)
{
    const fcsl_record_drops_t drops = fcsl_run_record_drops(run);
    return drops.ring_full + drops.disk_failed;
}

int fcsl_run_record_add_topic(fcsl_run_t *run, const char *topic, const char *type, const char *schema,
                              fcsl_error_t *error)
{
    if (run->recorder == NULL) {
        return fcsl_fail(error, "this run is not being recorded");
    }
    return fcsl_recorder_add_topic(run->recorder, topic, type, schema, error);
}

int fcsl_run_record_write(fcsl_run_t *run, int topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                          fcsl_error_t *error)
{
    if (run->recorder == NULL) {
        return fcsl_fail(error, "this run is not being recorded");
    }
    return fcsl_recorder_message(run->recorder, topic, time_ns, cdr, size, error);
}

fcsl_write_queue_t *fcsl_run_write_queue(fcsl_run_t *run, fcsl_error_t *error)
{
    if (run->write_queue == NULL) {
        run->write_queue = fcsl_write_queue_open(run->machine, fcsl_run_monitor(run));
    }
    if (run->write_queue == NULL) {
        (void)fcsl_fail(error, "out of memory for the queue of host writes");
    }
    return run->write_queue;
}

uint64_t fcsl_run_next_write(fcsl_run_t *run)
{
    return run->write_queue != NULL ? fcsl_write_queue_next_write(run->write_queue) : 0;
}

int64_t fcsl_run_message(const fcsl_run_t *run, uint32_t instance, uint8_t *cdr, size_t capacity)
{
    if (instance >= run->machine->instance_count || capacity < run->layouts[instance].size) {
        return -1;
    }
    const uint64_t completed = fcsl_run_tick(run);
    const uint64_t tick = completed == 0 ? 0 : completed - 1u;
    fcsl_layout_write(&run->layouts[instance], run->data, tick, fcsl_run_tick_time_ns(run, tick), cdr);
    return run->layouts[instance].size;
}

int64_t fcsl_run_tick_message(const fcsl_run_t *run, fcsl_tick_message_t what, uint8_t *cdr, size_t capacity)
{
    const uint64_t completed = fcsl_run_tick(run);
    const uint64_t tick = completed == 0 ? 0 : completed - 1u;
    const fcsl_stamp_t stamp = {.tick = tick, .time_ns = fcsl_run_tick_time_ns(run, tick)};
    return fcsl_tick_message_write(run->machine, run->data, what, stamp, cdr, capacity);
}
