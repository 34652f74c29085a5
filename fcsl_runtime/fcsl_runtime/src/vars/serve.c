/* SPDX-License-Identifier: Apache-2.0
 *
 * The variable server's end on the step thread.
 */
#include <stdio.h>
#include <string.h>

#include "server.h"

static fcsl_vars_status_t no_such_action(fcsl_error_t *error)
{
    (void)snprintf(error->text, sizeof error->text, "this host does not offer it");
    return FCSL_VARS_REFUSED;
}

static fcsl_vars_status_t set_all(const fcsl_vars_host_t *host, command_t *command)
{
    for (int making = 0; making <= 1; making++) {
        for (uint32_t i = 0; i < command->write_count; i++) {
            const write_t *write = &command->writes[i];
            const fcsl_vars_status_t status =
                (making ? host->set : host->check_set)(host->ctx, write->block, write->field, write->element,
                                                       command->bytes + write->at, write->size, &command->error);
            if (status != FCSL_VARS_OK) {
                return status;
            }
        }
    }
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t reach_hardware(const fcsl_vars_host_t *host, command_t *command)
{
    fcsl_hw_sim_t *hardware = NULL;
    if (host->hardware == NULL) {
        return no_such_action(&command->error);
    }
    const fcsl_vars_status_t status =
        host->hardware(host->ctx, command->block, &hardware, &command->count, &command->error);
    return status == FCSL_VARS_OK ? fcsl_reach_hardware(command, hardware) : status;
}

/* What tests do to a machine. */
static fcsl_vars_status_t act_on_machine(const fcsl_vars_host_t *host, command_t *command)
{
    fcsl_error_t *error = &command->error;
    switch (command->kind) {
    case COMMAND_INJECT:
        return host->inject != NULL ? host->inject(host->ctx, command->block, command->index, command->injection, error)
                                    : no_such_action(error);
    case COMMAND_ATTACH:
        return host->attach != NULL ? host->attach(host->ctx, command->block, command->index, error)
                                    : no_such_action(error);
    case COMMAND_SAMPLE:
        return host->sample != NULL ? host->sample(host->ctx, command->block, command->index, command->bytes,
                                                   command->size, command->age_ticks, command->stamp_ns, error)
                                    : no_such_action(error);
    case COMMAND_RECORD: {
        const char *bag = (const char *)command->bytes;
        return host->record != NULL ? host->record(host->ctx, bag, bag + strlen(bag) + 1u, error)
                                    : no_such_action(error);
    }
    case COMMAND_HARDWARE:
        return reach_hardware(host, command);
    default:
        return host->stop_recording != NULL ? host->stop_recording(host->ctx, error) : no_such_action(error);
    }
}

static fcsl_vars_status_t act(const fcsl_vars_host_t *host, command_t *command)
{
    fcsl_error_t *error = &command->error;
    switch (command->kind) {
    case COMMAND_SET:
        return host->set != NULL ? set_all(host, command) : no_such_action(error);
    case COMMAND_PAUSE:
    case COMMAND_RESUME:
        return host->pause != NULL ? host->pause(host->ctx, command->kind == COMMAND_PAUSE, error)
                                   : no_such_action(error);
    case COMMAND_TICK:
        return host->tick != NULL ? host->tick(host->ctx, command->count, error) : no_such_action(error);
    case COMMAND_SET_STATE:
        return host->set_state != NULL ? host->set_state(host->ctx, command->block, command->state, error)
                                       : no_such_action(error);
    case COMMAND_SAVE:
        return host->save != NULL ? host->save(host->ctx, command->block, command->bytes, command->hardware, error)
                                  : no_such_action(error);
    case COMMAND_RESTORE:
        return host->restore != NULL
                   ? host->restore(host->ctx, command->block, command->bytes, command->hardware, error)
                   : no_such_action(error);
    default:
        return act_on_machine(host, command);
    }
}

int fcsl_vars_serve(fcsl_vars_t *vars)
{
    command_t *command = fcsl_mailbox_take(&vars->mailbox);
    if (command == NULL) {
        return 0;
    }
    command->status = act(&vars->host, command);
    vars->host.publish(vars->host.ctx);
    command->published = fcsl_history_published(vars->history);
    fcsl_mailbox_answer(&vars->mailbox);
    return 1;
}

void fcsl_vars_wait(fcsl_vars_t *vars, uint64_t deadline_ns)
{
    fcsl_mailbox_wait(&vars->mailbox, deadline_ns);
}

void fcsl_vars_wake(fcsl_vars_t *vars)
{
    fcsl_mailbox_wake(&vars->mailbox);
}
