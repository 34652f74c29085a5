/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens the monitor of a machine, steps it after each tick, and reads its verdicts.
 */
#define _GNU_SOURCE
#include "requirements.h"

#include <dlfcn.h>
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_fp_mode.h"
#include "machine/monitor_memory.h"
#include "machine/view.h"
#include "monitor_run.h"

enum {
    MONITORS_MAX = 1024,
    PATH_BYTES = 512,
};

typedef struct {
    const char *name;
    uint8_t type;
    uint32_t offset;
} served_t;

/* What is served of a row. */
static const served_t SERVED[] = {
    {"holds", FCSL_BOOL, offsetof(fcsl_served_row_t, holds)},
    {"evaluated", FCSL_U64, offsetof(fcsl_served_row_t, evaluated)},
    {"exercised", FCSL_U64, offsetof(fcsl_served_row_t, exercised)},
    {"undefined", FCSL_U64, offsetof(fcsl_served_row_t, undefined)},
    {"faults", FCSL_U64, offsetof(fcsl_served_row_t, faults)},
    {"violations", FCSL_U64, offsetof(fcsl_served_row_t, violations)},
    {"violated_ticks", FCSL_U64, offsetof(fcsl_served_row_t, violated_ticks)},
    {"first_tick", FCSL_U64, offsetof(fcsl_served_row_t, first_tick)},
    {"last_tick", FCSL_U64, offsetof(fcsl_served_row_t, last_tick)},
};

enum { SERVED_COUNT = sizeof SERVED / sizeof SERVED[0] };

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

const fcsl_field_t *fcsl_monitor_locate(const fcsl_machine_t *machine, const char *path, uint32_t *offset)
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
            return field;
        }
    }
    return NULL;
}

/* The same; its size, or 0. */
static uint32_t locate(const fcsl_machine_t *machine, const char *path, uint32_t *offset)
{
    const fcsl_field_t *field = fcsl_monitor_locate(machine, path, offset);
    return field != NULL ? fcsl_scalar_size(field->type) : 0u;
}

/* The fields of row `index`. */
static void serve(struct fcsl_monitor_run *made, uint32_t index, const char *instance)
{
    for (uint32_t i = 0; i < SERVED_COUNT; i++) {
        char *path = made->paths + (size_t)made->field_count * PATH_BYTES;
        (void)snprintf(path, PATH_BYTES, "%.200s.%s", instance, SERVED[i].name);
        made->fields[made->field_count++] = (fcsl_field_t){
            .path = path,
            .role = FCSL_ROLE_MACHINE,
            .type = SERVED[i].type,
            .count = 1,
            .offset = (uint32_t)(index * sizeof(fcsl_served_row_t)) + SERVED[i].offset,
            .size = fcsl_scalar_size(SERVED[i].type),
            .instance = FCSL_NONE,
            .connected_from = FCSL_NONE,
            .unit = "",
            .doc = "",
            .minimum = -INFINITY,
            .maximum = INFINITY,
        };
    }
}

static uint32_t result(const fcsl_machine_t *machine, const char *instance, const char *name)
{
    char path[PATH_BYTES];
    (void)snprintf(path, sizeof path, "%.200s.outputs.%s", instance, name);
    uint32_t offset = 0;
    return locate(machine, path, &offset) != 0 ? offset : FCSL_NO_OFFSET;
}

/* Every monitor of fcslc keeps there in which tick it was evaluated last. */
static uint32_t memory_of(const fcsl_machine_t *machine, const char *instance)
{
    char path[PATH_BYTES];
    (void)snprintf(path, sizeof path, "%.200s.state.last_tick", instance);
    uint32_t offset = 0;
    return locate(machine, path, &offset) == sizeof(int64_t) ? offset : FCSL_NO_OFFSET;
}

static int bind(struct fcsl_monitor_run *made, const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const fcsl_monitor_t *monitor = made->monitor;
    for (uint32_t i = 0; i < monitor->observed_count; i++) {
        const fcsl_observed_t *observed = &monitor->observed[i];
        fcsl_observed_copy_t *copied = &made->copied[i];
        copied->size = locate(machine, observed->path, &copied->from);
        if (copied->size == 0 || locate(monitor->machine, observed->input, &copied->to) != copied->size) {
            return fcsl_fail(error, "the monitor of '%s' reads '%s', which the machine does not have", monitor->watched,
                             observed->path);
        }
    }
    for (uint32_t i = 0; i < monitor->requirement_count; i++) {
        const char *instance = monitor->machine->instances[monitor->requirements[i].instance].name;
        made->results[i] = (fcsl_results_t){
            .holds = result(monitor->machine, instance, "holds"),
            .asked = result(monitor->machine, instance, "asked"),
            .evaluated = result(monitor->machine, instance, "evaluated"),
            .exercised = result(monitor->machine, instance, "exercised"),
            .undefined = result(monitor->machine, instance, "undefined"),
            .violations = result(monitor->machine, instance, "violations"),
            .violated_ticks = result(monitor->machine, instance, "violated_ticks"),
            .first_tick = result(monitor->machine, instance, "first_tick"),
            .last_violated = result(monitor->machine, instance, "last_violated"),
            .last_tick = memory_of(monitor->machine, instance),
        };
        serve(made, i, instance);
    }
    fcsl_kept_bind(made, machine);
    return 0;
}

