/* SPDX-License-Identifier: Apache-2.0
 *
 * The server's thread: one round looks at every client once, in turn, and serves a few requests of each.
 */
#define _GNU_SOURCE
#include "server.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    REQUESTS_PER_ROUND = 4, /* of one client, so that one that floods does not keep the others waiting */
    POLL_MS = 200,          /* for the time limits */
    STREAM_POLL_MS = 2,     /* for publications, which wake nobody */
    ENTRIES = CLIENTS_MAX + 3
};
/* How long a `tick` waits for subscribers to take what they have been sent. */
static const uint64_t TICK_PATIENCE_NS = 1000000000u;

static uint64_t now_ns(void)
{
    return fcsl_run_monotonic_ns(NULL);
}

/* ---- clients ------------------------------------------------------------------------------------------------------- */

static void close_client(fcsl_vars_t *vars, client_t *client)
{
    if (client->waiting) {
        vars->poster = CLIENTS_MAX;
    }
    fcsl_client_close(client);
}

static void send_to(fcsl_vars_t *vars, client_t *client)
{
    if (!fcsl_client_send(client, now_ns()) || (client->closing && fcsl_client_unsent(client) == 0)) {
        close_client(vars, client);
    }
}

/* Tells it why, as far as it still reads, and closes. */
static void drop(fcsl_vars_t *vars, client_t *client, const char *code, const char *why)
{
    json_out_t out = fcsl_client_room(client, OUT_BYTES);
    fcsl_commander_error(&out, code, why);
    if (!out.overflow) {
        fcsl_client_put(client, &out, now_ns());
    }
    atomic_fetch_add(&vars->counters.clients_dropped, 1);
    client->closing = 1;
    send_to(vars, client);
}

/* A reply of the longest kind fits behind what is unsent. */
static int may_reply(const client_t *client)
{
    return client->fd >= 0 && !client->closing && !client->waiting && !client->blocked &&
           fcsl_client_unsent(client) <= SAMPLES_BYTES_MAX;
}

/* Serves one line; 0 when there is none that can be served now. */
static int serve_line(fcsl_vars_t *vars, client_t *client)
{
    size_t size = 0;
    const char *line = may_reply(client) ? fcsl_client_line(client, &size) : NULL;
    if (line == NULL) {
        if (size > REQUEST_BYTES_MAX) {
            atomic_fetch_add(&vars->counters.requests_refused, 1);
            drop(vars, client, "too_large", "a request has at most 65536 bytes");
        }
        return 0;
    }
    json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
    const serving_t serving = fcsl_commander_serve(&vars->commander, &client->session, line, size, &out);
    client->blocked = serving == BUSY;
    if (client->blocked) {
        return 0;
    }
    fcsl_client_next(client, size, now_ns());
    client->waiting = serving == POSTED;
    if (client->waiting) {
        vars->poster = (uint32_t)(client - vars->clients);
        vars->tick_by_ns = 0;
        return 0;
    }
    fcsl_client_put(client, &out, now_ns());
    if (serving == UNTRUSTED) {
        atomic_fetch_add(&vars->counters.clients_dropped, 1);
        client->closing = 1;
    } else if (client->session.bad_in_a_row >= BAD_IN_A_ROW_MAX) {
        drop(vars, client, "bad_json", "16 requests in a row were no JSON");
        return 0;
    }
    send_to(vars, client);
    return 1;
}

static void tend_client(fcsl_vars_t *vars, client_t *client, short events)
{
    if ((events & (POLLIN | POLLHUP | POLLERR)) != 0 && !fcsl_client_receive(client, now_ns())) {
        close_client(vars, client);
        return;
    }
    for (int i = 0; i < REQUESTS_PER_ROUND && client->fd >= 0 && serve_line(vars, client); i++) {
    }
    if (client->fd >= 0 && fcsl_client_unsent(client) > 0) {
        send_to(vars, client);
    }
    const char *why = client->fd >= 0 ? fcsl_client_overdue(client, now_ns()) : NULL;
    if (why != NULL && client->closing) {
        close_client(vars, client);
    } else if (why != NULL) {
        drop(vars, client, "too_slow", why);
        if (client->fd >= 0 && client->unsent_since_ns != 0) {
            close_client(vars, client);
        }
    }
}

