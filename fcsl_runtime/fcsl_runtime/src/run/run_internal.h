/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_RUN_INTERNAL_H
#define FCSL_RUN_INTERNAL_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_hw_sim.h"
#include "fcsl/fcsl_monitor.h"
#include "machine/machine_struct.h"
#include "messages/message.h"
#include "record/write_queue.h"
#include "record/recorder.h"

/* An instance with max_wcet_us before a tick, to tell a measured overrun from an injected one. */
typedef struct {
    uint32_t overruns_offset;
    uint32_t inject_offset;
    const char *instance;
    uint64_t overruns;
    uint8_t injected;
} fcsl_overrun_watch_t;

/* What an impure instance leaves: bytes at run->left + offset, little-endian; none for other instances. */
typedef struct {
    uint32_t offset;
    uint32_t size;
    uint8_t substituted; /* they take the place of its next execute */
} fcsl_substitute_t;

struct fcsl_run {
    void *library;
    void *unfolded; /* memory of `machine`, if its library has it folded */
    const fcsl_machine_t *machine;
    fcsl_channel_table_t channels;
    uint8_t *data;
    uint8_t *safe; /* a struct of which the actuators' fields are safe; null: nothing arms the machine */
    uint8_t *staging; /* a checked copy of what replaces data: the struct, the memory of requirements */
    int requires_arming; /* disarmed, until the arm field has been false after a step */
    fcsl_host_t host;
    uint64_t (*clock_ns)(void *ctx); /* null: nothing is timed */
    void *clock_ctx;
    fcsl_layout_t *layouts;   /* per instance */
    fcsl_overrun_watch_t *watched;
    uint32_t watched_count;
    uint32_t impure_count;    /* instances that are */
    uint64_t impure_executes; /* that no substitute took the place of */
    uint64_t mode_changes;    /* of the floating-point mode, by such an instance */
    const char *mode_changed_by;
    fcsl_substitute_t *impure;    /* per instance */
    uint8_t *left;
    uint64_t messages_refused;
    fcsl_recorder_t *recorder; /* null: not recording */
    fcsl_write_queue_t *write_queue;   /* null: none */
    uint64_t record_time_ns;   /* of the coming records; FCSL_TICK_TIME: that of their tick */
    fcsl_trace_t *traces;      /* null: none */
    struct fcsl_monitor_run *monitor; /* null: no requirements */
    struct fcsl_event_run *events; /* null: the machine reports none */
    struct fcsl_times *times; /* null: the machine is not measured */
    char *views;               /* of the host; null: those of the machine */

    fcsl_hw_sim_t simulated;
    struct fcsl_hw hardware; /* what serves the machine: the simulated hardware or a board */
    struct fcsl_hw counted;  /* what the machine sees of it: failures are counted */
    uint64_t hardware_failures;
    const struct fcsl_hw *board; /* null: none */
    void *board_library; /* null: the board is the caller's */
    fcsl_board_close_fn *close_board;
};

/* Of what is recorded of `tick` now. */
static inline fcsl_stamp_t fcsl_run_stamp(const fcsl_run_t *run, uint64_t tick)
{
    return (fcsl_stamp_t){.tick = tick, .time_ns = run->record_time_ns};
}

#endif /* FCSL_RUN_INTERNAL_H */
