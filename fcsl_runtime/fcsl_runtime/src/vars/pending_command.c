/* SPDX-License-Identifier: Apache-2.0
 *
 * The one command that the step thread has, from when it is handed over to its reply.
 */
#include "server.h"

/* How long a `tick` waits for subscribers to take what they have been sent. */
static const uint64_t TICK_PATIENCE_NS = 1000000000u;

static int subscribers_have_room(const fcsl_vars_t *vars)
{
    for (size_t i = 0; i < vars->used; i++) {
        const client_t *client = &vars->clients[i];
        if (client->fd >= 0 && fcsl_client_unsent(client) > SAMPLES_BYTES_MAX / 2u) {
            return 0;
        }
    }
    return 1;
}

/* Hands over the next ticks of a `tick`, once subscribers, if there are any, have taken those before. */
static void continue_ticks(fcsl_vars_t *vars, uint64_t now_ns)
{
    commander_t *commander = &vars->commander;
    vars->tick_by_ns = vars->tick_by_ns == 0 ? now_ns + TICK_PATIENCE_NS : vars->tick_by_ns;
    if (commander->ticks_at_once != 0 && !subscribers_have_room(vars) && now_ns < vars->tick_by_ns) {
        return;
    }
    vars->mailbox.command.count = fcsl_commander_portion(commander);
    vars->tick_by_ns = 0;
    fcsl_mailbox_post(&vars->mailbox);
}

static void finish_command(fcsl_vars_t *vars, uint64_t now_ns)
{
    fcsl_commander_complete(&vars->commander);
    client_t *client = vars->poster < CLIENTS_MAX ? &vars->clients[vars->poster] : NULL;
    for (size_t i = 0; i < vars->used; i++) {
        vars->clients[i].blocked = 0;
    }
    vars->next = vars->poster < CLIENTS_MAX ? (vars->poster + 1u) % CLIENTS_MAX : vars->next;
    vars->poster = CLIENTS_MAX;
    if (client == NULL) {
        return;
    }
    json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
    fcsl_commander_finish(&vars->commander, &client->session, &out);
    client->waiting = 0;
    fcsl_client_put(client, &out, now_ns);
    fcsl_vars_send(vars, client, now_ns);
}

void fcsl_vars_serve_command(fcsl_vars_t *vars, uint64_t now_ns)
{
    commander_t *commander = &vars->commander;
    if (fcsl_mailbox_done(&vars->mailbox)) {
        const int goes_on = vars->mailbox.command.kind == COMMAND_TICK &&
                            vars->mailbox.command.status == FCSL_VARS_OK && vars->poster < CLIENTS_MAX;
        commander->ticks_left = goes_on ? commander->ticks_left : 0;
        fcsl_vars_stream(vars, now_ns);
        if (commander->ticks_left == 0) {
            finish_command(vars, now_ns);
        }
    }
    if (commander->ticks_left == 0 || !fcsl_mailbox_is_free(&vars->mailbox)) {
        return;
    }
    if (commander->ticks_stopped) {
        finish_command(vars, now_ns);
        commander->ticks_left = 0;
    } else {
        continue_ticks(vars, now_ns);
    }
}