static void accept_clients(fcsl_vars_t *vars)
{
    const int on = 1;
    for (size_t i = 0; i <= CLIENTS_MAX; i++) {
        client_t *client = NULL;
        const int fd = accept4(vars->listener.fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd < 0) {
            return;
        }
        if (vars->listener.tcp) {
            (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
        }
        for (size_t c = 0; c < CLIENTS_MAX && client == NULL; c++) {
            client = vars->clients[c].fd < 0 ? &vars->clients[c] : NULL;
        }
        if (client != NULL) {
            fcsl_client_begin(client, fd, vars->listener.secret[0] == '\0', now_ns());
            continue;
        }
        char text[256];
        json_out_t out;
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_commander_error(&out, "too_many_clients", "at most 64 clients are served at a time");
        (void)send(fd, text, out.at, MSG_NOSIGNAL | MSG_DONTWAIT);
        (void)close(fd);
        atomic_fetch_add(&vars->counters.clients_dropped, 1);
    }
}

/* ---- the command under way ----------------------------------------------------------------------------------------- */

static int subscribers_have_room(const fcsl_vars_t *vars)
{
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        const client_t *client = &vars->clients[i];
        if (client->fd >= 0 && fcsl_client_unsent(client) > SAMPLES_BYTES_MAX / 2u) {
            return 0;
        }
    }
    return 1;
}

/* Hands over the next ticks of a `tick` that is made in portions, once subscribers have taken those before. */
static void continue_ticks(fcsl_vars_t *vars)
{
    commander_t *commander = &vars->commander;
    const uint64_t now = now_ns();
    vars->tick_by_ns = vars->tick_by_ns == 0 ? now + TICK_PATIENCE_NS : vars->tick_by_ns;
    if (!subscribers_have_room(vars) && now < vars->tick_by_ns) {
        return;
    }
    const uint64_t most = commander->ticks_at_once == 0 ? commander->ticks_left : commander->ticks_at_once;
    const uint64_t count = commander->ticks_left < most ? commander->ticks_left : most;
    vars->mailbox.command.count = count;
    commander->ticks_left -= count;
    vars->tick_by_ns = 0;
    fcsl_mailbox_post(&vars->mailbox);
}

static void finish_command(fcsl_vars_t *vars)
{
    client_t *client = vars->poster < CLIENTS_MAX ? &vars->clients[vars->poster] : NULL;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
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
    fcsl_client_put(client, &out, now_ns());
    send_to(vars, client);
}

static void tend_command(fcsl_vars_t *vars)
{
    commander_t *commander = &vars->commander;
    if (fcsl_mailbox_done(&vars->mailbox)) {
        const int goes_on = vars->mailbox.command.kind == COMMAND_TICK &&
                            vars->mailbox.command.status == FCSL_VARS_OK && vars->poster < CLIENTS_MAX;
        commander->ticks_left = goes_on ? commander->ticks_left : 0;
        fcsl_vars_stream(vars, now_ns());
        if (commander->ticks_left == 0) {
            finish_command(vars);
        }
    }
    if (commander->ticks_left > 0 && fcsl_mailbox_is_free(&vars->mailbox)) {
        continue_ticks(vars);
    }
}

/* ---- rounds -------------------------------------------------------------------------------------------------------- */

/* What a client is waited for; whether it has a request that was left for the coming round. */
static int watch(const client_t *client, struct pollfd *entry)
{
    size_t size = 0;
    const int more = client->received <= REQUEST_BYTES_MAX && may_reply(client);
    *entry = (struct pollfd){.fd = -1};
    if (client->fd < 0) {
        return 0;
    }
    entry->events = (short)((more ? POLLIN : 0) | (fcsl_client_unsent(client) > 0 ? POLLOUT : 0));
    entry->fd = entry->events != 0 ? client->fd : -1;
    return may_reply(client) && client->received > 0 && fcsl_client_line(client, &size) != NULL;
}

/* 0 when the server is to end. */
static int run_round(fcsl_vars_t *vars)
{
    struct pollfd entries[ENTRIES];
    int timeout = fcsl_vars_prepare_streams(vars) ? STREAM_POLL_MS : POLL_MS;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        timeout = watch(&vars->clients[i], &entries[i]) ? 0 : timeout;
    }
    entries[CLIENTS_MAX] = (struct pollfd){.fd = vars->listener.fd, .events = POLLIN};
    entries[CLIENTS_MAX + 1] = (struct pollfd){.fd = vars->mailbox.answered, .events = POLLIN};
    entries[CLIENTS_MAX + 2] = (struct pollfd){.fd = vars->stop, .events = POLLIN};
    const int ready = poll(entries, ENTRIES, timeout);
    if ((ready < 0 && errno != EINTR) || (ready > 0 && entries[CLIENTS_MAX + 2].revents != 0)) {
        return 0;
    }
    tend_command(vars);
    fcsl_vars_stream(vars, now_ns());
    const uint32_t first = vars->next;
    for (uint32_t i = 0; i < CLIENTS_MAX; i++) {
        const uint32_t number = (first + i) % CLIENTS_MAX;
        if (vars->clients[number].fd >= 0) {
            tend_client(vars, &vars->clients[number], (short)(ready > 0 ? entries[number].revents : 0));
        }
    }
    if (ready > 0 && entries[CLIENTS_MAX].revents != 0) {
        accept_clients(vars);
    }
    return 1;
}

