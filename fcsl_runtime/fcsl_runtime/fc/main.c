/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl-fc: flies a machine as a process of its own.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "board/hal_composite.h"
#include "board/hal_linux.h"
#include "guard_link.h"
#include "monitor.h"
#include "run_summary.h"
#include "summary_file.h"
#include "options.h"
#include "realtime.h"
#include "ros_graph/hal_ros.h"
#include "log.h"

/* Exit statuses, besides 0 (docs/hardware/flight_computer.md). */
enum { EXIT_RUN = 1, EXIT_USAGE = 2, EXIT_LATE = 3, EXIT_STUCK = 4 };

typedef struct {
    options_t options;
    loop_t loop;
    fcsl_hal_t board; /* of loop.hal: hal_linux, alone or beside a simulator; ctx null: none */
    fcsl_vars_block_t blocks[LOOP_PARTS_MAX]; /* of the parts that the loop publishes */
    uint32_t block_count;
    atomic_int stop;
    realtime_t realtime;
    monitor_t monitor;
} program_t;

static int complain(const char *text)
{
    log_error("%s", text);
    return -1;
}

/* Before any other thread is started. */
static int open_system(program_t *program)
{
    fcsl_error_t error;
    const options_t *options = &program->options;
    program->realtime = (realtime_t){.priority = (int)options->priority,
                                     .lock_memory = options->lock_memory,
                                     .cpu = options->cpu == OPTIONS_ANY_CPU ? -1 : (int)options->cpu};
    if (realtime_begin(&program->realtime, &error) != 0 ||
        (options->summary_file != NULL && last_state_check(options->summary_file, &error) != 0)) {
        return complain(error.text);
    }
    return 0;
}

/* Below the step thread, which no device keeps waiting, and above all else. */
static int priority_of_devices(const options_t *options)
{
    return options->priority > 0 ? (int)options->priority - 1 : 0;
}

/* The HAL that options->peer names. */
static int make_named_hal(const options_t *options, fcsl_run_t *run, fcsl_hal_t *hal, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    const uint32_t timeout_ms = (uint32_t)options->timeout_ms;
    const char *peer = options->peer;
    if (peer == NULL) {
        return fcsl_hal_stub(hal, error);
    }
    if (strncmp(peer, OPTIONS_WIRE, strlen(OPTIONS_WIRE)) == 0) {
        return fcsl_hal_wire(peer + strlen(OPTIONS_WIRE), machine, timeout_ms, timeout_ms, hal, error);
    }
    if (options_hal_is_linux(options)) {
        return hal_linux(peer + strlen(OPTIONS_LINUX), priority_of_devices(options), run, hal, error);
    }
    if (options_hal_is_ros(options)) {
        return hal_ros(peer + strlen(OPTIONS_ROS), options->name_space, run, hal, error);
    }
    return fcsl_hal_bus(peer, options->name_space, machine, timeout_ms, timeout_ms, hal, error);
}

/* Constructs the HAL; nothing is opened yet. */
static int make_hal(program_t *program)
{
    fcsl_error_t error;
    const options_t *options = &program->options;
    loop_t *loop = &program->loop;
    fcsl_hal_t named;
    if (make_named_hal(options, loop->run, &named, &error) != 0) {
        return complain(error.text);
    }
    if (!options_hal_is_composite(options)) {
        loop->hal = named;
        program->board = options_hal_is_linux(options) ? loop->hal : (fcsl_hal_t){0};
        return 0;
    }
    if (hal_linux(options->composite_plan, priority_of_devices(options), loop->run, &program->board, &error) != 0) {
        named.close(named.ctx);
        return complain(error.text);
    }
    return hal_composite(&program->board, &named, loop->run, &loop->hal, &error) == 0 ? 0 : complain(error.text);
}

/* The machine with its parameters; null with `error`. */
static fcsl_run_t *open_machine(const options_t *options, fcsl_error_t *error)
{
    if (options->parameters == NULL) {
        return fcsl_run_open(options->library, options->machine, NULL, error);
    }
    size_t size = 0;
    char *text = fcsl_parameters_read(options->parameters, &size, error);
    if (text == NULL) {
        return NULL;
    }
    const fcsl_parameters_t parameters = {
        .text = text, .size = size, .name = options->parameters, .name_space = options->name_space};
    fcsl_run_t *run = fcsl_run_open(options->library, options->machine, &parameters, error);
    free(text);
    return run;
}

