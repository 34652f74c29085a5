/* SPDX-License-Identifier: Apache-2.0
 *
 * Measures the instances of a machine that was built with --times, and the step as a whole.
 *
 * During a step the machine calls `measure` after each instance, which reads the clock and notes the difference: no more, since
 * what it does counts as time of the next instance. Rows and histograms follow when the step is over.
 *
 * Threads: the step thread alone writes. Other threads read histograms and totals in place, and rows in the copies that the
 * step thread publishes.
 */
#define _GNU_SOURCE
#include "instance_times.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_cdr.h"
#include "fcsl/fcsl_histogram.h"
#include "fcsl/fcsl_monotonic.h"
#include "record/recorder.h"

enum { PATH_BYTES = 256, TOPIC_BYTES = 512, TYPE_BYTES = 256, LINE_BYTES = 320 };

/* Of one instance in the last tick. */
typedef struct {
    uint32_t instance;
    uint64_t ns;
} measured_t;

typedef struct {
    const char *name;
    uint32_t offset;
    const char *unit;
    const char *doc;
} served_t;

/* What is served of a row. */
static const served_t SERVED[] = {
    {"runs", offsetof(fcsl_time_row_t, runs), "", "executes, faulted ones included"},
    {"total_ns", offsetof(fcsl_time_row_t, total_ns), "ns", "time of all runs"},
    {"last_ns", offsetof(fcsl_time_row_t, last_ns), "ns", "time of the last run"},
    {"max_ns", offsetof(fcsl_time_row_t, max_ns), "ns", "longest time of a run"},
};
enum { SERVED_COUNT = sizeof SERVED / sizeof SERVED[0] };

/* Arrays have an entry for each instance, and behind them one for the step. */
struct fcsl_times {
    uint32_t count;
    uint64_t begun_ns; /* the step */
    uint64_t read_ns;  /* the last reading of the clock */
    measured_t *measured; /* in this step, in order */
    uint32_t measured_count;
    uint64_t step_ns; /* of the last tick */
    fcsl_time_row_t *rows;
    fcsl_histogram_t *histograms;
    _Atomic uint64_t *totals_ns;
    fcsl_field_t *fields; /* of the rows, as they are served */
    char *paths;
    int topic; /* of the recording; -1: none */
    uint32_t *tick_ns; /* of the last tick, as it is recorded */
    uint8_t *cdr;
    size_t cdr_bytes;
};

static void measure(void *ctx, int32_t instance)
{
    const fcsl_run_t *run = ctx;
    struct fcsl_times *times = run->times;
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (instance >= 0 && (uint32_t)instance < times->count && times->measured_count < times->count) {
        times->measured[times->measured_count++] =
            (measured_t){.instance = (uint32_t)instance, .ns = now_ns - times->read_ns};
    }
    times->read_ns = now_ns;
}

static void serve(struct fcsl_times *times, uint32_t index, const char *name)
{
    for (uint32_t i = 0; i < SERVED_COUNT; i++) {
        const uint32_t number = index * SERVED_COUNT + i;
        char *path = times->paths + (size_t)number * PATH_BYTES;
        (void)snprintf(path, PATH_BYTES, "%.200s.%s", name, SERVED[i].name);
        times->fields[number] = (fcsl_field_t){
            .path = path,
            .role = FCSL_ROLE_MACHINE,
            .type = FCSL_U64,
            .count = 1,
            .offset = (uint32_t)(index * sizeof(fcsl_time_row_t)) + SERVED[i].offset,
            .size = sizeof(uint64_t),
            .instance = FCSL_NONE,
            .connected_from = FCSL_NONE,
            .unit = SERVED[i].unit,
            .doc = SERVED[i].doc,
            .minimum = -INFINITY,
            .maximum = INFINITY,
        };
    }
}

