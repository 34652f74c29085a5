/* SPDX-License-Identifier: Apache-2.0
 *
 * A controller and a simulator over the wire of docs/reference/transports.md, which is included here: two pipes between two processes.
 */
#include PIPE_WIRE

#include <fcntl.h>
#include <sys/wait.h>

#include "channel_fixture.h"
#include "fcsl/fcsl_external.h"
#include "fcsl_check.h"

enum { TICKS = 2000, WAIT_MS = 10000, ROOM = 1024 };

static void sensed(void *ctx, const fcsl_message_t *message)
{
    fcsl_message_apply(&MACHINE, ctx, message);
}

/* Steps until the run ends; exits 0 when the simulator ended it after all ticks. */
static int control(pipe_wire_t *pipe)
{
    fcsl_error_t error;
    uint8_t bytes[ROOM];
    fcsl_message_t message;
    fcsl_hal_t hal;
    data_t data = {0};
    const fcsl_wire_t wire = pipe_wire(pipe);
    const fcsl_sink_t to = {.ctx = &data, .sensed = sensed};
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    CHECK(fcsl_hal_over_wire(&wire, &MACHINE, WAIT_MS, &hal, &error) == 0);
    CHECK(hal.open(&hal, &error) == 0 && hal.paces);
    fcsl_hal_status_t status = FCSL_HAL_OK;
    uint64_t tick = 0;
    for (; status == FCSL_HAL_OK; tick++) {
        do { /* ends at the time-out */
            status = hal.sample(hal.ctx, tick, &to);
        } while (status == FCSL_HAL_WAITING);
        if (status == FCSL_HAL_OK) {
            data.command[0] = 2.0 * (double)data.i64;
            CHECK(fcsl_message_encode_actuators(&table, &data, tick, 1, bytes, sizeof bytes, &message) == 0);
            status = hal.command(hal.ctx, &message);
        }
    }
    hal.close(hal.ctx);
    return status == FCSL_HAL_CLOSED && tick == TICKS + 1 ? 0 : 1;
}

static void simulate(pipe_wire_t *pipe)
{
    fcsl_error_t error;
    uint8_t bytes[ROOM];
    fcsl_message_t message;
    data_t data = {0};
    fcsl_external_t *external = NULL;
    const fcsl_wire_t wire = pipe_wire(pipe);
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    CHECK(fcsl_external_over_wire(&wire, &MACHINE, &external, &error) == 0);
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    for (uint64_t tick = 0; tick < TICKS; tick++) {
        data.i64 = (int64_t)tick;
        CHECK(fcsl_message_encode_sensors(&table, &data, tick, NULL, bytes, sizeof bytes, &message) == FCSL_MESSAGE_OK);
        CHECK(fcsl_external_send(external, &message, tick) == FCSL_HAL_OK);
        CHECK(fcsl_external_receive(external, tick, WAIT_MS, &message) == FCSL_HAL_OK);
        fcsl_message_apply(&MACHINE, &data, &message);
        CHECK(data.command[0] == 2.0 * (double)tick);
    }
    fcsl_external_close(external);
}

int main(void)
{
    int down[2];
    int up[2];
    int status = 0;
    CHECK(pipe2(down, O_CLOEXEC) == 0 && pipe2(up, O_CLOEXEC) == 0);
    const int ends[] = {down[0], down[1], up[0], up[1]};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        CHECK(fcntl(ends[i], F_SETFL, O_NONBLOCK) == 0);
    }
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        pipe_wire_t pipe = {.in = down[0], .out = up[1]};
        _exit(control(&pipe));
    }
    pipe_wire_t pipe = {.in = up[0], .out = down[1]};
    simulate(&pipe);
    CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    return 0;
}
