/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl-fc: flies a machine as a process of its own.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "loop.h"
#include "options.h"

enum { EXIT_RUN = 1, EXIT_USAGE = 2 };

typedef struct {
    options_t options;
    loop_t loop;
    fcsl_vars_block_t block;
    atomic_int stop;
    sigset_t signals;
    pthread_t watcher;
    int watching;
} program_t;

static int complain(const char *text)
{
    (void)fprintf(stderr, "fcsl-fc: %s\n", text);
    return -1;
}

/* Waits for a signal to end the run; wakes a HAL that waits for its peer. */
static void *watch_signals(void *argument)
{
    program_t *program = argument;
    int number = 0;
    (void)sigwait(&program->signals, &number);
    atomic_store(&program->stop, 1);
    program->loop.hal.interrupt(program->loop.hal.ctx);
    return NULL;
}

static int open_run(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    loop->run = fcsl_run_open(program->options.library, program->options.machine, &error);
    if (loop->run == NULL) {
        return complain(error.text);
    }
    loop->stop = &program->stop;
    loop->ticks_max = program->options.ticks;
    loop->paused = program->options.paused;
    return loop_open(loop) == 0 ? 0 : complain("out of memory for frames");
}

/* The socket is taken first: when it is in use, nothing else has happened yet. */
static int open_server(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    if (program->options.socket == NULL) {
        return 0;
    }
    const fcsl_vars_options_t options = {.address = program->options.socket, .token = program->options.token};
    const fcsl_vars_host_t host = loop_host(loop);
    program->block = (fcsl_vars_block_t){
        .prefix = "", .fields = machine->fields, .field_count = machine->field_count, .machine = machine};
    loop->vars = fcsl_vars_open(&options, &program->block, 1, &loop->history, &host, &error);
    return loop->vars != NULL ? 0 : complain(error.text);
}

static int open_hardware(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (program->options.wire != NULL &&
        fcsl_hal_wire_connect(program->options.wire, fcsl_run_machine(loop->run), program->options.timeout_ms,
                              &loop->hal, error.text, sizeof error.text) != 0) {
        return complain(error.text);
    }
    if (program->options.board != NULL && fcsl_run_open_board(loop->run, program->options.board, &error) != 0) {
        return complain(error.text);
    }
    if (loop->hal.serves && fcsl_run_attach(loop->run, &error) != 0) {
        return complain(error.text);
    }
    loop->realtime = program->options.realtime && !loop->hal.paces;
    if (loop->realtime) {
        /* Only here: in lock-step a clock would make the results depend on the computer. */
        fcsl_run_set_clock(loop->run, fcsl_run_monotonic_ns, NULL);
    }
    return 0;
}

static int open_record(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (program->options.record == NULL) {
        return 0;
    }
    const fcsl_record_options_t options = {
        .bag = program->options.record, .name_space = program->options.name_space, .lossless = !loop->realtime};
    if (fcsl_run_record(loop->run, &options, &error) != 0) {
        return complain(error.text);
    }
    loop->recording = 1;
    loop->lossless = options.lossless;
    return 0;
}

static int start_threads(program_t *program)
{
    fcsl_error_t error;
    if (pthread_create(&program->watcher, NULL, watch_signals, program) != 0) {
        return complain("cannot start the signal thread");
    }
    program->watching = 1;
    if (program->loop.vars != NULL && fcsl_vars_start(program->loop.vars, &error) != 0) {
        return complain(error.text);
    }
    return 0;
}

