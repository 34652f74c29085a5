/* SPDX-License-Identifier: Apache-2.0
 *
 * What the server's thread does about each client in a round: takes and serves its requests, sends, drops whom it must.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server.h"

void fcsl_vars_close_client(fcsl_vars_t *vars, client_t *client)
{
    if (client->waiting) {
        vars->poster = CLIENTS_MAX;
    }
    fcsl_client_close(client);
    while (vars->used > 0 && vars->clients[vars->used - 1u].fd < 0) {
        vars->used--;
    }
}

void fcsl_vars_send(fcsl_vars_t *vars, client_t *client, uint64_t now_ns)
{
    if (!fcsl_client_send(client, now_ns) || (client->closing && fcsl_client_unsent(client) == 0)) {
        fcsl_vars_close_client(vars, client);
    }
}

/* Tells it why, as far as it still reads, and closes. */
static void drop(fcsl_vars_t *vars, client_t *client, const char *code, const char *why, uint64_t now_ns)
{
    json_out_t out = fcsl_client_room(client, OUT_BYTES);
    fcsl_commander_error(&out, code, why);
    if (!out.overflow) {
        fcsl_client_put(client, &out, now_ns);
    }
    atomic_fetch_add(&vars->counters.clients_dropped, 1);
    client->closing = 1;
    fcsl_vars_send(vars, client, now_ns);
}

/* A reply of the longest kind fits behind what is unsent. */
static int may_reply(const client_t *client)
{
    return client->fd >= 0 && !client->closing && !client->waiting && !client->blocked &&
           fcsl_client_unsent(client) <= SAMPLES_BYTES_MAX;
}

/* Serves one line; 0 when there is none that can be served now. */
static int serve_line(fcsl_vars_t *vars, client_t *client, uint64_t now_ns)
{
    size_t size = 0;
    const char *line = may_reply(client) ? fcsl_client_line(client, &size) : NULL;
    if (line == NULL) {
        if (size > REQUEST_BYTES_MAX) {
            atomic_fetch_add(&vars->counters.requests_refused, 1);
            drop(vars, client, "too_large", "a request has at most 65536 bytes", now_ns);
        }
        return 0;
    }
    json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
    const serving_t serving = fcsl_commander_serve(&vars->commander, &client->session, line, size, &out);
    client->blocked = serving == BUSY;
    if (client->blocked) {
        return 0;
    }
    fcsl_client_next(client, size, now_ns);
    client->waiting = serving == POSTED;
    if (client->waiting) {
        vars->poster = (uint32_t)(client - vars->clients);
        vars->tick_by_ns = 0;
        return 0;
    }
    fcsl_client_put(client, &out, now_ns);
    if (serving == UNTRUSTED) {
        atomic_fetch_add(&vars->counters.clients_dropped, 1);
        client->closing = 1;
    } else if (client->session.bad_in_a_row >= BAD_IN_A_ROW_MAX) {
        drop(vars, client, "bad_json", "16 requests in a row were no JSON", now_ns);
        return 0;
    }
    fcsl_vars_send(vars, client, now_ns);
    return 1;
}

void fcsl_vars_serve_client(fcsl_vars_t *vars, client_t *client, short events, uint64_t now_ns)
{
    size_t size = 0;
    if (client->waiting && (events & (POLLHUP | POLLERR)) != 0) {
        fcsl_vars_close_client(vars, client); /* nobody is there for the reply, nor for the rest of a long `tick` */
        return;
    }
    if ((events & (POLLIN | POLLHUP | POLLERR)) != 0 && !fcsl_client_receive(client, now_ns)) {
        fcsl_vars_close_client(vars, client);
        return;
    }
    for (int i = 0; i < REQUESTS_PER_ROUND && client->fd >= 0 && serve_line(vars, client, now_ns); i++) {
    }
    if (client->fd >= 0 && client->ended && !client->waiting && !client->blocked &&
        fcsl_client_line(client, &size) == NULL) {
        client->closing = 1;
    }
    if (client->fd >= 0 && (fcsl_client_unsent(client) > 0 || client->closing)) {
        fcsl_vars_send(vars, client, now_ns);
    }
    const char *why = client->fd >= 0 ? fcsl_client_overdue(client, now_ns) : NULL;
    if (why != NULL && client->closing) {
        fcsl_vars_close_client(vars, client);
    } else if (why != NULL) {
        drop(vars, client, "too_slow", why, now_ns);
        if (client->fd >= 0 && client->unsent_since_ns != 0) {
            fcsl_vars_close_client(vars, client);
        }
    }
}

