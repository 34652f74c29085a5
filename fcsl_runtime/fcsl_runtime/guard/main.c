/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl-guard: owns the actuators of a machine, and makes them safe when the flight program falls silent.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdlib.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_library.h"
#include "guard_options.h"
#include "log.h"
#include "printing.h"
#include "realtime.h"
#include "report.h"

/* Exit statuses, besides 0 (docs/hardware/arming.md). */
enum { EXIT_GUARD = 1, EXIT_USAGE = 2 };

typedef struct {
    options_t options;
    realtime_t realtime;
    void *library;
    void *unfolded; /* the descriptor of the machine, if it was folded */
    output_assignment_t *assignments; /* of --actuator */
    board_plan_t *board; /* of --board */
    guard_t guard;
    report_t report;
} program_t;

static volatile sig_atomic_t stop;

static void on_signal(int number)
{
    (void)number;
    stop = 1;
}

/* Every signal that would end the process ends the loop, and so the process with safe values; one that would stop it is
 * ignored. Not those of a defect (SIGSEGV, SIGABRT, …), and nothing helps against SIGKILL and SIGSTOP. A terminal that is gone
 * does not end what nohup started. */
static void take_signals(void)
{
    static const int ending[] = {SIGTERM, SIGINT,    SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM,
                                 SIGPROF, SIGVTALRM, SIGXCPU, SIGPWR,  SIGPOLL, SIGSTKFLT};
    /* SIGPIPE, SIGXFSZ: what they are about is an error of the call that could not write. */
    static const int ignored[] = {SIGTSTP, SIGTTIN, SIGTTOU, SIGPIPE, SIGXFSZ};
    const struct sigaction action = {.sa_handler = on_signal};
    struct sigaction hangup;
    for (size_t i = 0; i < sizeof ending / sizeof ending[0]; i++) {
        (void)sigaction(ending[i], &action, NULL);
    }
    for (int number = SIGRTMIN; number <= SIGRTMAX; number++) {
        (void)sigaction(number, &action, NULL);
    }
    for (size_t i = 0; i < sizeof ignored / sizeof ignored[0]; i++) {
        (void)signal(ignored[i], SIG_IGN);
    }
    if (sigaction(SIGHUP, NULL, &hangup) == 0 && hangup.sa_handler != SIG_IGN) {
        (void)sigaction(SIGHUP, &action, NULL);
    }
}

static int complain(const char *text)
{
    log_error("%s", text);
    return -1;
}

static uint64_t period_of(const options_t *options)
{
    return options->period_ms * 1000000u;
}

static int open_machine(program_t *program, fcsl_error_t *error)
{
    const options_t *options = &program->options;
    const fcsl_machine_t *machine =
        fcsl_library_machine(options->library, options->machine, &program->library, &program->unfolded, error);
    if (machine == NULL || guard_check_machine(machine, error) != 0) {
        return -1;
    }
    /* A command is a tick old when the next one is begun, and taken a period later, with one to spare. */
    const uint64_t least_ns = 1000000000u / machine->tick_hz + 2u * period_of(options);
    if (machine->command_timeout_ns < least_ns) {
        return fcsl_fail(
            error,
            "the actuators of machine '%.100s' keep a command for %.6g ms, less than a tick and two periods "
            "(%.6g ms): they would be safe now and then in every flight. Write a longer "
            "\"command_timeout_s\" in its JSON, or a shorter --period-ms",
            machine->name, (double)machine->command_timeout_ns / 1e6, (double)least_ns / 1e6);
    }
    return guard_open(&program->guard, machine, error);
}

static int add_actuators(program_t *program, fcsl_error_t *error)
{
    const options_t *options = &program->options;
    guard_t *guard = &program->guard;
    const uint32_t count = options->actuator_count;
    program->assignments = calloc((size_t)count + 1u, sizeof *program->assignments);
    if (program->assignments == NULL) {
        return fcsl_fail(error, "out of memory for the plan");
    }
    return output_assignments_read(guard->machine, options->actuators, count, program->assignments, error) == 0 &&
                   outputs_open(&guard->outputs, guard->machine, count, count, error) == 0 &&
                   outputs_add_actuators(&guard->outputs, program->assignments, count, error) == 0
               ? 0
               : -1;
}

static int add_board(program_t *program, fcsl_error_t *error)
{
    const char *file = program->options.board;
    guard_t *guard = &program->guard;
    program->board = board_plan_read(file, error);
    return program->board != NULL &&
                   outputs_open(&guard->outputs, guard->machine, BOARD_OUTPUTS_MAX,
                                BOARD_OUTPUTS_MAX * BOARD_PULSES_MAX, error) == 0 &&
                   outputs_add_board(&guard->outputs, program->board, file, error) == 0
               ? 0
               : -1;
}

