/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens the monitor of a machine, steps it after each tick, and reads its verdicts.
 */
#define _GNU_SOURCE
#include "monitor.h"

#include <dlfcn.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_fp_mode.h"
#include "fcsl/fcsl_run.h"
#include "fcsl/fcsl_scalar.h"
#include "machine/view.h"

enum {
    MONITORS_MAX = 1024,
    PATH_BYTES = 512,
};

/* Bytes that go from the machine's struct into that of the monitor. */
typedef struct {
    uint32_t from;
    uint32_t to;
    uint32_t size; /* of a scalar: 1, 4 or 8 */
} copied_t;

/* Where the results of a requirement are in the monitor's struct; FCSL_NO_OFFSET: it has none such. */
typedef struct {
    uint32_t holds;
    uint32_t asked;
    uint32_t evaluated;
    uint32_t exercised;
    uint32_t undefined;
    uint32_t violations;
    uint32_t violated_ticks;
    uint32_t first_tick;
    uint32_t last_violated;
} results_t;

struct fcsl_monitor_run {
    const fcsl_monitor_t *monitor;
    fcsl_run_t *run;
    copied_t *copied;
    results_t *results;
    fcsl_field_t *fields; /* of the results, as they are served */
    char *paths;
    uint32_t field_count;
};

/* Results by the names under which they are served; not every requirement has all. */
static const char *const RESULTS[] = {"holds",      "evaluated",      "exercised",  "undefined",
                                      "violations", "violated_ticks", "first_tick", "last_violated"};

enum { RESULT_COUNT = sizeof RESULTS / sizeof RESULTS[0] };

const fcsl_monitor_t *fcsl_monitor_in(void *library, const char *machine)
{
    const fcsl_monitor_t *const *monitors = (const fcsl_monitor_t *const *)dlsym(library, "fcsl_monitors");
    for (uint32_t i = 0; monitors != NULL && i < MONITORS_MAX && monitors[i] != NULL; i++) {
        if (strcmp(monitors[i]->watched, machine) == 0) {
            return monitors[i];
        }
    }
    return NULL;
}

/* The scalar that a path names; 0 where it names none. */
static uint32_t locate(const fcsl_machine_t *machine, const char *path, uint32_t *offset)
{
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        const size_t length = strlen(field->path);
        if (strncmp(path, field->path, length) != 0 || (path[length] != '\0' && path[length] != '[')) {
            continue;
        }
        view_t view = fcsl_view_whole(field);
        if (fcsl_view_index(&view, path + length) == 0 && fcsl_view_count(&view) == 1) {
            *offset = field->offset + (uint32_t)fcsl_view_byte(&view, 0);
            return fcsl_scalar_size(field->type);
        }
    }
    return 0;
}

/* A field of the monitor is served under a shorter path. */
static void serve(struct fcsl_monitor_run *made, const char *instance, const char *name, const char *path)
{
    const fcsl_machine_t *machine = made->monitor->machine;
    for (uint32_t i = 0; i < machine->field_count; i++) {
        if (strcmp(machine->fields[i].path, path) == 0) {
            char *own = made->paths + (size_t)made->field_count * PATH_BYTES;
            (void)snprintf(own, PATH_BYTES, "%.200s.%.100s", instance, name);
            made->fields[made->field_count] = machine->fields[i];
            made->fields[made->field_count].path = own;
            made->fields[made->field_count].flags = 0;
            made->fields[made->field_count].instance = FCSL_NONE;
            made->field_count++;
        }
    }
}

static void serve_results(struct fcsl_monitor_run *made, const char *instance)
{
    char path[PATH_BYTES];
    for (uint32_t i = 0; i < RESULT_COUNT; i++) {
        (void)snprintf(path, sizeof path, "%.200s.outputs.%s", instance, RESULTS[i]);
        serve(made, instance, strcmp(RESULTS[i], "last_violated") == 0 ? "last_tick" : RESULTS[i], path);
    }
    (void)snprintf(path, sizeof path, "%.200s.counters.faults", instance);
    serve(made, instance, "faults", path);
}

