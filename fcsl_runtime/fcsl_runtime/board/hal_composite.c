/* SPDX-License-Identifier: Apache-2.0
 *
 * The composite HAL.
 */
#define _GNU_SOURCE
#include "hal_composite.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "hal_linux.h"

static const uint64_t AHEAD_NS = 250000000u; /* of real time: the simulator goes too fast */
static const uint64_t BEHIND_NS = 2000000000u; /* it is paused, or too slow */
static const char NO_PAUSE[] = "some sensors are real devices, which do not wait: end the flight instead";

typedef struct {
    fcsl_hal_t board;
    fcsl_hal_t simulated;
    fcsl_run_t *run;
    fcsl_channel_table_t table;
    uint8_t *data; /* a struct of the machine: what the simulator sensed */
    uint8_t *select; /* by channel: it goes on to the machine */
    uint8_t *bytes; /* of the message that goes on */
    size_t capacity;
    fcsl_message_t left;
    int has_left; /* of this tick: it goes on once nothing can fail any more */
    fcsl_field_t *fields; /* of both */
    uint8_t *counters;
    uint64_t begun_ns; /* when tick 0 came; 0: not yet */
    char failure[512];
    int failed; /* explain is about this, and not about one of the two */
    const fcsl_hal_t *culprit;
} hal_t;

/* ---- a tick --------------------------------------------------------------------------------------------------------- */

static fcsl_hal_status_t fail(hal_t *hal, const char *what, uint64_t by_ns)
{
    (void)snprintf(hal->failure, sizeof hal->failure,
                   "the simulator is %.3g s %s real time at tick %" PRIu64
                   ": beside real devices it must keep it (fcsl sim … --speed 1, no pause)",
                   (double)by_ns / 1e9, what, fcsl_run_tick(hal->run));
    hal->failed = 1;
    return FCSL_HAL_ERROR;
}

/* Whether the simulator is where the world is, at a tick that has come or is waited for. */
static fcsl_hal_status_t keep_real_time(hal_t *hal, fcsl_hal_status_t sampled)
{
    const uint64_t now = fcsl_monotonic_ns();
    if (hal->simulated.paces != FCSL_PACED_BY_SIMULATOR) {
        return sampled;
    }
    if (hal->begun_ns == 0u) {
        hal->begun_ns = sampled == FCSL_HAL_WAITING ? 0u : now;
        return sampled;
    }
    const uint64_t due_ns = hal->begun_ns + fcsl_run_tick_time_ns(hal->run, fcsl_run_tick(hal->run));
    if (sampled != FCSL_HAL_WAITING && due_ns > now && due_ns - now > AHEAD_NS) {
        return fail(hal, "ahead of", due_ns - now);
    }
    return now > due_ns && now - due_ns > BEHIND_NS ? fail(hal, "behind", now - due_ns) : sampled;
}

/* Keeps what the simulator sensed, without the board's channels. */
static void leave_to_board(void *ctx, const fcsl_message_t *sensed)
{
    hal_t *hal = ctx;
    const fcsl_machine_t *machine = hal->table.machine;
    fcsl_message_apply(machine, hal->data, sensed);
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        hal->select[i] = 0;
        if (channel->direction == FCSL_SENSOR) {
            hal->select[i] = hal->data[channel->fresh_offset] != 0u && !hal_linux_feeds(&hal->board, i);
            hal->data[channel->fresh_offset] = 0;
        }
    }
    if (fcsl_message_encode_sensors(&hal->table, hal->data, sensed->tick, hal->select, hal->bytes, hal->capacity,
                                    &hal->left) == FCSL_MESSAGE_OK) {
        hal->has_left = 1;
    } else {
        (void)snprintf(hal->failure, sizeof hal->failure, "the sensor message of tick %" PRIu64 " has no room",
                       sensed->tick);
        hal->failed = 1;
    }
}

/* Lines of the board follow those of the simulator. */
static void join_logs(hal_t *hal)
{
    char line[FCSL_LOG_BYTES];
    for (int i = 0; i <= FCSL_LOG_LINES && fcsl_log_read(hal->board.log, line); i++) {
        fcsl_log_write(hal->simulated.log, line);
    }
}

static fcsl_hal_status_t composite_sample(void *ctx, uint64_t tick, const fcsl_sink_t *to)
{
    hal_t *hal = ctx;
    const fcsl_sink_t without_board = {.ctx = hal, .sensed = leave_to_board};
    hal->culprit = &hal->simulated;
    hal->has_left = 0;
    fcsl_hal_status_t status = hal->simulated.sample(hal->simulated.ctx, tick, &without_board);
    if (status == FCSL_HAL_OK || status == FCSL_HAL_WAITING) {
        status = hal->failed ? FCSL_HAL_ERROR : keep_real_time(hal, status);
    }
    if (status == FCSL_HAL_OK) {
        hal->culprit = &hal->board;
        status = hal->board.sample(hal->board.ctx, tick, to);
    }
    if (status == FCSL_HAL_OK && hal->has_left) {
        to->sensed(to->ctx, &hal->left);
    }
    join_logs(hal);
    return status;
}