static void announce(const program_t *program)
{
    const fcsl_machine_t *machine = fcsl_run_machine(program->loop.run);
    const char *pace = program->loop.hal.paces  ? "paced by the HAL"
                       : program->loop.realtime ? "real time"
                                                : "free running";
    (void)printf("fcsl-fc: machine '%s', %" PRIu64 " Hz, HAL %s, %s%s\n", machine->name, machine->tick_hz,
                 program->options.wire != NULL ? "wire" : "stub", pace, program->loop.paused ? ", paused" : "");
    if (program->options.board != NULL) {
        (void)printf("fcsl-fc: board %s\n", program->options.board);
    }
    if (program->options.socket != NULL) {
        (void)printf("fcsl-fc: commands on %s\n", fcsl_vars_address(program->loop.vars));
    }
    if (program->options.record != NULL) {
        (void)printf("fcsl-fc: recording to %s\n", program->options.record);
    }
    (void)fflush(stdout);
}

static void print_counters(const program_t *program)
{
    const fcsl_tick_stats_t *stats = &program->loop.stats;
    uint64_t faults = 0;
    uint64_t overruns = 0;
    fcsl_tick_stats_faults(fcsl_run_machine(program->loop.run), fcsl_run_data(program->loop.run), &faults, &overruns);
    (void)printf("fcsl-fc: %" PRIu64 " ticks, %" PRIu64 " late, %" PRIu64 " times re-scheduled, %" PRIu64
                 " faults, %" PRIu64 " overruns, %" PRIu64 " hardware failures, %" PRIu64
                 " sensor frames refused, %" PRIu64 " records dropped",
                 fcsl_tick_stats_get(&stats->ticks), fcsl_tick_stats_get(&stats->late),
                 fcsl_tick_stats_get(&stats->skipped), faults, overruns,
                 fcsl_tick_stats_get(&stats->hardware_failures), fcsl_tick_stats_get(&stats->frames_refused),
                 fcsl_tick_stats_get(&stats->records_dropped));
    if (program->loop.vars != NULL) {
        fcsl_vars_counters_t vars;
        fcsl_vars_count(program->loop.vars, &vars);
        (void)printf(", %" PRIu64 " requests (%" PRIu64 " refused), %" PRIu64 " clients dropped",
                     vars.requests, vars.requests_refused, vars.clients_dropped);
    }
    (void)printf("\n");
    (void)fflush(stdout);
}

static void stop_threads(program_t *program)
{
    if (program->watching) {
        (void)pthread_kill(program->watcher, SIGTERM);
        (void)pthread_join(program->watcher, NULL);
    }
}

static int close_all(program_t *program)
{
    fcsl_error_t error;
    int status = 0;
    loop_t *loop = &program->loop;
    fcsl_vars_close(loop->vars);
    /* Before the machine is unloaded: the HAL's thread reads its channel table. */
    loop->hal.close(loop->hal.ctx);
    if (loop->run != NULL && fcsl_run_close(loop->run, &error) != 0) {
        status = complain(error.text);
    }
    loop_free(loop);
    return status;
}

int main(int argc, char **argv)
{
    program_t program;
    memset(&program, 0, sizeof program);
    const int parsed = options_read(argc, argv, &program.options);
    if (parsed != 0) {
        return parsed > 0 ? 0 : EXIT_USAGE;
    }
    program.loop.hal = fcsl_hal_stub();
    (void)signal(SIGPIPE, SIG_IGN);
    (void)sigemptyset(&program.signals);
    (void)sigaddset(&program.signals, SIGINT);
    (void)sigaddset(&program.signals, SIGTERM);
    /* Blocked in every thread from here on: the watcher takes them. */
    (void)pthread_sigmask(SIG_BLOCK, &program.signals, NULL);

    int status = open_run(&program) != 0 || open_server(&program) != 0 || open_hardware(&program) != 0 ||
                         open_record(&program) != 0 || start_threads(&program) != 0
                     ? -1
                     : 0;
    if (status == 0) {
        announce(&program);
        status = loop_run(&program.loop);
        if (program.loop.failure[0] != '\0') {
            (void)complain(program.loop.failure);
        }
    }
    stop_threads(&program);
    if (status == 0 || fcsl_tick_stats_get(&program.loop.stats.ticks) > 0) {
        print_counters(&program);
    }
    return close_all(&program) == 0 && status == 0 ? 0 : EXIT_RUN;
}
