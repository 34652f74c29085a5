/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "options.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char USAGE[] =
    "usage: fcsl-fc LIBRARY.so [options]\n"
    "Runs a compiled machine as a process of its own.\n"
    "\n"
    "  --machine NAME          which machine, when the library holds several\n"
    "  --hal stub|wire:PATH    stub: no hardware (default); wire: lock-step with the simulator that listens on PATH\n"
    "  --board LIBRARY.so      the board that hw_* of algorithms reach (fcsl/fcsl_hw.h); default: simulated hardware\n"
    "  --socket PATH           serve commands (newline-delimited JSON) on this Unix socket\n"
    "  --record BAG            record to this folder, which must not exist\n"
    "  --namespace NS          ROS namespace of the recorded topics\n"
    "  --ticks N               end after N ticks\n"
    "  --rate realtime|free    realtime: at the machine's tick rate (default); free: as fast as possible\n"
    "                          (a HAL that paces, like wire, decides by itself)\n"
    "  --paused                start paused: ticks are made by commands until `resume`\n"
    "  --timeout-ms N          how long to wait for the simulator's next frame (default 2000)\n"
    "  --help\n";

static int complain(const char *what, const char *which)
{
    (void)fprintf(stderr, "fcsl-fc: %s%s\nTry `fcsl-fc --help`.\n", what, which);
    return -1;
}

static int read_number(const char *text, uint64_t max, uint64_t *value)
{
    char *end = NULL;
    errno = 0;
    const unsigned long long number = strtoull(text, &end, 10);
    if (text[0] < '0' || text[0] > '9' || *end != '\0' || errno != 0 || number == 0 || number > max) {
        return -1;
    }
    *value = number;
    return 0;
}

static int read_hal(const char *text, options_t *options)
{
    if (strcmp(text, "stub") == 0) {
        options->wire = NULL;
        return 0;
    }
    if (strncmp(text, "wire:", 5) == 0 && text[5] != '\0') {
        options->wire = text + 5;
        return 0;
    }
    return complain("--hal must be stub or wire:PATH, not ", text);
}

static int read_rate(const char *text, options_t *options)
{
    options->realtime = strcmp(text, "realtime") == 0;
    return options->realtime || strcmp(text, "free") == 0 ? 0 : complain("--rate must be realtime or free, not ", text);
}

static int read_option(int option, options_t *options)
{
    uint64_t number = 0;
    switch (option) {
    case 'm':
        options->machine = optarg;
        return 0;
    case 'H':
        return read_hal(optarg, options);
    case 'b':
        options->board = optarg;
        return 0;
    case 's':
        options->socket = optarg;
        return 0;
    case 'r':
        options->record = optarg;
        return 0;
    case 'n':
        options->name_space = optarg;
        return 0;
    case 't':
        return read_number(optarg, INT64_MAX, &options->ticks) == 0
                   ? 0
                   : complain("--ticks needs a positive integer, not ", optarg);
    case 'R':
        return read_rate(optarg, options);
    case 'p':
        options->paused = 1;
        return 0;
    case 'T':
        if (read_number(optarg, 3600000, &number) != 0) {
            return complain("--timeout-ms needs an integer from 1 to 3600000, not ", optarg);
        }
        options->timeout_ms = (uint32_t)number;
        return 0;
    case 'h':
        (void)fputs(USAGE, stdout);
        return 1;
    default:
        (void)fputs("Try `fcsl-fc --help`.\n", stderr);
        return -1;
    }
}

int options_read(int argc, char **argv, options_t *options)
{
    static const struct option table[] = {
        {"machine", required_argument, NULL, 'm'}, {"hal", required_argument, NULL, 'H'},
        {"board", required_argument, NULL, 'b'},   {"socket", required_argument, NULL, 's'},
        {"record", required_argument, NULL, 'r'},  {"namespace", required_argument, NULL, 'n'},
        {"ticks", required_argument, NULL, 't'},   {"rate", required_argument, NULL, 'R'},
        {"paused", no_argument, NULL, 'p'},        {"timeout-ms", required_argument, NULL, 'T'},
        {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0},
    };
    *options = (options_t){.name_space = "", .timeout_ms = 2000, .realtime = 1};
    int option = 0;
    while ((option = getopt_long(argc, argv, "h", table, NULL)) != -1) {
        const int status = read_option(option, options);
        if (status != 0) {
            return status;
        }
    }
    if (optind + 1 != argc) {
        return complain(optind == argc ? "which machine library?" : "one machine library, not also ",
                        optind == argc ? "" : argv[optind + 1]);
    }
    options->library = argv[optind];
    if (options->paused && options->socket == NULL) {
        return complain("--paused needs --socket: only commands make ticks then", "");
    }
    return 0;
}
