/* SPDX-License-Identifier: Apache-2.0
 *
 * The hardware abstraction layer: what the host of a machine calls. Going from simulation to flight changes which HAL is
 * constructed and nothing else.
 *
 * Per tick a host waits for the time of the tick, samples, steps the machine, commands. Sensors and commands are messages of
 * channels (fcsl_codec.h). What happens at a missed deadline is for the host to say.
 */
#ifndef FCSL_HAL_H
#define FCSL_HAL_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_log.h"
#include "fcsl/fcsl_wire.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    FCSL_HAL_OK = 0,
    FCSL_HAL_NONE = 1,    /* at the simulator's end (fcsl_external.h): nothing came */
    FCSL_HAL_TIMEOUT = 2, /* lock-step: the message of this tick did not come in time */
    FCSL_HAL_CLOSED = 3,  /* the other side ended the run */
    FCSL_HAL_ERROR = 4,
    FCSL_HAL_WAITING = 5, /* sample: nothing has come yet, and there is time left: call again for the same tick */
    FCSL_HAL_AGAIN = 6    /* the other side ended the run, and begins another one */
} fcsl_hal_status_t;

typedef enum {
    FCSL_PACED_BY_HOST = 0,      /* the clock */
    FCSL_PACED_BY_SIMULATOR = 1, /* the time is simulated */
    FCSL_PACED_IN_REAL_TIME = 2  /* a device, each of whose samples is a tick; or a simulator that keeps real time */
} fcsl_pacer_t;

/* What ticks are due by. */
typedef struct {
    void *ctx;
    uint64_t (*now_ns)(void *ctx);
    /* Sleeps until this time of the clock, or until a signal; at once where sample waits. */
    void (*wait)(void *ctx, uint64_t until_ns);
} fcsl_clock_t;

/* CLOCK_MONOTONIC. */
extern const fcsl_clock_t fcsl_monotonic_clock;

/* Where sample hands what was sensed: the host's run (fcsl_run_sense_message), or who stands before it. */
typedef struct {
    void *ctx;
    /* A message of sensor channels that the HAL has checked. It is valid during the call. */
    void (*sensed)(void *ctx, const fcsl_message_t *message);
} fcsl_sink_t;

typedef struct fcsl_hal {
    void *ctx;
    /* Before anything else. Returns 0, or with `error` filled -1, or 1 when the peer was not found yet: then it may be called again,
     * to look on. Sets what stands below as known only now. */
    int (*open)(struct fcsl_hal *hal, fcsl_error_t *error);
    /* Delivers what was sensed for `tick`; OK, also where nothing is new. Samples with an age and a stamp of their own, which no
     * message carries, are those of a HAL that was made for one run (a board, the ROS 2 graph): it writes them into the run. The
     * others hand `to` one message at most, with OK alone. A HAL that paces may return WAITING after a moment: call again. */
    fcsl_hal_status_t (*sample)(void *ctx, uint64_t tick, const fcsl_sink_t *to);
    fcsl_hal_status_t (*command)(void *ctx, const fcsl_message_t *message);
    /* Called when the arm flag of the commands changes, before the command that changes it, and with 0 at the end of a run that
     * is armed. A HAL that owns actuators switches their outputs; one that hands commands on has the flag in them. */
    fcsl_hal_status_t (*arm)(void *ctx, int armed);
    /* The host makes no ticks for a while, and calls this often: a simulator waits on for its commands. */
    void (*alive)(void *ctx);
    /* Brings the counters that `fields` describe up to date; they stand at `counters`. From the thread that samples; before
     * open, too. */
    void (*count)(void *ctx);
    /* What the last status other than OK or WAITING was about, for messages; never null. */
    const char *(*explain)(void *ctx);
    /* May be called from any thread: a waiting sample, and every later one, returns FCSL_HAL_CLOSED. */
    void (*interrupt)(void *ctx);
    void (*close)(void *ctx);
    /* Monotonic, or simulated time where a simulator sends it. */
    fcsl_clock_t clock;
    /* Lines for people: written by the thread that samples, read by another (fcsl_log.h). */
    fcsl_log_t *log;
    /* What the HAL knows of itself (age, errors, drops, the link), under `hal.` in variables and telemetry; not part of a run's
     * results. Known before open. */
    const fcsl_field_t *fields;
    uint32_t field_count;
    const void *counters;
    uint32_t counter_bytes;
    /* True when sensor channels are served: the host attaches them (fcsl_run_attach), so their age is kept. */
    int serves;
    /* Who decides when tick k happens. Where it is not the host, sample(k) does, and the host must not pace itself. Known after
     * open. */
    fcsl_pacer_t paces;
    /* Why ticks cannot wait for a client; null: they can. */
    const char *no_pause;
} fcsl_hal_t;

/* Samples nothing, accepts everything. Returns 0, or -1 with `error` filled. */
int fcsl_hal_stub(fcsl_hal_t *hal, fcsl_error_t *error);

/* Messages over the wire that `spec` names (fcsl_wire.h); fcsl_external is the other end. A peer with another channel table or
 * tick rate is refused.
 *
 * A simulator that sends the time paces the run: the host waits up to `timeout_ms` for the time message of tick k, and what was
 * sensed for k has come before it; sample(k) returns FCSL_HAL_WAITING meanwhile. A simulator that pauses says so, and the time
 * begins anew. "no time message of tick k within timeout_ms ms" ends the run.
 * A rig that sends none leaves the run to the monotonic clock: sample takes the newest message, if one has come since the last
 * tick. A rig that falls silent, or goes, ends nothing; `hal.connected` and the age of the channels tell.
 * `open_ms`: how long to look for the other end. Returns 0, or -1 with `error` filled. */
int fcsl_hal_wire(const char *spec, const fcsl_machine_t *machine, uint32_t open_ms, uint32_t timeout_ms,
                  fcsl_hal_t *hal, fcsl_error_t *error);
/* The same over the bus, where each channel has a key (docs/reference/transports.md). `address`: zenoh:tcp:HOST:PORT, where a simulator listens,
 * or zenoh-peer:tcp:HOST:PORT. With ,free-running behind it `open` waits for nobody, the monotonic clock paces the run, and sample
 * takes the newest values that anybody put; that a simulator comes or goes is logged. `name_space`: in front of the keys, or "". */
int fcsl_hal_bus(const char *address, const char *name_space, const fcsl_machine_t *machine, uint32_t open_ms,
                 uint32_t timeout_ms, fcsl_hal_t *hal, fcsl_error_t *error);
/* 0 when `address` has that form, or -1 with `error` filled. */
int fcsl_hal_bus_check(const char *address, fcsl_error_t *error);
/* Whether it says ,free-running. */
int fcsl_hal_bus_runs_free(const char *address);
/* The same over a wire of your own, which the HAL owns once this has returned 0. */
int fcsl_hal_over_wire(const fcsl_wire_t *wire, const fcsl_machine_t *machine, uint32_t timeout_ms, fcsl_hal_t *hal,
                       fcsl_error_t *error);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_HAL_H */
