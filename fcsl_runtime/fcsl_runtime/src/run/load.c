/* SPDX-License-Identifier: Apache-2.0
 *
 * Opening and closing a run: the library, its descriptor, the machine struct.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "cover.h"
#include "events.h"
#include "fcsl/fcsl_fp_mode.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_library.h"
#include "fcsl/fcsl_scalar.h"
#include "hardware.h"
#include "machine/fault_place.h"
#include "requirements.h"
#include "stack_left.h"
#include "record/write_queue.h"
#include "instance_times.h"
#include "io_replay.h"
#include "trace.h"
#include "validate.h"

enum {
    MACHINES_MAX = 1024,
    LIST_BYTES = 256,
    STACK_SPARE = 65536, /* of what runs beside the arrays of a step */
};

static void list_names(const fcsl_machine_t *const *machines, char *text, size_t size)
{
    size_t at = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < MACHINES_MAX && machines[i] != NULL && at < size; i++) {
        const char *name = machines[i]->name != NULL ? machines[i]->name : "?";
        const int length = snprintf(text + at, size - at, "%s%s", i > 0 ? ", " : "", name);
        at += length > 0 ? (size_t)length : 0;
    }
}

static const fcsl_machine_t *choose(void *handle, const char *library, const char *name, fcsl_error_t *error)
{
    const fcsl_machine_t *const *machines = (const fcsl_machine_t *const *)dlsym(handle, "fcsl_machines");
    if (machines == NULL) {
        (void)fcsl_fail(error, "'%s' is not a machine library: it has no symbol fcsl_machines", library);
        return NULL;
    }
    if (machines[0] == NULL) {
        (void)fcsl_fail(error, "'%s' holds no machine", library);
        return NULL;
    }
    char names[LIST_BYTES];
    list_names(machines, names, sizeof names);
    if (name == NULL) {
        if (machines[1] != NULL) {
            (void)fcsl_fail(error, "'%s' holds several machines, name one of: %s", library, names);
            return NULL;
        }
        return machines[0];
    }
    for (uint32_t i = 0; i < MACHINES_MAX && machines[i] != NULL; i++) {
        if (machines[i]->name != NULL && strcmp(machines[i]->name, name) == 0) {
            return machines[i];
        }
    }
    (void)fcsl_fail(error, "'%s' holds no machine '%s'; it holds: %s", library, name, names);
    return NULL;
}

/* With its fields, and checked; null with `error`. */
static const fcsl_machine_t *usable(const fcsl_machine_t *machine, void **made, fcsl_error_t *error)
{
    const fcsl_machine_t *whole = fcsl_library_unfold(machine, made, error);
    if (whole != NULL && fcsl_validate(whole, error) == 0) {
        return whole;
    }
    free(*made);
    *made = NULL;
    return NULL;
}

const fcsl_machine_t *fcsl_library_machine(const char *library, const char *name, void **handle, void **made,
                                           fcsl_error_t *error)
{
    *made = NULL;
    *handle = fcsl_library_open(library, "machine", error);
    const fcsl_machine_t *machine = *handle != NULL ? choose(*handle, library, name, error) : NULL;
    const fcsl_machine_t *whole = machine != NULL ? usable(machine, made, error) : NULL;
    if (whole != NULL) {
        return whole;
    }
    if (*handle != NULL) {
        (void)dlclose(*handle);
        *handle = NULL;
    }
    return NULL;
}

static int allocate(fcsl_run_t *run, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    const size_t align = fcsl_run_data_align(machine);
    const size_t size = fcsl_run_data_bytes(machine);
    run->data = aligned_alloc(align, size);
    run->staging = aligned_alloc(align, size);
    run->layouts = calloc(machine->instance_count + 1u, sizeof *run->layouts);
    run->watched = calloc(machine->instance_count + 1u, sizeof *run->watched);
    if (run->data == NULL || run->staging == NULL || run->layouts == NULL || run->watched == NULL) {
        return fcsl_fail(error, "out of memory for machine '%s'", machine->name);
    }
    memset(run->data, 0, size);
    memset(run->staging, 0, size);
    if (machine->arm_field != FCSL_NONE) {
        run->safe = aligned_alloc(align, size);
        if (run->safe == NULL) {
            return fcsl_fail(error, "out of memory for machine '%s'", machine->name);
        }
        memset(run->safe, 0, size);
        (void)fcsl_gate(machine, run->safe);
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_instance_t *instance = &machine->instances[i];
        if (fcsl_layout_build(machine, instance, &run->layouts[i], error) != 0) {
            return -1;
        }
        if (instance->max_wcet_us != 0) {
            run->watched[run->watched_count++] =
                (fcsl_overrun_watch_t){.overruns_offset = instance->overruns_offset,
                                       .inject_offset = instance->inject_overrun_offset,
                                       .instance = instance->name};
        }
    }
    fcsl_hardware_init(run);
    run->host.ctx = run;
    run->host.substitute = fcsl_io_replay_apply;
    run->host.executed = fcsl_io_replay_executed;
    if (fcsl_events_open(run, error) != 0 || fcsl_times_open(run, error) != 0) {
        return -1;
    }
    return fcsl_io_replay_open(run, error);
}

