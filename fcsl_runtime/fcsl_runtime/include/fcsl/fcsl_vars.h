/* SPDX-License-Identifier: Apache-2.0
 *
 * The variable server: every value of a host by its path, over a socket (docs/reference/variables.md). Flight program and simulator
 * serve through this file.
 *
 * The server has one thread of its own. What only reads (get, eval, subscribe, state, stats) takes the host's history
 * and never meets the step thread; what changes something waits in one slot until the step thread takes it between two
 * ticks, at most one command at a time. Clients, bytes, replies and time are bounded, and all memory is taken by open.
 */
#ifndef FCSL_VARS_H
#define FCSL_VARS_H

#include "fcsl/fcsl_history.h"
#include "fcsl/fcsl_run.h"
#include "fcsl/fcsl_tick_stats.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_vars fcsl_vars_t;

/* What is served of one piece of memory: block i describes part i of the history. The tables must outlive the server. */
typedef struct {
    const char *prefix;            /* before every path, with a dot between; "" for none */
    const fcsl_field_t *fields;    /* the machine's own, or a model's */
    uint32_t field_count;
    const fcsl_machine_t *machine; /* null: not a machine */
    const char *const *writers;    /* per field: who overwrites what a client sets, or null; null: nobody (a machine's
                                    * connections, channels and instances need not be listed) */
} fcsl_vars_block_t;

typedef enum {
    FCSL_VARS_OK,
    FCSL_VARS_REFUSED, /* `error` says why */
    FCSL_VARS_NOT_PAUSED, /* needs a paused host */
    FCSL_VARS_ENDED,   /* the run is over; `error` says why */
    FCSL_VARS_FAILED   /* the run has just failed; `error` says why */
} fcsl_vars_status_t;

/* Where `stats` writes. */
typedef struct json_out fcsl_vars_out_t;

/* What the host does for a client. A null function: this host does not offer it. All but `stats` are called by
 * fcsl_vars_serve, on the thread that owns the memory. */
typedef struct {
    void *ctx;
    fcsl_run_t *run;        /* the machine among the blocks: commands on a machine act on it; null: no block is one */
    int accepts_samples;    /* clients may attach and feed sensor channels; 0: the host alone feeds them */
    /* Writes whole scalars from scalar `element` on into a field of a block that is no machine. The value is checked. */
    void (*set)(void *ctx, uint32_t block, uint32_t field, uint32_t element, const void *bytes, uint32_t size);
    /* A checkpoint was taken of the run: what the host keeps of this moment. Null: nothing. */
    void (*save)(void *ctx);
    /* A checkpoint: what fcsl_run_restore takes, and what the machine's hw_* builtins reach. The server's thread has checked it. */
    fcsl_vars_status_t (*restore)(void *ctx, const void *data, uint32_t size, const fcsl_hw_sim_t *hardware,
                                  fcsl_error_t *error);
    fcsl_vars_status_t (*pause)(void *ctx, int paused, fcsl_error_t *error);
    fcsl_vars_status_t (*tick)(void *ctx, uint64_t count, fcsl_error_t *error); /* publishes every tick */
    /* Both wait for the disk: a host that is not paused answers FCSL_VARS_NOT_PAUSED. */
    fcsl_vars_status_t (*record)(void *ctx, const char *bag, const char *name_space, fcsl_error_t *error);
    fcsl_vars_status_t (*stop_recording)(void *ctx, fcsl_error_t *error);
    void (*publish)(void *ctx); /* into the history; after every command, before it is acknowledged */
    /* On the server's thread, at any time: writes what the host counts, with fcsl_vars_number and what follows it below. */
    void (*stats)(void *ctx, fcsl_vars_out_t *out);
} fcsl_vars_host_t;

typedef struct {
    const char *address; /* path of a Unix socket, or tcp:HOST:PORT (numeric; port 0: any that is free) */
    const char *token; /* file with the token of a TCP server, made when absent; null for a Unix socket */
    const char *checkpoints; /* folder of the checkpoints that clients name; null: they can name none */
} fcsl_vars_options_t;

/* Listens; nothing is served before fcsl_vars_start. Something must have been published by then. Null with `error`. */
fcsl_vars_t *fcsl_vars_open(const fcsl_vars_options_t *options, const fcsl_vars_block_t *blocks, uint32_t block_count,
                            const fcsl_history_t *history, const fcsl_vars_host_t *host, fcsl_error_t *error);
int fcsl_vars_start(fcsl_vars_t *vars, fcsl_error_t *error);
/* Ends the thread (a command that still waits is answered with `ended`), closes and removes the socket. Accepts null. */
void fcsl_vars_close(fcsl_vars_t *vars);
/* Where it listens: as given, with the port that was taken. */
const char *fcsl_vars_address(const fcsl_vars_t *vars);

/* Step thread: acts on the waiting command, if there is one, and never waits. */
void fcsl_vars_serve(fcsl_vars_t *vars);
/* Step thread of a paused host: sleeps until a command waits, but at most until `deadline_ns` of the monotonic clock. */
void fcsl_vars_wait(fcsl_vars_t *vars, uint64_t deadline_ns);
/* The same, and serves clients meanwhile in place of the server's thread: to wake a thread for a command takes longer than
 * most commands. Then fcsl_vars_serve sends the reply, too. Not for a thread of high priority. */
void fcsl_vars_wait_serving(fcsl_vars_t *vars, uint64_t deadline_ns);
/* Leaves clients to the server's thread again: before the host runs on, or ends. */
void fcsl_vars_stop_serving(fcsl_vars_t *vars);
/* Any thread: ends either sleep. */
void fcsl_vars_wake(fcsl_vars_t *vars);

/* Members of the reply to `stats`: a number, and an object of what is written until its end. */
void fcsl_vars_number(fcsl_vars_out_t *out, const char *name, uint64_t value);
void fcsl_vars_begin(fcsl_vars_out_t *out, const char *name);
void fcsl_vars_end(fcsl_vars_out_t *out);
/* A summary, and `buckets`: pairs of a bucket's largest value and its count, of those that hold any. */
void fcsl_vars_histogram(fcsl_vars_out_t *out, const char *name, const fcsl_histogram_t *histogram);
/* What every tick loop counts and times; of deadlines and the watchdog writes who has them. */
void fcsl_vars_tick_stats(fcsl_vars_out_t *out, const fcsl_tick_stats_t *stats);
/* `lost_requests`: of each transition that has lost any in `data`, a machine struct. */
void fcsl_vars_lost_requests(fcsl_vars_out_t *out, const fcsl_machine_t *machine, const uint8_t *data);
/* `requirements`: the verdict on each by its id. `data`: of fcsl_run_gather_verdicts, or a copy. */
void fcsl_vars_requirements(fcsl_vars_out_t *out, const fcsl_run_t *run, const uint8_t *data);
/* `events`: how many the machine has reported, and the last of them. */
void fcsl_vars_events(fcsl_vars_out_t *out, const fcsl_run_t *run);
/* `times`: of each instance and of the step; nothing where the machine is not measured. */
void fcsl_vars_times(fcsl_vars_out_t *out, const fcsl_run_t *run);

/* What the server itself counts. */
typedef struct {
    uint64_t requests;
    uint64_t requests_refused;
    uint64_t clients_dropped;
    uint64_t samples_lost; /* of subscriptions */
} fcsl_vars_counters_t;

void fcsl_vars_count(const fcsl_vars_t *vars, fcsl_vars_counters_t *counters);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_VARS_H */