static void *run_server(void *argument)
{
    fcsl_vars_t *vars = argument;
    while (run_round(vars)) {
    }
    if (vars->poster < CLIENTS_MAX) {
        client_t *client = &vars->clients[vars->poster];
        json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
        fcsl_commander_abandon(&vars->commander, &client->session, &out);
        fcsl_client_put(client, &out, now_ns());
        send_to(vars, client);
    }
    return NULL;
}

/* ---- the library's interface --------------------------------------------------------------------------------------- */

static int allocate(fcsl_vars_t *vars, const fcsl_vars_block_t *blocks, uint32_t block_count)
{
    commander_t *commander = &vars->commander;
    size_t bytes = fcsl_history_bytes(vars->history);
    vars->sample = malloc(bytes + 1u);
    /* Either a checkpoint, or the values of a set: every scalar of it has a token. */
    bytes = bytes > 8u * TOKENS_MAX ? bytes : 8u * TOKENS_MAX;
    commander->history = vars->history;
    commander->host = &vars->host;
    commander->mailbox = &vars->mailbox;
    commander->counters = &vars->counters;
    commander->secret = vars->listener.secret;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (fcsl_client_allocate(&vars->clients[i]) != 0) {
            return -1;
        }
    }
    return vars->sample != NULL && fcsl_mailbox_open(&vars->mailbox, bytes) == 0 &&
                   fcsl_catalog_open(&commander->catalog, blocks, block_count, vars->history) == 0
               ? fcsl_commander_open(commander)
               : -1;
}

fcsl_vars_t *fcsl_vars_open(const fcsl_vars_options_t *options, const fcsl_vars_block_t *blocks, uint32_t block_count,
                            const fcsl_history_t *history, const fcsl_vars_host_t *host, fcsl_error_t *error)
{
    fcsl_vars_t *vars = calloc(1, sizeof *vars);
    if (vars == NULL) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the variable server");
        return NULL;
    }
    vars->listener.fd = -1;
    vars->mailbox.answered = -1;
    vars->poster = CLIENTS_MAX;
    vars->history = history;
    vars->host = *host;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        vars->clients[i].fd = -1;
    }
    vars->stop = eventfd(0, EFD_CLOEXEC);
    if (vars->stop < 0 || allocate(vars, blocks, block_count) != 0) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the variable server");
        fcsl_vars_close(vars);
        return NULL;
    }
    if (fcsl_listener_open(&vars->listener, options, error) != 0) {
        fcsl_vars_close(vars);
        return NULL;
    }
    return vars;
}

int fcsl_vars_start(fcsl_vars_t *vars, fcsl_error_t *error)
{
    const int code = pthread_create(&vars->thread, NULL, run_server, vars);
    if (code != 0) {
        (void)snprintf(error->text, sizeof error->text, "cannot start the variable server: %s", strerror(code));
        return -1;
    }
    vars->started = 1;
    return 0;
}

void fcsl_vars_close(fcsl_vars_t *vars)
{
    if (vars == NULL) {
        return;
    }
    if (vars->started) {
        const uint64_t one = 1;
        const ssize_t written = write(vars->stop, &one, sizeof one);
        (void)written; /* an eventfd takes its first increment */
        (void)pthread_join(vars->thread, NULL);
    }
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (vars->clients[i].fd >= 0) {
            fcsl_client_close(&vars->clients[i]);
        }
        fcsl_client_free(&vars->clients[i]);
    }
    fcsl_commander_free(&vars->commander);
    fcsl_catalog_free(&vars->commander.catalog);
    fcsl_mailbox_free(&vars->mailbox);
    fcsl_listener_close(&vars->listener);
    if (vars->stop >= 0) {
        (void)close(vars->stop);
    }
    free(vars->sample);
    free(vars);
}

const char *fcsl_vars_address(const fcsl_vars_t *vars)
{
    return vars->listener.address;
}

void fcsl_vars_count(const fcsl_vars_t *vars, fcsl_vars_counters_t *counters)
{
    const service_counters_t *found = &vars->counters;
    *counters = (fcsl_vars_counters_t){.requests = atomic_load(&found->requests),
                                       .requests_refused = atomic_load(&found->requests_refused),
                                       .clients_dropped = atomic_load(&found->clients_dropped),
                                       .samples_lost = atomic_load(&found->samples_lost)};
}