static int bind_parameter(void *ctx, uint32_t field, const void *bytes, fcsl_error_t *error)
{
    (void)error;
    fcsl_run_t *run = ctx;
    memcpy(run->data + run->machine->fields[field].offset, bytes, run->machine->fields[field].size);
    return 0;
}

static int initialise(fcsl_run_t *run, const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    const fcsl_fp_mode_t callers = fcsl_fp_enter();
    machine->init(run->data);
    const int refused =
        parameters != NULL && fcsl_parameters_each(machine, parameters, bind_parameter, run, error) != 0;
    const int32_t faulted = refused ? 0 : machine->start(run->data);
    fcsl_fp_leave(callers);
    if (faulted == 0) {
        return refused ? -1 : 0;
    }
    if (faulted < 0 || (uint32_t)faulted > machine->instance_count) {
        return fcsl_fail(error, "machine '%s' cannot be initialised", machine->name);
    }
    const fcsl_instance_t *instance = &machine->instances[faulted - 1];
    char place[FCSL_FAULT_TEXT_MAX];
    (void)fcsl_fault_text(machine, run->data, (uint32_t)faulted - 1u, place);
    return fcsl_fail(error, "machine '%s': start() of instance '%s' faulted: %.400s", machine->name, instance->name,
                     place[0] != '\0' ? place : instance->source_file);
}

static void release(fcsl_run_t *run)
{
    if (run->layouts != NULL) {
        for (uint32_t i = 0; i < run->machine->instance_count; i++) {
            fcsl_layout_free(&run->layouts[i]);
        }
    }
    fcsl_hardware_close(run);
    fcsl_io_replay_free(run);
    fcsl_trace_free(run);
    fcsl_monitor_close(run);
    fcsl_events_free(run);
    fcsl_times_close(run);
    fcsl_write_queue_close(run->write_queue);
    free(run->layouts);
    free(run->watched);
    free(run->data);
    free(run->staging);
    free(run->safe);
    free(run->views);
    free(run->unfolded);
    if (run->library != NULL) {
        (void)dlclose(run->library);
    }
    free(run);
}

/* Whether the stack of this thread holds a step: else it would end in a crash without a word. */
static int check_stack(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const size_t needed = (size_t)machine->stack_bytes + machine->stack_bytes / 2u + STACK_SPARE;
    const size_t left = fcsl_stack_left();
    if (machine->stack_bytes == 0 || needed <= left) {
        return 0;
    }
    return fcsl_fail(error,
                     "machine '%.100s' needs about %" PRIu32
                     " bytes of stack in a tick, and this thread has %zu left: make "
                     "the arrays that its helpers copy smaller, or raise the limit (ulimit -s)",
                     machine->name, machine->stack_bytes, left);
}

/* Initialises the machine of a run, which was checked; frees the run when that fails (or when there is no machine). */
static fcsl_run_t *begin(fcsl_run_t *run, const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    if (run->machine == NULL || check_stack(run->machine, error) != 0 || allocate(run, error) != 0 ||
        initialise(run, parameters, error) != 0) {
        release(run);
        return NULL;
    }
    run->channels = fcsl_channel_table(run->machine);
    run->record_time_ns = FCSL_TICK_TIME;
    return run;
}

fcsl_run_t *fcsl_run_open(const char *library, const char *machine, const fcsl_parameters_t *parameters,
                          fcsl_error_t *error)
{
    fcsl_run_t *run = calloc(1, sizeof *run);
    if (run == NULL) {
        (void)fcsl_fail(error, "out of memory");
        return NULL;
    }
    run->machine = fcsl_library_machine(library, machine, &run->library, &run->unfolded, error);
    if (run->machine != NULL && fcsl_cover_attach(run->library, library, run->machine, error) != 0) {
        run->machine = NULL;
    }
    run = begin(run, parameters, error);
    const fcsl_monitor_t *monitor = run != NULL ? fcsl_monitor_in(run->library, run->machine->name) : NULL;
    if (monitor != NULL && fcsl_run_use_monitor(run, monitor, error) != 0) {
        release(run);
        return NULL;
    }
    return run;
}

fcsl_run_t *fcsl_run_open_machine(const fcsl_machine_t *machine, const fcsl_parameters_t *parameters,
                                  fcsl_error_t *error)
{
    fcsl_run_t *run = calloc(1, sizeof *run);
    if (run == NULL) {
        (void)fcsl_fail(error, "out of memory");
        return NULL;
    }
    run->machine = usable(machine, &run->unfolded, error);
    return begin(run, parameters, error);
}

int fcsl_run_close(fcsl_run_t *run, fcsl_error_t *error)
{
    if (run == NULL) {
        return 0;
    }
    const int status = run->recorder != NULL ? fcsl_run_record_stop(run, error) : 0;
    release(run);
    return status;
}
