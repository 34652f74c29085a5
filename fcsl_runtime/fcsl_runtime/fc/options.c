/* SPDX-License-Identifier: Apache-2.0
 *
 * The command line of fcsl-fc.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_hal.h"
#include "options.h"
#include "usage.h"

#include <getopt.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef FCSL_VERSION /* CMake defines it, from package.xml */
#define FCSL_VERSION "of no package"
#endif

static const char USAGE[] =
    "usage: fcsl-fc LIBRARY.so [options]\n"
    "Runs a compiled machine as a process of its own (docs/hardware/flight_computer.md).\n"
    "\n"
    "  --machine NAME          which machine, when the library holds several\n"
    "  --hal HAL               stub: no hardware (default); wire:SPEC: a simulator or rig at the other end, with SPEC "
    "one "
    "of\n"
    "                          " FCSL_WIRE_SPECS "\n"
    "                          zenoh:tcp:HOST:PORT (or zenoh-peer:): a simulator on the bus, each channel under its "
    "key\n"
    "                          the same with ,free-running behind it: whatever puts values there; waits for nobody\n"
    "                          ros:tcp:HOST:PORT: the topics of the channels in a ROS 2 graph, whose bridge connects "
    "there;\n"
    "                          ros:rmw_zenoh:tcp/HOST:PORT: the same by the router of rmw_zenoh there\n"
    "                          linux:PLAN: the sensors of this computer, as a plan of `fcsl board` says "
    "(docs/hardware/hal.md)\n"
    "                          composite:PLAN,wire:SPEC (or ,zenoh:…): these sensors, and all others from the "
    "simulator\n"
    "  --timeout SECONDS       how long to wait for the simulator's next message (default 2)\n"
    "  --board LIBRARY.so      the board that hw_* of algorithms reach (fcsl/fcsl_hw.h); default: simulated hardware\n"
    "  --guard PATH            the actuators belong to the fcsl-guard that listens on PATH (docs/hardware/arming.md)\n"
    "  --parameters FILE       begin with the values of a parameter file (docs/reference/variables.md) instead of the "
    "compiled ones\n"
    "  --ticks N               end after N ticks\n"
    "  --restore FILE          begin where the checkpoint in FILE was saved (docs/guide/recording.md), not at tick 0\n"
    "  --ignore-source-hash    take a checkpoint of other sources, if the layout of the machine is the same\n"
    "\n"
    "time\n"
    "  --rate realtime|max     realtime: at the machine's tick rate (default); max: as fast as possible\n"
    "                          (a simulator at the other end of a wire decides by itself)\n"
    "  --missed-deadline P     a tick that begins after the next one is due has missed its deadline. catch-up: missed\n"
    "                          ticks are made at once, 0.1 s of them at most (default); skip: they are not made; "
    "stop:\n"
    "                          the run ends with status 3\n"
    "  --realtime-priority N   SCHED_FIFO for the step thread, 1 to 99; threads of a board's devices have one less\n"
    "  --lock-memory           no page of the program leaves memory\n"
    "  --cpu N                 the step thread on processor N, all others elsewhere\n"
    "  --watchdog-ms N         report a tick that takes longer, with the instance it is in\n"
    "  --no-overrun-check      executes are not timed against max_wcet_us, so that results do not depend on the "
    "computer;\n"
    "                          --rate max and a simulator at the other end of a wire imply it\n"
    "  --exit-on-stdin-eof     the end of standard input ends the run, as a signal does\n"
    "\n"
    "what others see\n"
    "  --socket ADDRESS        serve variables (docs/reference/variables.md) on this Unix socket, or on tcp:HOST:PORT\n"
    "  --token FILE            of the TCP server: clients show what is in it; made when absent\n"
    "  --checkpoints DIR       where `save` and `restore` of clients find the files that they name\n"
    "  --telemetry ADDRESS     send values as UDP (docs/guide/monitoring.md) to udp:HOST:PORT, or of every N-th tick "
    "to "
    "udp:HOST:PORT/N\n"
    "  --telemetry-fields GLOBS  which, as path globs with commas between\n"
    "                          (default machine.*,*.inputs.*,*.outputs.*,*.counters.*)\n"
    "  --observers tcp:HOST:PORT  put the values of all channels on a bus of their own (docs/reference/transports.md), "
    "which listens "
    "there\n"
    "  --ros ADDRESS           publish the machine's ROS 2 topics: tcp:HOST:PORT, to listen on for a bridge of DDS, "
    "or\n"
    "                          rmw_zenoh:tcp/HOST:PORT, the router of rmw_zenoh (docs/reference/transports.md)\n"
    "  --paused                start paused: ticks are made by commands until `resume`\n"
    "  --record BAG            record to this folder, which must not exist\n"
    "  --record-fields GLOBS   what of every tick, as path globs with commas between (default *.inputs.*,*.outputs.*)\n"
    "  --record-split SPLIT    begin another file after, and keep, some of "
    "seconds=60,megabytes=100,files=10,around=30\n"
    "                          (docs/guide/recording.md)\n"
    "  --record-policy P       when the disk is too slow: wait makes the tick wait, drop leaves records out and counts "
    "them\n"
    "                          (default: drop in real time, else wait)\n"
    "  --namespace NS          ROS namespace of topics, and of the keys on the bus\n"
    "  --summary FILE       at the end write state, health, counters and histograms there, as JSON\n"
    "  --version            print name and version\n"
    "  -h, --help\n\n"
    "example: fcsl-fc build/libcraft.so --hal wire:udp:127.0.0.1:7600 --record flight\n";