static int open_outputs(program_t *program, fcsl_error_t *error)
{
    const options_t *options = &program->options;
    guard_t *guard = &program->guard;
    if ((options->board != NULL ? add_board(program, error) : add_actuators(program, error)) != 0) {
        return -1;
    }
    const int status = outputs_start(&guard->outputs, guard->data, program->realtime.priority,
                                     guard->machine->command_timeout_ns, error);
    /* Before a flight program gets the slot. Where a device cannot be opened, the others may still do what a guard that died has
     * left. */
    (void)guard_make_safe(guard, period_of(options));
    return status;
}

static int open_all(program_t *program)
{
    fcsl_error_t error;
    const options_t *options = &program->options;
    guard_t *guard = &program->guard;
    program->realtime =
        (realtime_t){.priority = (int)options->priority, .lock_memory = options->lock_memory, .cpu = -1};
    guard->server = (fcsl_guard_server_t){.listener = -1, .client = -1, .memory = -1};
    /* The slot before the devices: those of a guard that has it already are left alone. */
    if (realtime_begin(&program->realtime, &error) != 0 || open_machine(program, &error) != 0 ||
        fcsl_guard_listen(options->slot, guard->machine, &guard->server, &error) != 0 ||
        open_outputs(program, &error) != 0 || printing_start(&error) != 0 ||
        realtime_enter(&program->realtime, &error) != 0) {
        return complain(error.text);
    }
    return 0;
}

static void announce(const program_t *program)
{
    const guard_t *guard = &program->guard;
    log_info("machine '%s', actuators written every %" PRIu64 " ms, safe after %.6g ms without a command, slot at %s",
             guard->machine->name, program->options.period_ms, (double)guard->machine->command_timeout_ns / 1e6,
             program->options.slot);
    for (uint32_t i = 0; i < program->options.actuator_count; i++) {
        log_info("actuator %s", program->options.actuators[i]);
    }
    for (uint32_t i = 0; program->board != NULL && i < guard->outputs.binding_count; i++) {
        const output_binding_t *binding = &guard->outputs.bindings[i];
        log_info("actuator %s[%" PRIu32 "]=%s.%s:%s", binding->channel->name, binding->rule->index,
                 output_device_driver_name(binding->device), binding->rule->signal,
                 output_device_address(binding->device));
    }
}

/* Sleeps to the next due time; those that have passed are missed. */
static void wait_period(program_t *program, uint64_t period_ns, uint64_t *due_ns)
{
    *due_ns += period_ns;
    const struct timespec due = fcsl_timespec_of(*due_ns);
    while (stop == 0 && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) {
    }
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (now_ns >= *due_ns + period_ns) {
        const uint64_t missed = (now_ns - *due_ns) / period_ns;
        program->guard.periods_missed += missed;
        *due_ns += missed * period_ns;
    }
}

static int run(program_t *program)
{
    const uint64_t period_ns = period_of(&program->options);
    uint64_t due_ns = fcsl_monotonic_ns();
    announce(program);
    while (stop == 0) {
        guard_period(&program->guard);
        report_changes(&program->report, &program->guard, fcsl_monotonic_ns());
        wait_period(program, period_ns, &due_ns);
    }
    const uint32_t failed = guard_make_safe(&program->guard, period_ns);
    report_end(&program->guard);
    if (failed > 0u) {
        print_error("%" PRIu32 " of %" PRIu32 " devices did not take their safe values at the end", failed,
                    program->guard.outputs.device_count);
        return EXIT_GUARD;
    }
    print_info("the actuators have their safe values");
    return 0;
}

static void close_all(program_t *program)
{
    /* The devices first: one that was late may still take its safe values. */
    outputs_close(&program->guard.outputs);
    fcsl_guard_unlisten(&program->guard.server);
    printing_end();
    guard_free(&program->guard);
    free(program->assignments);
    board_plan_free(program->board);
    options_free(&program->options);
    free(program->unfolded);
    if (program->library != NULL) {
        (void)dlclose(program->library);
    }
}

int main(int argc, char **argv)
{
    static program_t program;
    log_fill_standard();
    const int parsed = options_read(argc, argv, &program.options);
    if (parsed != 0) {
        options_free(&program.options);
        return parsed > 0 ? 0 : EXIT_USAGE;
    }
    take_signals();
    const int status = open_all(&program) == 0 ? run(&program) : EXIT_GUARD;
    close_all(&program);
    return status;
}