static int open_run(program_t *program)
{
    fcsl_error_t error;
    const options_t *options = &program->options;
    loop_t *loop = &program->loop;
    loop->run = open_machine(options, &error);
    if (loop->run == NULL) {
        return complain(error.text);
    }
    if (options->restore != NULL &&
        fcsl_run_restore_file(loop->run, options->restore, options->ignore_source_hash, &error) != 0) {
        return complain(error.text);
    }
    if (make_hal(program) != 0) {
        return -1;
    }
    if (options->restore != NULL) {
        loop_require_arming(loop);
    }
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    program->blocks[0] = (fcsl_vars_block_t){
        .prefix = "", .fields = machine->fields, .field_count = machine->field_count, .machine = machine};
    program->block_count = 1;
    if (loop->hal.field_count > 0) {
        program->blocks[program->block_count++] =
            (fcsl_vars_block_t){.prefix = "hal", .fields = loop->hal.fields, .field_count = loop->hal.field_count};
    }
    uint32_t verdicts = 0;
    const fcsl_field_t *fields = fcsl_run_verdict_fields(loop->run, &verdicts);
    if (fields != NULL) {
        program->blocks[program->block_count++] =
            (fcsl_vars_block_t){.prefix = "requirements", .fields = fields, .field_count = verdicts};
    }
    uint32_t times = 0;
    const fcsl_field_t *time_fields = fcsl_run_time_fields(loop->run, &times);
    if (time_fields != NULL) {
        program->blocks[program->block_count++] =
            (fcsl_vars_block_t){.prefix = "times", .fields = time_fields, .field_count = times};
    }
    loop->stop = &program->stop;
    loop->ticks_max = program->options.ticks;
    loop->missed_deadline = program->options.missed_deadline;
    loop->paused = program->options.paused;
    return loop_open(loop) == 0 ? 0 : complain("out of memory for messages");
}

/* The socket is taken first: when it is in use, nothing else has happened yet. */
static int open_server(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (program->options.socket == NULL) {
        return 0;
    }
    const fcsl_vars_options_t options = {.address = program->options.socket,
                                         .token = program->options.token,
                                         .checkpoints = program->options.checkpoints};
    const fcsl_vars_host_t host = loop_host(loop);
    loop->vars = fcsl_vars_open(&options, program->blocks, program->block_count, &loop->history, &host, &error);
    return loop->vars != NULL ? 0 : complain(error.text);
}

/* While it waits for the simulator, a signal ends the program as it ends any other: there is nothing to save. Where nothing is
 * waited for, a signal waits for the monitor: outputs that have their safe levels are closed in order. */
static int open_hal(program_t *program, fcsl_error_t *error)
{
    fcsl_hal_t *hal = &program->loop.hal;
    if (program->options.peer == NULL || options_hal_is_linux(&program->options)) {
        return hal->open(hal, error);
    }
    monitor_let_signals(&program->monitor);
    const int status = hal->open(hal, error);
    monitor_block_signals(&program->monitor);
    return status;
}

static int open_hardware(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (open_hal(program, &error) != 0) {
        return complain(error.text);
    }
    if (program->options.board != NULL && fcsl_run_open_board(loop->run, program->options.board, &error) != 0) {
        return complain(error.text);
    }
    if (loop->hal.serves && fcsl_run_attach(loop->run, &error) != 0) {
        return complain(error.text);
    }
    if (program->options.missed_deadline_given && loop->hal.paces) {
        return complain("--missed-deadline is for ticks that the clock paces; here a simulator or a device paces them");
    }
    /* Beside a rig there is but one time. */
    loop->serves_clients = program->options.priority == 0; /* clients shall not take the processor from others */
    loop->realtime = (program->options.realtime || loop->hal.serves) && loop->hal.paces != FCSL_PACED_BY_SIMULATOR;
    if (loop->realtime && !program->options.no_overrun_check) {
        /* Only here: in lock-step a clock would make the results depend on the computer. */
        fcsl_run_set_clock(loop->run, fcsl_run_monotonic_ns, NULL);
    }
    return 0;
}

static int open_guard(program_t *program)
{
    fcsl_error_t error;
    return guard_link_open(&program->loop, program->options.guard, &error) == 0 ? 0 : complain(error.text);
}

static int open_record(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (program->options.record == NULL) {
        return 0;
    }
    const record_policy_t policy = program->options.record_policy;
    const fcsl_record_options_t record = {
        .bag = program->options.record,
        .name_space = program->options.name_space,
        .lossless = policy == RECORD_BY_PACE ? !loop->realtime : policy == RECORD_WAIT,
        .fields = program->options.record_fields,
        .split = program->options.record_split,
    };
    if (fcsl_run_record(loop->run, &record, &error) != 0 ||
        hal_topic_open(&loop->hal_topic, &loop->hal, loop->run, record.name_space, &error) != 0 ||
        (program->board.ctx != NULL && hal_linux_record(&program->board, record.name_space, &error) != 0)) {
        return complain(error.text);
    }
    loop->recording = 1;
    return 0;
}

