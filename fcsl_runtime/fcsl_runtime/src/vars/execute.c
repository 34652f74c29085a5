/* SPDX-License-Identifier: Apache-2.0
 *
 * Executes commands on the step thread.
 */
#define _GNU_SOURCE
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_monotonic.h"

#include "server.h"

static fcsl_vars_status_t no_such_action(fcsl_error_t *error)
{
    (void)fcsl_fail(error, "this host does not offer it");
    return FCSL_VARS_REFUSED;
}

static fcsl_vars_status_t result(int status)
{
    return status == 0 ? FCSL_VARS_OK : FCSL_VARS_REFUSED;
}

/* Every value was checked when the command was prepared (command_write.c). */
static void set_all(const fcsl_vars_t *vars, const command_t *command)
{
    const fcsl_vars_host_t *host = &vars->host;
    for (uint32_t i = 0; i < command->write_count; i++) {
        const write_t *write = &command->writes[i];
        const uint8_t *bytes = command->bytes + write->at;
        if (vars->protocol.catalog.blocks[write->block].machine != NULL) {
            fcsl_run_set_checked(host->run, write->field, write->element, bytes, write->size);
        } else {
            host->set(host->ctx, write->block, write->field, write->element, bytes, write->size);
        }
    }
}

static fcsl_vars_status_t inject(fcsl_run_t *run, command_t *command)
{
    switch (command->injection) {
    case INJECT_FAULT:
        return result(fcsl_run_inject_fault(run, command->index, &command->error));
    case INJECT_OVERRUN:
        return result(fcsl_run_inject_overrun(run, command->index, &command->error));
    case INJECT_DEGRADED:
        return result(fcsl_run_inject_health(run, command->index, FCSL_DEGRADED, &command->error));
    default:
        return result(fcsl_run_inject_health(run, command->index, FCSL_FAILED, &command->error));
    }
}

static fcsl_vars_status_t feed_channel(const fcsl_vars_host_t *host, command_t *command)
{
    fcsl_error_t *error = &command->error;
    if (!host->accepts_samples) {
        (void)fcsl_fail(error, "the simulation feeds the sensor channels: set a sensor model");
        return FCSL_VARS_REFUSED;
    }
    return result(command->kind == COMMAND_ATTACH
                      ? fcsl_run_attach_channel(host->run, command->index, error)
                      : fcsl_run_write_channel(host->run, command->index, command->bytes, command->size,
                                               command->age_ticks, command->stamp_ns, error));
}

static fcsl_vars_status_t reach_hardware(fcsl_run_t *run, command_t *command)
{
    if (fcsl_run_has_board(run)) {
        (void)snprintf(command->error.text, sizeof command->error.text,
                       "the machine reaches the hardware of a board, not simulated hardware");
        return FCSL_VARS_REFUSED;
    }
    command->count = fcsl_run_hardware_failures(run);
    return fcsl_reach_hardware(command, fcsl_run_simulated_hardware(run));
}

/* Only copies: the server's thread makes the checkpoint of it. */
static fcsl_vars_status_t save(const fcsl_vars_host_t *host, command_t *command)
{
    const fcsl_machine_t *machine = fcsl_run_machine(host->run);
    const fcsl_monitor_t *monitor = fcsl_run_monitor(host->run);
    memcpy(command->bytes, fcsl_run_data(host->run), machine->size);
    if (monitor != NULL) {
        memcpy(command->bytes + machine->size, fcsl_run_monitor_data(host->run), monitor->machine->size);
    }
    *command->hardware = *fcsl_run_simulated_hardware(host->run);
    if (host->save != NULL) {
        host->save(host->ctx);
    }
    return FCSL_VARS_OK;
}

/* Commands on the machine. They are prepared only where a block is one (fcsl_request_machine). */
static fcsl_vars_status_t act_on_machine(const fcsl_vars_host_t *host, command_t *command)
{
    switch (command->kind) {
    case COMMAND_SET_STATE:
        return result(fcsl_run_set_state(host->run, command->state, &command->error));
    case COMMAND_SAVE:
        return save(host, command);
    case COMMAND_RESTORE:
        return host->restore(host->ctx, command->bytes, command->size, command->hardware, &command->error);
    case COMMAND_INJECT:
        return inject(host->run, command);
    case COMMAND_HARDWARE:
        return reach_hardware(host->run, command);
    default:
        return feed_channel(host, command);
    }
}

static fcsl_vars_status_t act(fcsl_vars_t *vars, command_t *command)
{
    const fcsl_vars_host_t *host = &vars->host;
    const char *bag = (const char *)command->bytes;
    fcsl_error_t *error = &command->error;
    switch (command->kind) {
    case COMMAND_SET:
        set_all(vars, command);
        return FCSL_VARS_OK;
    case COMMAND_PAUSE:
    case COMMAND_RESUME:
        return host->pause(host->ctx, command->kind == COMMAND_PAUSE, error);
    case COMMAND_TICK:
        return host->tick(host->ctx, command->count, error);
    case COMMAND_RECORD:
        return host->record != NULL ? host->record(host->ctx, bag, bag + strlen(bag) + 1u, error)
                                    : no_such_action(error);
    case COMMAND_STOP_RECORDING:
        return host->stop_recording != NULL ? host->stop_recording(host->ctx, error) : no_such_action(error);
    default:
        return act_on_machine(host, command);
    }
}

void fcsl_vars_serve(fcsl_vars_t *vars)
{
    command_t *command = fcsl_slot_take(&vars->slot);
    if (command == NULL) {
        return;
    }
    if (command->kind == COMMAND_SAVE && command->file[0] != '\0') {
        fcsl_vars_stop_serving(vars); /* the server's thread waits for the disk */
    }
    const int serves = fcsl_vars_begin_command(vars);
    command->status = act(vars, command);
    vars->host.publish(vars->host.ctx);
    command->published = fcsl_history_published(vars->history);
    const int replies = serves && fcsl_vars_end_command(vars);
    fcsl_slot_finish(&vars->slot);
    if (replies) {
        fcsl_vars_reply_command(vars, fcsl_monotonic_ns());
    } else {
        fcsl_vars_wake_loop(vars);
    }
}

void fcsl_vars_wait(fcsl_vars_t *vars, uint64_t deadline_ns)
{
    fcsl_slot_wait(&vars->slot, deadline_ns);
}

void fcsl_vars_wake(fcsl_vars_t *vars)
{
    fcsl_slot_wake(&vars->slot);
    fcsl_vars_wake_loop(vars);
}
