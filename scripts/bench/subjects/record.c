/* SPDX-License-Identifier: Apache-2.0
 *
 * What recording costs the thread that steps, and what the writer sustains:
 *   record step LIBRARY FOLDER ROUNDS     ns per tick of a run that is recorded as in real time and of one that is not, in turns;
 *                                         the same of single ticks at 1 kHz; instructions per tick
 *   record write LIBRARY FOLDER TICKS     messages per second of a lossless recording, from the first tick to the closed bag
 * Ticks are made one by one, as a host makes them. Prints JSON.
 */
#define _GNU_SOURCE
#include "stepped.h"
#include "timing.h"

#include <dlfcn.h>
#include <fcsl/fcsl_run.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

/* A burst fits into the ring; in the pause behind it the writer catches up. */
enum { BURST_TICKS = 4000, PAUSE_NS = 150000000, PACED_TICKS = 2000, PERIOD_NS = 1000000, COUNTED_TICKS = 5 };

static fcsl_run_t *open_run(const char *library)
{
    fcsl_error_t error = {""};
    fcsl_run_t *run = fcsl_run_open(library, NULL, NULL, &error);
    if (run == NULL) {
        fprintf(stderr, "record: %s\n", error.text);
        exit(1);
    }
    return run;
}

static void record(fcsl_run_t *run, const char *folder, const char *name, int lossless)
{
    char bag[512];
    fcsl_error_t error = {""};
    (void)snprintf(bag, sizeof bag, "%s/%s", folder, name);
    const fcsl_record_options_t options = {.bag = bag, .name_space = "", .lossless = lossless};
    if (fcsl_run_record(run, &options, &error) != 0) {
        fprintf(stderr, "record: %s\n", error.text);
        exit(1);
    }
}

static void tick(fcsl_run_t *run)
{
    fcsl_error_t error;
    if (fcsl_run_step(run, 1, &error) != 0) {
        fprintf(stderr, "record: %s\n", error.text);
        exit(1);
    }
}

static void close_run(fcsl_run_t *run)
{
    fcsl_error_t error = {""};
    if (fcsl_run_close(run, &error) != 0) {
        fprintf(stderr, "record: %s\n", error.text);
        exit(1);
    }
}

static double burst(fcsl_run_t *run)
{
    const double begun = now_ns();
    for (int i = 0; i < BURST_TICKS; i++) {
        tick(run);
    }
    return (now_ns() - begun) / BURST_TICKS;
}

static void pause_ns(long ns)
{
    const struct timespec pause = {.tv_nsec = ns};
    (void)nanosleep(&pause, NULL);
}

/* The instructions of a tick, of COUNTED_TICKS a round: medians do not help here, so the mean; a tick of a full quarter of the ring wakes the writer. */
static double instructions(fcsl_run_t *run, int rounds)
{
    fcsl_error_t error;
    const int ticks = COUNTED_TICKS * rounds;
    uint64_t sum = 0;
    for (int i = 0; i < ticks; i++) {
        stepped_arm((uintptr_t)dlsym(RTLD_DEFAULT, "fcsl_run_step"));
        (void)fcsl_run_step(run, 1, &error);
        sum += stepped.all;
    }
    return (double)sum / ticks;
}

static void put(const char *name, spread_t of, const char *behind)
{
    printf("\"%s\": %.2f, \"%s_low\": %.2f, \"%s_high\": %.2f%s", name, of.median, name, of.low, name, of.high, behind);
}

static void time_steps(const char *library, const char *folder, int rounds)
{
    fcsl_run_t *runs[2] = {open_run(library), open_run(library)};
    double *ns[2] = {allocate((size_t)rounds * sizeof(double)), allocate((size_t)rounds * sizeof(double))};
    double *added = allocate((size_t)rounds * sizeof(double));
    double *paced[2] = {allocate(PACED_TICKS * sizeof(double)), allocate(PACED_TICKS * sizeof(double))};
    record(runs[1], folder, "stepped", 0);
    for (int i = 0; i < rounds; i++) {
        ns[0][i] = burst(runs[0]);
        ns[1][i] = burst(runs[1]);
        added[i] = ns[1][i] - ns[0][i];
        pause_ns(PAUSE_NS);
    }
    for (int i = 0; i < PACED_TICKS; i++) {
        for (int recorded = 0; recorded < 2; recorded++) {
            const double begun = now_ns();
            tick(runs[recorded]);
            paced[recorded][i] = now_ns() - begun;
            pause_ns(PERIOD_NS / 2);
        }
    }
    const double plain = stepped_begin() == 0 ? instructions(runs[0], rounds) : 0;
    const double recorded = instructions(runs[1], rounds);
    const uint64_t dropped = fcsl_run_record_dropped(runs[1]);
    printf("{");
    put("plain_ns", spread(ns[0], rounds), ", ");
    put("recorded_ns", spread(ns[1], rounds), ", ");
    put("added_ns", spread(added, rounds), ", ");
    put("paced_plain_ns", spread(paced[0], PACED_TICKS), ", ");
    put("paced_recorded_ns", spread(paced[1], PACED_TICKS), ", ");
    printf("\"plain_instructions\": %.1f, \"recorded_instructions\": %.1f, \"dropped\": %" PRIu64 "}\n", plain,
           recorded, dropped);
    close_run(runs[0]);
    close_run(runs[1]);
}

static double processor_ns(void)
{
    struct rusage usage;
    (void)getrusage(RUSAGE_SELF, &usage);
    return (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) * 1e9 +
           (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e3;
}

static void time_writer(const char *library, const char *folder, uint64_t ticks)
{
    fcsl_run_t *run = open_run(library);
    fcsl_error_t error;
    record(run, folder, "written", 1);
    const double begun = now_ns();
    const double begun_processor = processor_ns();
    if (fcsl_run_step(run, ticks, &error) != 0) {
        fprintf(stderr, "record: %s\n", error.text);
        exit(1);
    }
    close_run(run);
    printf("{\"ticks\": %" PRIu64 ", \"wall_s\": %.4f, \"processor_s\": %.4f}\n", ticks, (now_ns() - begun) * 1e-9,
           (processor_ns() - begun_processor) * 1e-9);
}

int main(int argc, char **argv)
{
    if (argc == 5 && strcmp(argv[1], "step") == 0) {
        time_steps(argv[2], argv[3], atoi(argv[4]));
        return 0;
    }
    if (argc == 5 && strcmp(argv[1], "write") == 0) {
        time_writer(argv[2], argv[3], strtoull(argv[4], NULL, 10));
        return 0;
    }
    fprintf(stderr, "usage: record step LIBRARY FOLDER ROUNDS | record write LIBRARY FOLDER TICKS\n");
    return 2;
}