enum { ERROR_BYTES = 512 };

typedef enum { TEXT, NUMBER, SECONDS, FLAG, WORD } kind_t;

/* An option of the command line: where it goes, and for numbers what it may be. */
typedef struct {
    const char *name;
    kind_t kind;
    size_t offset; /* in options_t; of WORD: none */
    uint64_t min; /* of SECONDS: in ms */
    uint64_t max;
    int (*read)(const char *text, options_t *options); /* WORD */
} entry_t;

/* composite:PLAN,wire:SPEC or composite:PLAN,zenoh:…; returns what stands behind the comma, or null after a message. */
static const char *read_composite(const char *text, options_t *options)
{
    const char *plan = text + strlen(OPTIONS_COMPOSITE);
    const char *wire = strstr(plan, "," OPTIONS_WIRE);
    const char *comma = wire != NULL ? wire : strstr(plan, ",zenoh");
    const size_t length = comma != NULL ? (size_t)(comma - plan) : 0u;
    if (length == 0u || length >= sizeof options->composite_plan) {
        (void)usage_error(
            "--hal composite:PLAN,HAL needs the plan of a board and wire:SPEC or zenoh:tcp:HOST:PORT, not ", text);
        return NULL;
    }
    memcpy(options->composite_plan, plan, length);
    options->composite_plan[length] = '\0';
    return comma + 1;
}

static int read_hal(const char *text, options_t *options)
{
    fcsl_error_t error;
    options->composite_plan[0] = '\0';
    if (strncmp(text, OPTIONS_COMPOSITE, strlen(OPTIONS_COMPOSITE)) == 0) {
        text = read_composite(text, options);
        if (text == NULL) {
            return -1;
        }
    }
    const int is_wire = strncmp(text, OPTIONS_WIRE, strlen(OPTIONS_WIRE)) == 0;
    options->peer = strcmp(text, "stub") == 0 ? NULL : text;
    if (options->peer == NULL) {
        return 0;
    }
    if (options_hal_is_ros(options) || options_hal_is_linux(options)) {
        return 0;
    }
    if (!is_wire && strncmp(text, "zenoh", strlen("zenoh")) != 0) {
        return usage_error("--hal must be stub, linux:PLAN, wire:SPEC, zenoh:tcp:HOST:PORT, composite:PLAN,HAL or "
                           "ros:tcp:HOST:PORT, not ",
                           text);
    }
    const int failed =
        is_wire ? fcsl_wire_check(text + strlen(OPTIONS_WIRE), &error) : fcsl_hal_bus_check(text, &error);
    return failed ? usage_error(is_wire ? "--hal wire: " : "--hal ", error.text) : 0;
}

static int read_rate(const char *text, options_t *options)
{
    options->realtime = strcmp(text, "realtime") == 0;
    return options->realtime || strcmp(text, "max") == 0 ? 0
                                                         : usage_error("--rate must be realtime or max, not ", text);
}

static int read_missed_deadline(const char *text, options_t *options)
{
    static const char *const names[] = {[MISSED_CATCH_UP] = "catch-up", [MISSED_SKIP] = "skip", [MISSED_STOP] = "stop"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (strcmp(text, names[i]) == 0) {
            options->missed_deadline = (missed_deadline_t)i;
            options->missed_deadline_given = 1;
            return 0;
        }
    }
    return usage_error("--missed-deadline must be catch-up, skip or stop, not ", text);
}