/* Small requests go out at once; a client whose computer or network is gone is noticed, whether it has anything to read or
 * not. */
static void tune_tcp(int fd)
{
    static const int on = 1;
    static const int idle_s = SILENCE_MAX_S / 2;
    static const int interval_s = SILENCE_MAX_S / 4;
    static const unsigned silence_ms = SILENCE_MAX_S * 1000u; /* Linux takes it in place of TCP_KEEPCNT, too */
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    (void)setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &silence_ms, sizeof silence_ms);
}

/* The connection without the token that has waited longest, when there are too many of them or no place is left; else null. */
static client_t *find_untrusted(fcsl_vars_t *vars)
{
    client_t *oldest = NULL;
    size_t untrusted = 0;
    size_t connected = 0;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        client_t *client = &vars->clients[i];
        connected += client->fd >= 0;
        if (client->fd >= 0 && !client->session.trusted) {
            untrusted++;
            oldest = oldest == NULL || client->number < oldest->number ? client : oldest;
        }
    }
    return untrusted >= UNTRUSTED_MAX || connected == CLIENTS_MAX ? oldest : NULL;
}

/* A free place, or null. Whoever has not sent the token cannot keep it from those who have. */
static client_t *find_place(fcsl_vars_t *vars, uint64_t now_ns)
{
    client_t *untrusted = find_untrusted(vars);
    if (untrusted != NULL) {
        drop(vars, untrusted, "too_many_clients",
             "too many connections have sent no token: this one has waited longest", now_ns);
        if (untrusted->fd >= 0) {
            fcsl_vars_close_client(vars, untrusted);
        }
    }
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (vars->clients[i].fd < 0) {
            return &vars->clients[i];
        }
    }
    return NULL;
}

void fcsl_vars_accept(fcsl_vars_t *vars, uint64_t now_ns)
{
    for (size_t i = 0; i <= CLIENTS_MAX; i++) {
        const int fd = accept4(vars->listener.fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd < 0 && (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED)) {
            return;
        }
        if (fd < 0) {
            /* Out of descriptors, say. It would be tried in every round, and nothing would have changed. */
            vars->accept_at_ns = now_ns + POLL_MS * UINT64_C(1000000);
            atomic_fetch_add(&vars->counters.clients_dropped, 1);
            return;
        }
        if (vars->listener.tcp) {
            tune_tcp(fd);
        }
        client_t *client = find_place(vars, now_ns);
        if (client != NULL) {
            const uint32_t place = (uint32_t)(client - vars->clients);
            vars->used = place < vars->used ? vars->used : place + 1u;
            client->number = vars->connections++;
            fcsl_client_begin(client, fd, vars->listener.secret[0] == '\0', now_ns);
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

int fcsl_vars_watch(const client_t *client, struct pollfd *entry)
{
    size_t size = 0;
    const int more = client->received <= REQUEST_BYTES_MAX && may_reply(client) && !client->ended;
    *entry = (struct pollfd){.fd = -1};
    if (client->fd < 0) {
        return FOREVER;
    }
    entry->events = (short)((more ? POLLIN : 0) | (fcsl_client_unsent(client) > 0 ? POLLOUT : 0));
    entry->fd = entry->events != 0 || client->waiting ? client->fd : -1; /* poll tells of a hang-up unasked */
    if (may_reply(client) && client->received > 0 && fcsl_client_line(client, &size) != NULL) {
        return 0; /* a request was left for the coming round */
    }
    return client->unsent_since_ns != 0 || client->unread_since_ns != 0 || client->closing ? POLL_MS : FOREVER;
}