int fcsl_times_open(fcsl_run_t *run, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (machine->measured == 0u) {
        return 0;
    }
    struct fcsl_times *times = calloc(1, sizeof *times);
    run->times = times;
    if (times == NULL) {
        return fcsl_fail(error, "out of memory for the times of machine '%s'", machine->name);
    }
    const size_t rows = machine->instance_count + 1u;
    times->count = machine->instance_count;
    times->topic = -1;
    times->measured = calloc(rows, sizeof *times->measured);
    times->rows = calloc(rows, sizeof *times->rows);
    times->histograms = calloc(rows, sizeof *times->histograms);
    times->totals_ns = calloc(rows, sizeof *times->totals_ns);
    times->fields = calloc(rows * SERVED_COUNT, sizeof *times->fields);
    times->paths = calloc(rows * SERVED_COUNT, PATH_BYTES);
    times->tick_ns = calloc(rows, sizeof *times->tick_ns);
    times->cdr_bytes = 64u + rows * sizeof(uint32_t);
    times->cdr = calloc(1, times->cdr_bytes);
    if (times->measured == NULL || times->rows == NULL || times->histograms == NULL || times->totals_ns == NULL ||
        times->fields == NULL || times->paths == NULL || times->tick_ns == NULL || times->cdr == NULL) {
        return fcsl_fail(error, "out of memory for the times of machine '%s'", machine->name);
    }
    for (uint32_t i = 0; i < times->count; i++) {
        serve(times, i, machine->instances[i].name);
    }
    serve(times, times->count, "machine");
    run->host.measure = measure;
    return 0;
}

void fcsl_times_close(fcsl_run_t *run)
{
    struct fcsl_times *times = run->times;
    if (times != NULL) {
        free(times->measured);
        free(times->rows);
        free(times->histograms);
        free(times->totals_ns);
        free(times->fields);
        free(times->paths);
        free(times->tick_ns);
        free(times->cdr);
    }
    free(times);
    run->times = NULL;
}

void fcsl_times_begin(fcsl_run_t *run)
{
    run->times->measured_count = 0;
    run->times->begun_ns = fcsl_monotonic_ns();
}

static void add(struct fcsl_times *times, uint32_t index, uint64_t ns)
{
    fcsl_time_row_t *row = &times->rows[index];
    row->runs++;
    row->total_ns += ns;
    row->last_ns = ns;
    row->max_ns = ns > row->max_ns ? ns : row->max_ns;
    fcsl_histogram_add(&times->histograms[index], ns);
    atomic_store_explicit(&times->totals_ns[index], row->total_ns, memory_order_relaxed);
}

void fcsl_times_end(fcsl_run_t *run)
{
    struct fcsl_times *times = run->times;
    times->step_ns = fcsl_monotonic_ns() - times->begun_ns;
    for (uint32_t i = 0; i < times->measured_count; i++) {
        add(times, times->measured[i].instance, times->measured[i].ns);
    }
    add(times, times->count, times->step_ns);
}

/* ---- the recording ---------------------------------------------------------------------------------------------- */

/* Header, tick, and a number for each instance: nav.filter is nav_filter_ns. Null without memory. */
static char *make_schema(const fcsl_machine_t *machine)
{
    const size_t capacity = ((size_t)machine->instance_count + 3u) * LINE_BYTES + sizeof FCSL_SCHEMA_HEADER;
    char *text = malloc(capacity);
    if (text == NULL) {
        return NULL;
    }
    size_t at = (size_t)snprintf(text, capacity, "std_msgs/Header header\nuint64 tick\n");
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        char line[LINE_BYTES];
        (void)snprintf(line, sizeof line, "uint32 %.200s_ns  # 0: it did not run\n", machine->instances[i].name);
        for (char *c = line; *c != '#'; c++) {
            *c = *c == '.' ? '_' : *c;
        }
        at += (size_t)snprintf(text + at, capacity - at, "%s", line);
    }
    (void)snprintf(text + at, capacity - at, "uint32 machine_ns  # the whole step\n" FCSL_SCHEMA_HEADER);
    return text;
}

/* fcsl_times/msg/LanderControl of lander_control: the fields of the message are those of one machine. */
static void make_type(const char *machine, char type[TYPE_BYTES])
{
    size_t at = (size_t)snprintf(type, TYPE_BYTES, "fcsl_times/msg/");
    int begins = 1;
    for (; *machine != '\0' && at < TYPE_BYTES - 1u; machine++) {
        if (*machine != '_') {
            type[at++] = (char)(begins ? toupper((unsigned char)*machine) : *machine);
        }
        begins = *machine == '_';
    }
    type[at] = '\0';
}