int fcsl_run_use_monitor(fcsl_run_t *run, const fcsl_monitor_t *monitor, fcsl_error_t *error)
{
    if (run->recorder != NULL) {
        return fcsl_fail(error, "the requirements of a run are chosen before recording begins");
    }
    uint8_t *staging = realloc(run->staging, fcsl_run_data_bytes(run->machine) + fcsl_monitor_memory_bytes(monitor));
    if (staging == NULL) {
        return fcsl_fail(error, "out of memory");
    }
    run->staging = staging;
    struct fcsl_monitor_run *made = calloc(1, sizeof *made);
    if (made == NULL) {
        return fcsl_fail(error, "out of memory");
    }
    fcsl_monitor_close(run);
    run->monitor = made;
    made->monitor = monitor;
    made->copied = calloc(monitor->observed_count + 1u, sizeof *made->copied);
    made->results = calloc(monitor->requirement_count + 1u, sizeof *made->results);
    const size_t served = (size_t)monitor->requirement_count * SERVED_COUNT + 1u;
    made->rows = calloc(1, (monitor->requirement_count + 1u) * sizeof *made->rows +
                               (size_t)monitor->observed_count * 2u * FCSL_KEPT_LAST);
    made->kept = calloc(monitor->observed_count + 1u, sizeof *made->kept);
    made->kept_fields = calloc(monitor->observed_count + 1u, sizeof *made->kept_fields);
    made->kept_begin = calloc(monitor->requirement_count + 1u, sizeof *made->kept_begin);
    made->noted = calloc(1, (monitor->requirement_count + 1u) * sizeof *made->noted +
                                (size_t)monitor->observed_count * FCSL_VERDICT_VALUE_BYTES);
    made->fields = calloc(served, sizeof *made->fields);
    made->paths = calloc(served, PATH_BYTES);
    made->run = fcsl_run_open_machine(monitor->machine, NULL, error);
    if (made->copied == NULL || made->results == NULL || made->rows == NULL || made->noted == NULL ||
        made->fields == NULL || made->paths == NULL || made->kept == NULL || made->kept_fields == NULL ||
        made->kept_begin == NULL) {
        (void)fcsl_fail(error, "out of memory for the monitor of '%s'", monitor->watched);
        fcsl_monitor_close(run);
        return -1;
    }
    if (made->run == NULL || bind(made, run->machine, error) != 0) {
        fcsl_monitor_close(run);
        return -1;
    }
    return 0;
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
    free(made->rows);
    free(made->noted);
    free(made->fields);
    free(made->paths);
    free(made->kept);
    free(made->kept_fields);
    free(made->kept_begin);
    free(made);
    run->monitor = NULL;
}

