/* SPDX-License-Identifier: Apache-2.0
 *
 * Telemetry: what ticks left, as datagrams of UDP to one receiver (docs/guide/monitoring.md has the bytes). Flight program and
 * simulator send through this file.
 *
 * The sender has one thread of its own, which reads the host's history and never meets the step thread; all memory is taken by
 * open. Nothing is ever waited for: what the network does not take is counted and gone.
 */
#ifndef FCSL_TELEMETRY_H
#define FCSL_TELEMETRY_H

#include "fcsl/fcsl_vars.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_telemetry fcsl_telemetry_t;

/* What is sent unless the host is told otherwise; health is one of the outputs. */
#define FCSL_TELEMETRY_FIELDS "machine.*,*.inputs.*,*.outputs.*,*.counters.*"

typedef struct {
    const char *address; /* udp:HOST:PORT, or udp:HOST:PORT/EVERY: of every EVERY-th tick */
    const char *fields;  /* globs over the paths of the blocks, with commas between; null: FCSL_TELEMETRY_FIELDS */
    const fcsl_machine_t *machine; /* whose ticks they are */
    const char *views;             /* of its host (fcsl_run_views); null: those of the machine */
    int realtime;                  /* non-zero: ticks keep to the clock on the wall */
} fcsl_telemetry_options_t;

/* Takes the address, chooses the fields; nothing is sent before fcsl_telemetry_start. Blocks, their tables and the machine must
 * outlive it, and something must have been published. Null with `error`. */
fcsl_telemetry_t *fcsl_telemetry_open(const fcsl_telemetry_options_t *options, const fcsl_vars_block_t *blocks,
                                      uint32_t block_count, const fcsl_history_t *history, fcsl_error_t *error);
int fcsl_telemetry_start(fcsl_telemetry_t *telemetry, fcsl_error_t *error);
/* Sends what the history still has, ends the thread. The counters stay. Accepts null. */
void fcsl_telemetry_stop(fcsl_telemetry_t *telemetry);
/* Stops, too. Accepts null. */
void fcsl_telemetry_close(fcsl_telemetry_t *telemetry);

typedef struct {
    uint64_t packets;        /* of data */
    uint64_t configurations; /* sendings of the configuration that were begun */
    uint64_t datagrams;      /* that the system took */
    uint64_t failures;       /* that it did not take, or that came back because nobody listens */
    uint64_t overwritten;         /* packets that were due, but the history of their ticks was overwritten first */
} fcsl_telemetry_counters_t;

void fcsl_telemetry_count(const fcsl_telemetry_t *telemetry, fcsl_telemetry_counters_t *counters);
/* The same as member `telemetry` of the reply to `stats`. */
void fcsl_telemetry_stats(const fcsl_telemetry_t *telemetry, fcsl_vars_out_t *out);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_TELEMETRY_H */