static fcsl_hal_status_t composite_command(void *ctx, const fcsl_message_t *message)
{
    hal_t *hal = ctx;
    hal->culprit = &hal->simulated;
    (void)hal->board.command(hal->board.ctx, message); /* pins; it always succeeds */
    return hal->simulated.command(hal->simulated.ctx, message);
}

static fcsl_hal_status_t composite_arm(void *ctx, int armed)
{
    hal_t *hal = ctx;
    hal->culprit = &hal->simulated;
    return hal->simulated.arm(hal->simulated.ctx, armed);
}

static void composite_count(void *ctx)
{
    hal_t *hal = ctx;
    hal->board.count(hal->board.ctx);
    hal->simulated.count(hal->simulated.ctx);
    memcpy(hal->counters, hal->board.counters, hal->board.counter_bytes);
    memcpy(hal->counters + hal->board.counter_bytes, hal->simulated.counters, hal->simulated.counter_bytes);
}

static const char *composite_explain(void *ctx)
{
    const hal_t *hal = ctx;
    return hal->failed ? hal->failure : hal->culprit->explain(hal->culprit->ctx);
}

static void composite_keep_alive(void *ctx)
{
    hal_t *hal = ctx;
    hal->simulated.alive(hal->simulated.ctx);
}

static void composite_interrupt(void *ctx)
{
    hal_t *hal = ctx;
    hal->board.interrupt(hal->board.ctx);
    hal->simulated.interrupt(hal->simulated.ctx);
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

static void composite_close(void *ctx)
{
    hal_t *hal = ctx;
    hal->board.close(hal->board.ctx);
    hal->simulated.close(hal->simulated.ctx);
    free(hal->data);
    free(hal->select);
    free(hal->bytes);
    free(hal->fields);
    free(hal->counters);
    free(hal);
}

/* The simulator first: it may have to be waited for, and what devices give meanwhile would be old. */
static int composite_open(fcsl_hal_t *handle, fcsl_error_t *error)
{
    hal_t *hal = handle->ctx;
    int status = hal->simulated.open(&hal->simulated, error);
    if (status == 0) {
        status = hal->board.open(&hal->board, error);
    }
    handle->paces = hal->simulated.paces == FCSL_PACED_BY_SIMULATOR ? FCSL_PACED_IN_REAL_TIME : hal->simulated.paces;
    return status;
}

static int allocate(hal_t *hal, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(hal->run);
    const size_t align = machine->align < 64u ? 64u : machine->align;
    const size_t size = ((size_t)machine->size + align - 1u) / align * align;
    hal->table = fcsl_channel_table(machine);
    hal->data = aligned_alloc(align, size);
    hal->select = calloc((size_t)machine->channel_count + 1u, 1);
    hal->capacity = fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE);
    hal->bytes = malloc(hal->capacity);
    hal->fields = calloc((size_t)hal->board.field_count + hal->simulated.field_count + 1u, sizeof *hal->fields);
    hal->counters = calloc(1, (size_t)hal->board.counter_bytes + hal->simulated.counter_bytes + 1u);
    if (hal->data == NULL || hal->select == NULL || hal->bytes == NULL || hal->fields == NULL ||
        hal->counters == NULL) {
        return fcsl_fail(error, "out of memory for the HAL");
    }
    memset(hal->data, 0, size);
    return 0;
}

static uint32_t join_fields(hal_t *hal)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < hal->board.field_count; i++) {
        hal->fields[count++] = hal->board.fields[i];
    }
    for (uint32_t i = 0; i < hal->simulated.field_count; i++) {
        hal->fields[count] = hal->simulated.fields[i];
        hal->fields[count++].offset += hal->board.counter_bytes;
    }
    return count;
}

int hal_composite(const fcsl_hal_t *board, const fcsl_hal_t *simulated, fcsl_run_t *run, fcsl_hal_t *hal,
                  fcsl_error_t *error)
{
    hal_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        board->close(board->ctx);
        simulated->close(simulated->ctx);
        return fcsl_fail(error, "out of memory for the HAL");
    }
    self->board = *board;
    self->simulated = *simulated;
    self->run = run;
    self->culprit = &self->simulated;
    if (board->paces != FCSL_PACED_BY_HOST) {
        (void)fcsl_fail(error, "a device of the board paces the loop, and so would the simulator: remove \"pace\"");
        composite_close(self);
        return -1;
    }
    if (allocate(self, error) != 0) {
        composite_close(self);
        return -1;
    }
    *hal = (fcsl_hal_t){
        .ctx = self,
        .open = composite_open,
        .sample = composite_sample,
        .command = composite_command,
        .arm = composite_arm,
        .alive = composite_keep_alive,
        .clock = simulated->clock,
        .log = simulated->log,
        .count = composite_count,
        .explain = composite_explain,
        .interrupt = composite_interrupt,
        .close = composite_close,
        .fields = self->fields,
        .field_count = join_fields(self),
        .counters = self->counters,
        .counter_bytes = board->counter_bytes + simulated->counter_bytes,
        .serves = 1,
        .no_pause = NO_PAUSE,
    };
    return 0;
}