__attribute__((hot)) void fcsl_monitor_tick(fcsl_run_t *run)
{
    const struct fcsl_monitor_run *monitor = run->monitor;
    uint8_t *data = monitor->run->data;
    for (uint32_t i = 0; i < monitor->monitor->observed_count; i++) {
        const fcsl_observed_copy_t *copied = &monitor->copied[i];
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
            const fcsl_observed_copy_t *copied = &monitor->copied[i];
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

const void *fcsl_run_gather_verdicts(fcsl_run_t *run, uint32_t *size)
{
    const struct fcsl_monitor_run *made = run->monitor;
    *size = 0;
    if (made == NULL) {
        return NULL;
    }
    const uint32_t count = made->monitor->requirement_count;
    *size = (uint32_t)(count * sizeof(fcsl_served_row_t)) + made->kept_begin[count] * 2u * FCSL_KEPT_LAST;
    const uint8_t *data = made->run->data;
    for (uint32_t i = 0; i < count; i++) {
        const fcsl_instance_t *instance = &made->monitor->machine->instances[made->monitor->requirements[i].instance];
        const fcsl_results_t *at = &made->results[i];
        made->rows[i] = (fcsl_served_row_t){
            .evaluated = fcsl_result_count(data, at->evaluated),
            .exercised = fcsl_result_count(data, at->exercised),
            .undefined = fcsl_result_count(data, at->undefined),
            .faults = fcsl_read_u64(data, instance->faults_offset),
            .violations = fcsl_result_count(data, at->violations),
            .violated_ticks = fcsl_result_count(data, at->violated_ticks),
            .first_tick = fcsl_result_count(data, at->first_tick),
            .last_tick = fcsl_result_count(data, at->last_violated),
            .forgot_before = made->forgot_before,
            .holds = data[at->holds],
            .asked = fcsl_result_asked(made, data, i),
        };
        if (made->rows[i].violations > 0) {
            fcsl_kept_gather(made, i);
        }
    }
    return made->rows;
}

void fcsl_run_verdict(const fcsl_run_t *run, const void *rows, uint32_t index, fcsl_verdict_t *verdict)
{
    const struct fcsl_monitor_run *made = run->monitor;
    fcsl_served_row_t row;
    memcpy(&row, (const uint8_t *)rows + index * sizeof row, sizeof row);
    *verdict = (fcsl_verdict_t){
        .requirement = &made->monitor->requirements[index],
        .holds = row.holds,
        .evaluated = row.evaluated,
        .exercised = row.exercised,
        .undefined = row.undefined,
        .faults = row.faults,
        .violations = row.violations,
        .violated_ticks = row.violated_ticks,
        .first_tick = row.first_tick,
        .last_tick = row.last_tick,
        .forgot_before = row.forgot_before,
    };
    verdict->status = fcsl_verdict_status(verdict->requirement, row.asked, row.holds, row.exercised, row.violations);
}

void fcsl_monitor_restored(fcsl_run_t *run, const uint8_t *remembered)
{
    struct fcsl_monitor_run *made = run->monitor;
    if (made == NULL) {
        return;
    }
    if (remembered != NULL) {
        memcpy(made->run->data, remembered, made->monitor->machine->size);
        made->forgot_before = 0;
        return;
    }
    const int64_t none = -2; /* comes before no tick: what is remembered is of another flight */
    for (uint32_t i = 0; i < made->monitor->requirement_count; i++) {
        const uint32_t at = made->results[i].last_tick;
        if (at != FCSL_NO_OFFSET) {
            memcpy(made->run->data + at, &none, sizeof none);
        }
    }
    made->forgot_before = fcsl_run_tick(run);
}

static const char *times(uint64_t count, const char *one, const char *many)
{
    return count == 1 ? one : many;
}

/* Behind a verdict: ticks that say nothing of it. */
static void add_notes(const fcsl_verdict_t *verdict, char text[FCSL_VERDICT_TEXT_MAX])
{
    size_t at = strlen(text);
    if (verdict->undefined > 0 && at < FCSL_VERDICT_TEXT_MAX) {
        (void)snprintf(text + at, FCSL_VERDICT_TEXT_MAX - at, "; undefined, because of a NaN, in %" PRIu64 " %s",
                       verdict->undefined, times(verdict->undefined, "tick", "ticks"));
    }
    at = strlen(text);
    if (verdict->forgot_before > 0 && at < FCSL_VERDICT_TEXT_MAX) {
        (void)snprintf(text + at, FCSL_VERDICT_TEXT_MAX - at,
                       "; began anew at tick %" PRIu64 ": the checkpoint has no memory of this requirement",
                       verdict->forgot_before);
    }
    at = strlen(text);
    if (verdict->faults > 0 && at < FCSL_VERDICT_TEXT_MAX) {
        (void)snprintf(text + at, FCSL_VERDICT_TEXT_MAX - at,
                       "; not evaluated, because of an integer beyond 64 bits or a division by 0, in %" PRIu64 " %s",
                       verdict->faults, times(verdict->faults, "tick", "ticks"));
    }
}

static void put_verdict(const fcsl_run_t *run, const fcsl_verdict_t *verdict, char text[FCSL_VERDICT_TEXT_MAX])
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
        (void)snprintf(text, FCSL_VERDICT_TEXT_MAX, "%s%s violated in the last tick: %s", of, required->id,
                       required->text);
        return;
    }
    (void)snprintf(text, FCSL_VERDICT_TEXT_MAX,
                   "%s%s violated %" PRIu64 " %s, first at tick %" PRIu64 " (%.9g s), last at tick %" PRIu64 ": %s", of,
                   required->id, verdict->violations, times(verdict->violations, "time", "times"), verdict->first_tick,
                   (double)verdict->first_tick / hz, verdict->last_tick, required->text);
}

void fcsl_run_verdict_text(const fcsl_run_t *run, const fcsl_verdict_t *verdict, char text[FCSL_VERDICT_TEXT_MAX])
{
    put_verdict(run, verdict, text);
    add_notes(verdict, text);
}