static int open_telemetry(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (program->options.telemetry == NULL) {
        return 0;
    }
    const fcsl_telemetry_options_t options = {.address = program->options.telemetry,
                                              .fields = program->options.telemetry_fields,
                                              .machine = fcsl_run_machine(loop->run),
                                              .realtime = loop->realtime};
    loop->telemetry = fcsl_telemetry_open(&options, program->blocks, program->block_count, &loop->history, &error);
    return loop->telemetry != NULL ? 0 : complain(error.text);
}

static int open_observers(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (program->options.observers == NULL) {
        return 0;
    }
    const fcsl_observers_options_t options = {
        .endpoint = program->options.observers, .name_space = program->options.name_space, .run = loop->run};
    loop->observers = fcsl_observers_open(&options, &loop->history, &error);
    return loop->observers != NULL ? 0 : complain(error.text);
}

static int open_ros_graph(program_t *program)
{
    fcsl_error_t error;
    loop_t *loop = &program->loop;
    if (program->options.ros == NULL) {
        return 0;
    }
    /* With a HAL of the same graph the commands are there already. */
    const fcsl_ros_graph_options_t options = {.endpoint = program->options.ros,
                                              .name_space = program->options.name_space,
                                              .run = loop->run,
                                              .actuators = !options_hal_is_ros(&program->options),
                                              .simulated = !loop->realtime};
    loop->ros = fcsl_ros_graph_open(&options, &loop->history, &error);
    return loop->ros != NULL ? 0 : complain(error.text);
}

static int start_threads(program_t *program)
{
    fcsl_error_t error;
    if (monitor_start(&program->monitor) != 0) {
        return complain("cannot start the thread of signals and watchdog");
    }
    if (program->loop.vars != NULL && fcsl_vars_start(program->loop.vars, &error) != 0) {
        return complain(error.text);
    }
    if (program->loop.telemetry != NULL && fcsl_telemetry_start(program->loop.telemetry, &error) != 0) {
        return complain(error.text);
    }
    if (program->loop.observers != NULL && fcsl_observers_start(program->loop.observers, &error) != 0) {
        return complain(error.text);
    }
    if (program->loop.ros != NULL && fcsl_ros_graph_start(program->loop.ros, &error) != 0) {
        return complain(error.text);
    }
    return realtime_enter(&program->realtime, &error) == 0 ? 0 : complain(error.text);
}

static void announce(const program_t *program)
{
    const fcsl_machine_t *machine = fcsl_run_machine(program->loop.run);
    static const char *const PACES[] = {[FCSL_PACED_BY_HOST] = "as fast as possible",
                                        [FCSL_PACED_BY_SIMULATOR] = "paced by the simulator",
                                        [FCSL_PACED_IN_REAL_TIME] = "paced in real time"};
    const fcsl_pacer_t paces = program->loop.hal.paces;
    const char *pace = paces == FCSL_PACED_BY_HOST && program->loop.realtime ? "real time" : PACES[paces];
    const int timed = program->loop.realtime && !program->options.no_overrun_check;
    log_info("machine '%s', %" PRIu64 " Hz, HAL %s, %s%s%s", machine->name, machine->tick_hz,
             program->options.peer != NULL ? program->options.peer : "stub", pace, timed ? "" : ", executes not timed",
             program->loop.paused ? ", paused" : "");
    if (options_hal_is_composite(&program->options)) {
        log_info("sensors of the board %s instead of the simulator's", program->options.composite_plan);
    }
    if (program->options.parameters != NULL) {
        log_info("parameters of %s", program->options.parameters);
    }
    if (program->options.restore != NULL) {
        log_info("begins at tick %" PRIu64 ", from %s", fcsl_run_tick(program->loop.run), program->options.restore);
    }
    if (program->options.board != NULL) {
        log_info("board %s", program->options.board);
    }
    if (program->options.guard != NULL) {
        log_info("actuators by the guard at %s", program->options.guard);
    }
    if (program->options.socket != NULL) {
        log_info("commands on %s", fcsl_vars_address(program->loop.vars));
    }
    if (program->options.telemetry != NULL) {
        log_info("telemetry to %s", program->options.telemetry);
    }
    if (program->options.observers != NULL) {
        log_info("observers on %s", program->options.observers);
    }
    if (program->options.ros != NULL) {
        log_info("ROS 2 topics on %s", program->options.ros);
    }
    if (program->options.record != NULL) {
        log_info("recording to %s", program->options.record);
    }
}