int fcsl_times_record(fcsl_run_t *run, const char *name_space, fcsl_error_t *error)
{
    struct fcsl_times *times = run->times;
    char topic[TOPIC_BYTES];
    if (times == NULL) {
        return 0;
    }
    name_space += strspn(name_space, "/");
    size_t length = strlen(name_space);
    while (length > 0 && name_space[length - 1u] == '/') {
        length--;
    }
    const int bytes = snprintf(topic, sizeof topic, "%s%.*s/%s/record/times", length > 0 ? "/" : "", (int)length,
                               name_space, run->machine->name);
    char *schema = make_schema(run->machine);
    if (schema == NULL || bytes < 0 || (size_t)bytes >= sizeof topic) {
        free(schema);
        return fcsl_fail(error, "no room for the topic of the times of machine '%.200s'", run->machine->name);
    }
    char type[TYPE_BYTES];
    make_type(run->machine->name, type);
    times->topic = fcsl_recorder_add_topic(run->recorder, topic, type, schema, error);
    free(schema);
    return times->topic < 0 ? -1 : 0;
}

static uint32_t in_32_bits(uint64_t ns)
{
    return ns < UINT32_MAX ? (uint32_t)ns : UINT32_MAX;
}

void fcsl_times_note(fcsl_run_t *run, uint64_t tick)
{
    struct fcsl_times *times = run->times;
    const uint64_t time_ns =
        run->record_time_ns == FCSL_TICK_TIME ? fcsl_run_tick_time_ns(run, tick) : run->record_time_ns;
    fcsl_error_t error;
    memset(times->tick_ns, 0, times->count * sizeof *times->tick_ns);
    for (uint32_t i = 0; i < times->measured_count; i++) {
        times->tick_ns[times->measured[i].instance] = in_32_bits(times->measured[i].ns);
    }
    fcsl_cdr_t cdr;
    fcsl_cdr_begin(&cdr, times->cdr, times->cdr_bytes);
    fcsl_cdr_header(&cdr, time_ns);
    fcsl_cdr_u64(&cdr, tick);
    for (uint32_t i = 0; i < times->count; i++) {
        fcsl_cdr_u32(&cdr, times->tick_ns[i]);
    }
    fcsl_cdr_u32(&cdr, in_32_bits(times->step_ns));
    (void)fcsl_recorder_message(run->recorder, times->topic, time_ns, times->cdr, (uint32_t)fcsl_cdr_end(&cdr), &error);
}

/* ---- for observers ---------------------------------------------------------------------------------------------- */

const fcsl_time_row_t *fcsl_run_times(const fcsl_run_t *run, uint32_t *size)
{
    const struct fcsl_times *times = run->times;
    *size = times != NULL ? (uint32_t)((times->count + 1u) * sizeof *times->rows) : 0u;
    return times != NULL ? times->rows : NULL;
}

const fcsl_field_t *fcsl_run_time_fields(const fcsl_run_t *run, uint32_t *count)
{
    const struct fcsl_times *times = run->times;
    *count = times != NULL ? (times->count + 1u) * (uint32_t)SERVED_COUNT : 0u;
    return times != NULL ? times->fields : NULL;
}

int fcsl_run_time(const fcsl_run_t *run, uint32_t index, fcsl_run_time_t *time)
{
    const struct fcsl_times *times = run->times;
    if (times == NULL || index > times->count) {
        return -1;
    }
    fcsl_summary_t summary;
    fcsl_histogram_summary(&times->histograms[index], &summary);
    const uint64_t total_ns = atomic_load_explicit(&times->totals_ns[index], memory_order_relaxed);
    *time = (fcsl_run_time_t){.name = index < times->count ? run->machine->instances[index].name : "machine",
                              .runs = summary.count,
                              .total_ns = total_ns,
                              .mean_ns = summary.count > 0 ? total_ns / summary.count : 0u,
                              .p50_ns = summary.p50,
                              .p99_ns = summary.p99,
                              .max_ns = summary.max};
    return 0;
}
