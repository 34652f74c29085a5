/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_OPTIONS_H
#define FC_OPTIONS_H

#include <stdint.h>
#include <string.h>

#include "pacing.h"

/* What a recording does that the disk cannot keep up with. */
typedef enum { RECORD_BY_PACE, RECORD_WAIT, RECORD_DROP } record_policy_t;

enum { OPTIONS_PATH_BYTES = 4096 };

typedef struct {
    const char *library;
    const char *machine;    /* null: the only one */
    const char *
        peer; /* OPTIONS_WIRE and a SPEC of fcsl_wire.h, an address of fcsl_hal_bus, OPTIONS_ROS and an endpoint, or OPTIONS_LINUX
               * and the plan of a board; null: the stub HAL */
    char
        composite_plan[OPTIONS_PATH_BYTES]; /* of the board whose sensors take the place of the simulator's; "": none */
    const char *board; /* null: simulated hardware */
    const char *guard; /* socket of fcsl-guard; null: none */
    const char *parameters; /* parameter file; null: the compiled values */
    const char *restore; /* file of a checkpoint to begin from; null: from tick 0 */
    const char *socket; /* null: no variable server */
    const char *token; /* file with its token, for TCP */
    const char *checkpoints; /* folder of the checkpoints that clients name; null: none */
    const char *telemetry; /* udp:HOST:PORT[/EVERY]; null: none */
    const char *telemetry_fields; /* globs; null: as fcsl_telemetry.h says */
    const char *observers; /* tcp:HOST:PORT to listen on; null: none */
    const char *ros; /* the endpoint of fcsl_ros_graph_options_t; null: none */
    const char *record; /* null: no recording */
    const char *record_fields; /* globs; null: as fcsl_run_record says */
    const char *record_split; /* null: one file */
    record_policy_t record_policy;
    const char *name_space;
    const char *summary_file; /* null: not written */
    uint64_t ticks; /* 0: no limit */
    uint64_t timeout_ms;
    uint64_t watchdog_ms; /* 0: none */
    uint64_t priority; /* of SCHED_FIFO; 0: as started */
    uint64_t cpu; /* of the step thread; OPTIONS_ANY_CPU */
    missed_deadline_t missed_deadline;
    int missed_deadline_given;
    int realtime;
    int lock_memory;
    int paused;
    int ignore_source_hash; /* a checkpoint of other sources is taken */
    int no_overrun_check; /* executes are not timed */
    int exit_on_stdin_eof; /* the end of standard input is a signal to end */
} options_t;

#define OPTIONS_ANY_CPU   UINT64_MAX
#define OPTIONS_WIRE      "wire:"
#define OPTIONS_ROS       "ros:"
#define OPTIONS_LINUX     "linux:"
#define OPTIONS_COMPOSITE "composite:"

static inline int options_hal_is_linux(const options_t *options)
{
    return options->peer != NULL && strncmp(options->peer, OPTIONS_LINUX, strlen(OPTIONS_LINUX)) == 0;
}

/* Beside the simulator that `peer` names. */
static inline int options_hal_is_composite(const options_t *options)
{
    return options->composite_plan[0] != '\0';
}

static inline int options_hal_is_ros(const options_t *options)
{
    return options->peer != NULL && strncmp(options->peer, OPTIONS_ROS, strlen(OPTIONS_ROS)) == 0;
}

/* Reads the command line. Returns 0; 1 when help was printed; -1 after a message. */
int options_read(int argc, char **argv, options_t *options);

#endif /* FC_OPTIONS_H */