static uint32_t result(const fcsl_machine_t *machine, const char *instance, const char *name)
{
    char path[PATH_BYTES];
    (void)snprintf(path, sizeof path, "%.200s.outputs.%s", instance, name);
    uint32_t offset = 0;
    return locate(machine, path, &offset) != 0 ? offset : FCSL_NO_OFFSET;
}

static int bind(struct fcsl_monitor_run *made, const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const fcsl_monitor_t *monitor = made->monitor;
    for (uint32_t i = 0; i < monitor->observed_count; i++) {
        const fcsl_observed_t *observed = &monitor->observed[i];
        copied_t *copied = &made->copied[i];
        copied->size = locate(machine, observed->path, &copied->from);
        if (copied->size == 0 || locate(monitor->machine, observed->input, &copied->to) != copied->size) {
            return fcsl_fail(error, "the monitor of '%s' reads '%s', which the machine does not have", monitor->watched,
                             observed->path);
        }
    }
    for (uint32_t i = 0; i < monitor->requirement_count; i++) {
        const char *instance = monitor->machine->instances[monitor->requirements[i].instance].name;
        made->results[i] = (results_t){
            .holds = result(monitor->machine, instance, "holds"),
            .asked = result(monitor->machine, instance, "asked"),
            .evaluated = result(monitor->machine, instance, "evaluated"),
            .exercised = result(monitor->machine, instance, "exercised"),
            .undefined = result(monitor->machine, instance, "undefined"),
            .violations = result(monitor->machine, instance, "violations"),
            .violated_ticks = result(monitor->machine, instance, "violated_ticks"),
            .first_tick = result(monitor->machine, instance, "first_tick"),
            .last_violated = result(monitor->machine, instance, "last_violated"),
        };
        serve_results(made, instance);
    }
    return 0;
}

int fcsl_run_use_monitor(fcsl_run_t *run, const fcsl_monitor_t *monitor, fcsl_error_t *error)
{
    struct fcsl_monitor_run *made = calloc(1, sizeof *made);
    if (made == NULL) {
        return fcsl_fail(error, "out of memory");
    }
    fcsl_monitor_close(run);
    run->monitor = made;
    made->monitor = monitor;
    made->copied = calloc(monitor->observed_count + 1u, sizeof *made->copied);
    made->results = calloc(monitor->requirement_count + 1u, sizeof *made->results);
    const size_t served = (size_t)monitor->requirement_count * (RESULT_COUNT + 1u) + 1u;
    made->fields = calloc(served, sizeof *made->fields);
    made->paths = calloc(served, PATH_BYTES);
    made->run = fcsl_run_open_machine(monitor->machine, error);
    if (made->copied == NULL || made->results == NULL || made->fields == NULL || made->paths == NULL) {
        return fcsl_fail(error, "out of memory for the monitor of '%s'", monitor->watched);
    }
    return made->run == NULL ? -1 : bind(made, run->machine, error);
}

void fcsl_monitor_close(fcsl_run_t *run)
{
    struct fcsl_monitor_run *made = run->monitor;
    if (made == NULL) {
        return;
    }
    fcsl_error_t unused;
    (void)fcsl_run_close(made->run, &unused); /* it records nothing, so that nothing can fail */
    free(made->copied);
    free(made->results);
    free(made->fields);
    free(made->paths);
    free(made);
    run->monitor = NULL;
}

__attribute__((hot)) void fcsl_monitor_tick(fcsl_run_t *run)
{
    const struct fcsl_monitor_run *monitor = run->monitor;
    uint8_t *data = monitor->run->data;
    for (uint32_t i = 0; i < monitor->monitor->observed_count; i++) {
        const copied_t *copied = &monitor->copied[i];
        const uint8_t *from = run->data + copied->from;
        uint8_t *to = data + copied->to;
        if (copied->size == 8u) {
            memcpy(to, from, 8);
        } else if (copied->size == 4u) {
            memcpy(to, from, 4);
        } else {
            *to = *from;
        }
    }
    monitor->run->machine->step(data, &monitor->run->host);
}