static int read_record_policy(const char *text, options_t *options)
{
    options->record_policy = strcmp(text, "wait") == 0 ? RECORD_WAIT : RECORD_DROP;
    return options->record_policy == RECORD_WAIT || strcmp(text, "drop") == 0
               ? 0
               : usage_error("--record-policy must be wait or drop, not ", text);
}

static int read_help(const char *text, options_t *options)
{
    (void)text;
    (void)options;
    (void)fputs(USAGE, stdout);
    return 1;
}

static int read_version(const char *text, options_t *options)
{
    (void)text;
    (void)options;
    (void)puts("fcsl-fc " FCSL_VERSION);
    return 1;
}

#define TO(member) offsetof(options_t, member)

static const entry_t ENTRIES[] = {
    {.name = "machine", .kind = TEXT, .offset = TO(machine)},
    {.name = "hal", .kind = WORD, .read = read_hal},
    {.name = "timeout", .kind = SECONDS, .offset = TO(timeout_ms), .min = 1, .max = 3600000},
    {.name = "board", .kind = TEXT, .offset = TO(board)},
    {.name = "guard", .kind = TEXT, .offset = TO(guard)},
    {.name = "parameters", .kind = TEXT, .offset = TO(parameters)},
    {.name = "ticks", .kind = NUMBER, .offset = TO(ticks), .min = 1, .max = INT64_MAX},
    {.name = "restore", .kind = TEXT, .offset = TO(restore)},
    {.name = "ignore-source-hash", .kind = FLAG, .offset = TO(ignore_source_hash)},
    {.name = "rate", .kind = WORD, .read = read_rate},
    {.name = "missed-deadline", .kind = WORD, .read = read_missed_deadline},
    {.name = "realtime-priority", .kind = NUMBER, .offset = TO(priority), .min = 1, .max = 99},
    {.name = "lock-memory", .kind = FLAG, .offset = TO(lock_memory)},
    {.name = "cpu", .kind = NUMBER, .offset = TO(cpu), .min = 0, .max = 1023},
    {.name = "watchdog-ms", .kind = NUMBER, .offset = TO(watchdog_ms), .min = 1, .max = 3600000},
    {.name = "socket", .kind = TEXT, .offset = TO(socket)},
    {.name = "token", .kind = TEXT, .offset = TO(token)},
    {.name = "no-overrun-check", .kind = FLAG, .offset = TO(no_overrun_check)},
    {.name = "exit-on-stdin-eof", .kind = FLAG, .offset = TO(exit_on_stdin_eof)},
    {.name = "paused", .kind = FLAG, .offset = TO(paused)},
    {.name = "checkpoints", .kind = TEXT, .offset = TO(checkpoints)},
    {.name = "telemetry", .kind = TEXT, .offset = TO(telemetry)},
    {.name = "telemetry-fields", .kind = TEXT, .offset = TO(telemetry_fields)},
    {.name = "observers", .kind = TEXT, .offset = TO(observers)},
    {.name = "ros", .kind = TEXT, .offset = TO(ros)},
    {.name = "record", .kind = TEXT, .offset = TO(record)},
    {.name = "record-fields", .kind = TEXT, .offset = TO(record_fields)},
    {.name = "record-split", .kind = TEXT, .offset = TO(record_split)},
    {.name = "record-policy", .kind = WORD, .read = read_record_policy},
    {.name = "namespace", .kind = TEXT, .offset = TO(name_space)},
    {.name = "summary", .kind = TEXT, .offset = TO(summary_file)},
    {.name = "help", .kind = FLAG, .read = read_help},
    {.name = "version", .kind = FLAG, .read = read_version},
};
enum { ENTRY_COUNT = sizeof ENTRIES / sizeof ENTRIES[0], TIMEOUT_MS = 2000 };

static int read_option(const entry_t *entry, const char *text, options_t *options)
{
    char *place = (char *)options + entry->offset;
    if (entry->read != NULL) {
        return entry->read(text, options);
    }
    switch (entry->kind) {
    case TEXT:
        memcpy(place, &text, sizeof text);
        return 0;
    case NUMBER:
    case SECONDS: {
        uint64_t number = 0;
        const int status = entry->kind == NUMBER ? usage_number(entry->name, text, entry->min, entry->max, &number)
                                                 : usage_seconds(entry->name, text, entry->min, entry->max, &number);
        memcpy(place, &number, status == 0 ? sizeof number : 0u);
        return status;
    }
    default: {
        const int set = 1;
        memcpy(place, &set, sizeof set);
        return 0;
    }
    }
}

