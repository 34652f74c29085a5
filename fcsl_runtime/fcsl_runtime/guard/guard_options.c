/* SPDX-License-Identifier: Apache-2.0
 *
 * The command line of fcsl-guard.
 */
#define _GNU_SOURCE
#include "guard_options.h"
#include "usage.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>

#ifndef FCSL_VERSION /* CMake defines it, from package.xml */
#define FCSL_VERSION "of no package"
#endif

static const char USAGE[] =
    "usage: fcsl-guard LIBRARY.so --slot PATH --actuator CHANNEL=DRIVER ... [options]\n"
    "       fcsl-guard LIBRARY.so --slot PATH --board PLAN [options]\n"
    "Owns the actuators of a machine: they get the commands of fcsl-fc --guard PATH while it arms them, and their "
    "safe\n"
    "values when it disarms them or falls silent (docs/hardware/arming.md).\n"
    "\n"
    "  --slot PATH             the socket on which fcsl-fc --guard PATH gets the slot for its commands\n"
    "  --actuator CHANNEL=DRIVER[.SIGNAL][:DEVICE]\n"
    "                          what drives an actuator channel; once for each. DRIVER is NAME or LIBRARY.so:NAME\n"
    "                          (docs/hardware/hal.md). Without SIGNAL: the driver's only signal of the channel's type\n"
    "  --actuator CHANNEL=none nothing drives it\n"
    "  --board PLAN            the outputs of a board's plan drive every actuator channel, in the place of --actuator\n"
    "  --machine NAME          which machine, when the library holds several\n"
    "  --period-ms N           every N ms the actuators are written (default 2)\n"
    "  --realtime-priority N   SCHED_FIFO, 1 to 99: above that of the flight program\n"
    "  --lock-memory           no page of the program leaves memory\n"
    "  --version               print name and version\n"
    "  -h, --help\n\n"
    "example: fcsl-guard build/libcraft.so --slot /run/craft.slot --board craft.plan\n";

enum { PERIOD_MS = 2, PERIOD_MS_MAX = 1000, PRIORITY_MAX = 99 };
enum { ACTUATOR = 1, BOARD, MACHINE, SLOT, PERIOD, PRIORITY, LOCK_MEMORY, VERSION, HELP };

static const struct option OPTIONS[] = {
    {"actuator", required_argument, NULL, ACTUATOR},
    {"board", required_argument, NULL, BOARD},
    {"machine", required_argument, NULL, MACHINE},
    {"slot", required_argument, NULL, SLOT},
    {"period-ms", required_argument, NULL, PERIOD},
    {"realtime-priority", required_argument, NULL, PRIORITY},
    {"lock-memory", no_argument, NULL, LOCK_MEMORY},
    {"version", no_argument, NULL, VERSION},
    {"help", no_argument, NULL, HELP},
    {NULL, 0, NULL, 0},
};

static int read_option(int option, const char *text, options_t *options)
{
    switch (option) {
    case ACTUATOR:
        options->actuators[options->actuator_count++] = text;
        return 0;
    case BOARD:
        options->board = text;
        return 0;
    case MACHINE:
        options->machine = text;
        return 0;
    case SLOT:
        options->slot = text;
        return 0;
    case PERIOD:
        return usage_number("period-ms", text, 1, PERIOD_MS_MAX, &options->period_ms);
    case PRIORITY:
        return usage_number("realtime-priority", text, 1, PRIORITY_MAX, &options->priority);
    case LOCK_MEMORY:
        options->lock_memory = 1;
        return 0;
    case VERSION:
        (void)puts("fcsl-guard " FCSL_VERSION);
        return 1;
    case HELP:
    case 'h':
        (void)fputs(USAGE, stdout);
        return 1;
    default:
        (void)fputs("Try `fcsl-guard --help`.\n", stderr);
        return -1;
    }
}

int options_read(int argc, char **argv, options_t *options)
{
    *options = (options_t){.period_ms = PERIOD_MS};
    options->actuators = calloc((size_t)argc, sizeof *options->actuators);
    if (options->actuators == NULL) {
        return usage_error("out of memory", "");
    }
    int option = 0;
    while ((option = getopt_long(argc, argv, "h", OPTIONS, NULL)) != -1) {
        const int status = read_option(option, optarg, options);
        if (status != 0) {
            return status;
        }
    }
    if (usage_library(argc, argv, &options->library) != 0) {
        return -1;
    }
    if (options->slot == NULL) {
        return usage_error("--slot PATH is missing: where fcsl-fc --guard PATH gets the slot for its commands", "");
    }
    if (options->board != NULL && options->actuator_count > 0u) {
        return usage_error("--board with --actuator: the board's plan says what drives every actuator channel", "");
    }
    return 0;
}

void options_free(options_t *options)
{
    free(options->actuators);
    options->actuators = NULL;
}
