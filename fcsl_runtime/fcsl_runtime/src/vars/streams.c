/* SPDX-License-Identifier: Apache-2.0
 *
 * Sends samples of what is published to the subscriptions of all clients.
 */
#include "server.h"

/* Most bytes that one publication can make of a client's subscriptions; 0 without any. */
static size_t bytes_of(const client_t *client)
{
    size_t bytes = 0;
    for (size_t i = 0; client->fd >= 0 && !client->closing && i < SUBSCRIPTIONS_MAX; i++) {
        const subscription_t *subscription = &client->subscriptions[i];
        bytes += subscription->number != 0 ? subscription->bytes : 0;
    }
    return bytes;
}

int fcsl_vars_prepare_streams(fcsl_vars_t *vars)
{
    size_t most = 0;
    for (size_t i = 0; i < vars->used; i++) {
        const size_t bytes = bytes_of(&vars->clients[i]);
        most = bytes > most ? bytes : most;
    }
    if (most == 0) {
        vars->protocol.ticks_at_once = 0;
        vars->cursor = fcsl_history_published(vars->history);
        vars->overtaken = 0;
        return 0;
    }
    /* So few that neither the history nor a client's room for samples is too small for them. */
    const size_t fit = SAMPLES_BYTES_MAX / 2u / most;
    const uint32_t slots = vars->history->slots / 2u;
    vars->protocol.ticks_at_once = fit == 0 ? 1u : fit < slots ? (uint32_t)fit : slots;
    return 1;
}

static void lose(fcsl_vars_t *vars, uint64_t samples)
{
    if (samples > 0) {
        atomic_fetch_add(&vars->counters.samples_lost, samples);
    }
}

static void sample(fcsl_vars_t *vars, client_t *client, subscription_t *subscription, const fcsl_moment_t *moment,
                   uint64_t now_ns)
{
    const uint64_t lost = subscription->lost;
    const int due = fcsl_subscription_due(subscription, moment->tick, vars->overtaken);
    if (due && fcsl_client_unsent(client) + subscription->bytes > SAMPLES_BYTES_MAX) {
        subscription->lost++;
    } else if (due) {
        json_out_t out = fcsl_client_room(client, SAMPLE_BYTES_MAX + 1u);
        fcsl_subscription_write(subscription, moment, vars->sample, &out);
        if (out.overflow) {
            subscription->lost++;
        } else {
            fcsl_client_put(client, &out, now_ns);
        }
    }
    lose(vars, subscription->lost - lost);
}

void fcsl_vars_stream(fcsl_vars_t *vars, uint64_t now_ns)
{
    fcsl_moment_t moment;
    if (!fcsl_vars_prepare_streams(vars)) {
        return;
    }
    /* Bounded: a host that publishes faster than this reads is caught up with in the next turn. */
    for (uint32_t i = 0; i < 2u * vars->history->slots; i++) {
        const fcsl_history_status_t status = fcsl_history_read(vars->history, vars->cursor, &moment, vars->sample);
        if (status == FCSL_HISTORY_COMING) {
            return;
        }
        if (status == FCSL_HISTORY_OVERWRITTEN) {
            const uint64_t cursor = fcsl_history_catch_up(vars->history, vars->cursor);
            vars->overtaken += cursor - vars->cursor;
            vars->cursor = cursor;
            continue;
        }
        vars->cursor++;
        for (size_t c = 0; c < vars->used; c++) {
            client_t *client = &vars->clients[c];
            for (size_t s = 0; client->fd >= 0 && !client->closing && s < SUBSCRIPTIONS_MAX; s++) {
                if (client->subscriptions[s].number != 0) {
                    sample(vars, client, &client->subscriptions[s], &moment, now_ns);
                }
            }
        }
        vars->overtaken = 0;
    }
}