/* On the monitor thread: the step thread does not end. The bag is left as after a kill: whole up to its last chunk. */
static void abandon(void *ctx, const char *what)
{
    program_t *program = ctx;
    char text[512];
    (void)snprintf(text, sizeof text, "stuck: %.400s; ended without it", what);
    (void)complain(text);
    (void)write_run_summary(&program->loop, program->options.summary_file, text);
    _exit(EXIT_STUCK);
}

static const char *reason_of_end(const program_t *program)
{
    const loop_t *loop = &program->loop;
    if (loop->failure[0] != '\0') {
        return loop->failure;
    }
    if (atomic_load(&program->stop)) {
        return "signal";
    }
    return loop->ended ? "closed by the HAL" : "ticks";
}

/* A bag that cannot be closed for the reason that its recording failed for has nothing to add. */
static int is_reported(const loop_t *loop, const char *text)
{
    const int reported =
        atomic_load(&loop->record_logged) > 0 && atomic_load(&loop->record_logged) == atomic_load(&loop->record_failed);
    return strcmp(loop->failure, text) == 0 || (reported && strcmp(loop->record_failure, text) == 0);
}

static int close_all(program_t *program)
{
    fcsl_error_t error;
    int status = 0;
    loop_t *loop = &program->loop;
    fcsl_vars_close(loop->vars);
    fcsl_telemetry_close(loop->telemetry);
    fcsl_observers_close(loop->observers);
    fcsl_ros_graph_close(loop->ros);
    /* Before the machine is unloaded: the HAL reads its channel table. */
    if (loop->hal.close != NULL) {
        loop->hal.close(loop->hal.ctx);
    }
    if (loop->run != NULL && fcsl_run_close(loop->run, &error) != 0) {
        status = is_reported(loop, error.text) ? -1 : complain(error.text);
    }
    guard_link_close(loop);
    loop_free(loop);
    return status;
}

/* Pins of the board, if there is one, get their safe levels. */
static int end_board(program_t *program)
{
    fcsl_error_t error;
    return program->board.ctx == NULL || hal_linux_end(&program->board, &error) == 0 ? 0 : complain(error.text);
}

static int fly(program_t *program)
{
    loop_t *loop = &program->loop;
    announce(program);
    int status = loop_run(loop) == 0 ? 0 : EXIT_RUN;
    if (loop->failure[0] != '\0') {
        (void)complain(loop->failure);
    }
    monitor_end(&program->monitor);
    guard_link_close(loop); /* at once: to close a bag takes time */
    status = end_board(program) == 0 ? status : EXIT_RUN;
    fcsl_telemetry_stop(loop->telemetry);
    fcsl_observers_stop(loop->observers);
    fcsl_ros_graph_stop(loop->ros);
    if (write_run_summary(loop, program->options.summary_file, reason_of_end(program)) != 0) {
        status = EXIT_RUN;
    }
    return loop->deadline_missed ? EXIT_LATE : status;
}

/* What the command line names and is not there is wrong usage; the message comes from what opens it. */
static int has_named_files(const options_t *options)
{
    const char *plan = options_hal_is_linux(options)       ? options->peer + strlen(OPTIONS_LINUX)
                       : options_hal_is_composite(options) ? options->composite_plan
                                                           : NULL;
    const char *const named[] = {options->library, options->parameters, options->restore, options->board, plan};
    for (size_t i = 0; i < sizeof named / sizeof named[0]; i++) {
        if (named[i] != NULL && access(named[i], F_OK) != 0) {
            return 0;
        }
    }
    return 1;
}

int main(int argc, char **argv)
{
    static program_t program;
    log_fill_standard();
    const int parsed = options_read(argc, argv, &program.options);
    if (parsed != 0) {
        return parsed > 0 ? 0 : EXIT_USAGE;
    }
    program.monitor = (monitor_t){.loop = &program.loop,
                                  .exit_on_stdin_eof = program.options.exit_on_stdin_eof,
                                  .watchdog = {.limit_ns = program.options.watchdog_ms * 1000000u},
                                  .abandon = abandon,
                                  .ctx = &program};
    /* What they are about is an error of the call that could not write. */
    (void)signal(SIGPIPE, SIG_IGN);
    (void)signal(SIGXFSZ, SIG_IGN);
    monitor_block_signals(&program.monitor);
    int status = has_named_files(&program.options) ? EXIT_RUN : EXIT_USAGE;
    if (open_system(&program) == 0 && open_run(&program) == 0 && open_server(&program) == 0 &&
        open_hardware(&program) == 0 && open_guard(&program) == 0 && open_telemetry(&program) == 0 &&
        open_observers(&program) == 0 && open_ros_graph(&program) == 0 && open_record(&program) == 0 &&
        start_threads(&program) == 0) {
        status = fly(&program);
    }
    monitor_end(&program.monitor);
    return close_all(&program) == 0 ? status : EXIT_RUN;
}