void fcsl_run_judge(fcsl_run_t *run, const uint8_t *rows, uint64_t row_bytes, uint64_t count)
{
    const struct fcsl_monitor_run *monitor = run->monitor;
    const fcsl_fp_mode_t callers = fcsl_fp_enter();
    for (uint64_t row = 0; row < count; row++) {
        const uint8_t *from = rows + row * row_bytes;
        for (uint32_t i = 0; i < monitor->monitor->observed_count; i++) {
            const copied_t *copied = &monitor->copied[i];
            memcpy(monitor->run->data + copied->to, from, copied->size);
            from += copied->size;
        }
        monitor->run->machine->step(monitor->run->data, &monitor->run->host);
    }
    fcsl_fp_leave(callers);
}

const fcsl_monitor_t *fcsl_run_monitor(const fcsl_run_t *run)
{
    return run->monitor != NULL ? run->monitor->monitor : NULL;
}

const void *fcsl_run_monitor_data(const fcsl_run_t *run)
{
    return run->monitor != NULL ? run->monitor->run->data : NULL;
}

const fcsl_field_t *fcsl_run_verdict_fields(const fcsl_run_t *run, uint32_t *count)
{
    *count = run->monitor != NULL ? run->monitor->field_count : 0u;
    return run->monitor != NULL ? run->monitor->fields : NULL;
}

static uint64_t count_at(const uint8_t *data, uint32_t offset)
{
    return offset != FCSL_NO_OFFSET ? fcsl_read_u64(data, offset) : 0;
}

void fcsl_run_verdict(const fcsl_run_t *run, const void *bytes, uint32_t index, fcsl_verdict_t *verdict)
{
    const uint8_t *data = bytes;
    const struct fcsl_monitor_run *made = run->monitor;
    const fcsl_requirement_t *requirement = &made->monitor->requirements[index];
    const fcsl_instance_t *instance = &made->monitor->machine->instances[requirement->instance];
    const results_t *at = &made->results[index];
    *verdict = (fcsl_verdict_t){
        .requirement = requirement,
        .holds = data[at->holds] != 0,
        .evaluated = count_at(data, at->evaluated),
        .exercised = count_at(data, at->exercised),
        .undefined = count_at(data, at->undefined),
        .faults = fcsl_read_u64(data, instance->faults_offset),
        .violations = count_at(data, at->violations),
        .violated_ticks = count_at(data, at->violated_ticks),
        .first_tick = count_at(data, at->first_tick),
        .last_tick = count_at(data, at->last_violated),
    };
    const int exercised = at->asked != FCSL_NO_OFFSET ? data[at->asked] != 0 : verdict->exercised > 0;
    const int violated = at->asked != FCSL_NO_OFFSET ? exercised && !verdict->holds : verdict->violations > 0;
    verdict->status = violated ? FCSL_VIOLATED : exercised ? FCSL_MET : FCSL_NOT_EXERCISED;
}

static const char *times(uint64_t count, const char *one, const char *many)
{
    return count == 1 ? one : many;
}

void fcsl_run_verdict_text(const fcsl_run_t *run, const fcsl_verdict_t *verdict, char text[FCSL_VERDICT_TEXT_MAX])
{
    const fcsl_requirement_t *required = verdict->requirement;
    const double hz = (double)run->machine->tick_hz;
    const char *of = required->assumed ? "assumption " : "";
    switch (verdict->status) {
    case FCSL_MET:
        (void)snprintf(text, FCSL_VERDICT_TEXT_MAX, "%s%s met, exercised in %" PRIu64 " %s", of, required->id,
                       verdict->exercised, times(verdict->exercised, "tick", "ticks"));
        return;
    case FCSL_NOT_EXERCISED:
        (void)snprintf(text, FCSL_VERDICT_TEXT_MAX, "%s%s not exercised: %s", of, required->id, required->text);
        return;
    default:
        break;
    }
    if (required->kind == FCSL_REQUIRED_AT_END) {
        (void)snprintf(text, FCSL_VERDICT_TEXT_MAX, "%s%s violated at the end: %s", of, required->id, required->text);
        return;
    }
    (void)snprintf(text, FCSL_VERDICT_TEXT_MAX,
                   "%s%s violated %" PRIu64 " %s, first at tick %" PRIu64 " (%.9g s), last at tick %" PRIu64 ": %s", of,
                   required->id, verdict->violations, times(verdict->violations, "time", "times"), verdict->first_tick,
                   (double)verdict->first_tick / hz, verdict->last_tick, required->text);
}