static int has_simulator(const options_t *options)
{
    return options->peer != NULL && !options_hal_is_ros(options) && !options_hal_is_linux(options);
}

/* Options that say nothing together. */
static int check(const options_t *options)
{
    if (options->paused && options->socket == NULL) {
        return usage_error("--paused needs --socket: only commands make ticks then", "");
    }
    if (options->paused && options_hal_is_composite(options)) {
        return usage_error("--paused does not go with --hal composite:…: real devices do not wait", "");
    }
    if (options_hal_is_composite(options) && fcsl_hal_bus_runs_free(options->peer)) {
        return usage_error("--hal composite:…,free-running: there is no simulator beside the board; write linux:PLAN",
                           "");
    }
    if (options->checkpoints != NULL && options->socket == NULL) {
        return usage_error("--checkpoints needs --socket: its files are what clients name", "");
    }
    if (options->token != NULL && options->socket == NULL) {
        return usage_error("--token needs --socket: it is the token of a TCP server", "");
    }
    if (options->timeout_ms != 0 && !has_simulator(options)) {
        return usage_error("--timeout needs --hal wire:SPEC or zenoh:…: it is how long to wait for the simulator", "");
    }
    if (options->timeout_ms != 0 && fcsl_hal_bus_runs_free(options->peer)) {
        return usage_error("--timeout does not go with ,free-running: nobody waits for the simulator", "");
    }
    if (options->name_space[0] != '\0' && options->record == NULL && options->observers == NULL &&
        options->ros == NULL && options->parameters == NULL &&
        (options->peer == NULL || options_hal_is_linux(options) ||
         strncmp(options->peer, OPTIONS_WIRE, strlen(OPTIONS_WIRE)) == 0)) {
        return usage_error("--namespace needs --record, --observers, --ros, --parameters or --hal zenoh:…: it is of "
                           "topics, of keys of the bus, "
                           "and of sections of a parameter file",
                           "");
    }
    if (options->ignore_source_hash && options->restore == NULL) {
        return usage_error("--ignore-source-hash needs --restore", "");
    }
    if (options->restore != NULL && options->parameters != NULL) {
        return usage_error("--parameters does not go with --restore: the checkpoint has the parameters of its run", "");
    }
    if (options->restore != NULL && has_simulator(options)) {
        return usage_error("--restore goes without a simulator: that begins at tick 0", "");
    }
    if ((options->record_fields != NULL || options->record_split != NULL || options->record_policy != RECORD_BY_PACE) &&
        options->record == NULL) {
        return usage_error("--record-fields, --record-split and --record-policy need --record", "");
    }
    if (options->telemetry_fields != NULL && options->telemetry == NULL) {
        return usage_error("--telemetry-fields needs --telemetry", "");
    }
    if (options->missed_deadline_given && !options->realtime) {
        return usage_error("--missed-deadline is for ticks that the clock paces: it does not go with --rate max", "");
    }
    if (options->guard != NULL && !options->realtime && options->peer == NULL) {
        return usage_error(
            "--guard with --rate max would move real actuators faster than the machine's time; use --rate realtime",
            "");
    }
    if (options->priority > 0 && !options->realtime && options->peer == NULL) {
        return usage_error(
            "--realtime-priority with --rate max would leave no processor to anything else; use --rate realtime", "");
    }
    return 0;
}

int options_read(int argc, char **argv, options_t *options)
{
    struct option table[ENTRY_COUNT + 1] = {0};
    for (int i = 0; i < ENTRY_COUNT; i++) {
        table[i] = (struct option){
            .name = ENTRIES[i].name, .has_arg = ENTRIES[i].kind == FLAG ? no_argument : required_argument, .val = i};
    }
    *options = (options_t){.name_space = "", .cpu = OPTIONS_ANY_CPU, .realtime = 1};
    int option = 0;
    while ((option = getopt_long(argc, argv, "h", table, NULL)) != -1) {
        if (option == '?') {
            (void)fputs("Try `fcsl-fc --help`.\n", stderr);
            return -1;
        }
        const int status = option == 'h' ? read_help(NULL, options) : read_option(&ENTRIES[option], optarg, options);
        if (status != 0) {
            return status;
        }
    }
    if (usage_library(argc, argv, &options->library) != 0) {
        return -1;
    }
    const int status = check(options);
    if (options->timeout_ms == 0) {
        options->timeout_ms = TIMEOUT_MS;
    }
    return status;
}
