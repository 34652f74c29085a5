/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "server.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fcsl/fcsl_socket.h"

enum { BACKLOG = 8, POLL_MS = 200 };
/* A client that leaves a reply unread for this long is dropped. */
static const uint64_t UNREAD_MAX_NS = 5000000000u;

static void close_client(client_t *client)
{
    (void)close(client->fd);
    client->fd = -1;
}

static void drop_client(fcsl_vars_t *server, client_t *client)
{
    close_client(client);
    atomic_fetch_add(&server->counters.clients_dropped, 1);
}

/* Sends what is left of the reply without waiting. */
static void send_reply(fcsl_vars_t *server, client_t *client)
{
    while (client->reply_sent < client->reply_size) {
        const ssize_t sent = send(client->fd, client->reply + client->reply_sent,
                                  client->reply_size - client->reply_sent, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent <= 0) {
            if (sent < 0 && (errno == EAGAIN || errno == EINTR)) {
                return;
            }
            drop_client(server, client);
            return;
        }
        client->reply_sent += (size_t)sent;
    }
    client->reply_size = 0;
    client->reply_sent = 0;
    if (client->closing) {
        drop_client(server, client);
    }
}

static void start_reply(fcsl_vars_t *server, client_t *client, size_t size)
{
    client->reply_size = size;
    client->reply_sent = 0;
    client->reply_since_ns = fcsl_run_monotonic_ns(NULL);
    send_reply(server, client);
}

/* Serves the complete lines that were received, one reply at a time. */
static void serve_lines(fcsl_vars_t *server, client_t *client)
{
    while (client->fd >= 0 && client->reply_size == 0) {
        const char *newline = memchr(client->request, '\n', client->received);
        if (newline == NULL) {
            if (client->received > REQUEST_BYTES_MAX) {
                client->closing = 1;
                atomic_fetch_add(&server->counters.requests_refused, 1);
                start_reply(
                    server, client,
                    commander_error(client->reply, REPLY_BYTES_MAX, "too_large", "a request has at most 65536 bytes"));
            }
            return;
        }
        const size_t line = (size_t)(newline - client->request);
        const size_t size = commander_serve(&server->commander, client->request, line, client->reply, REPLY_BYTES_MAX);
        client->received -= line + 1;
        memmove(client->request, newline + 1, client->received);
        start_reply(server, client, size);
    }
}

static void receive(fcsl_vars_t *server, client_t *client)
{
    const ssize_t got =
        recv(client->fd, client->request + client->received, REQUEST_BYTES_MAX + 1u - client->received, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return;
    }
    if (got <= 0) {
        close_client(client);
        return;
    }
    client->received += (size_t)got;
    serve_lines(server, client);
}

static void accept_client(fcsl_vars_t *server)
{
    const int fd = accept4(server->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
        return;
    }
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        client_t *client = &server->clients[i];
        if (client->fd < 0) {
            client->fd = fd;
            client->closing = 0;
            client->received = 0;
            client->reply_size = 0;
            client->reply_sent = 0;
            return;
        }
    }
    char text[256];
    const size_t size =
        commander_error(text, sizeof text, "too_many_clients", "at most 8 clients are served at a time");
    (void)send(fd, text, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    (void)close(fd);
    atomic_fetch_add(&server->counters.clients_dropped, 1);
}

static void tend_client(fcsl_vars_t *server, client_t *client, short events)
{
    if (client->reply_size > 0) {
        if (events != 0) {
            send_reply(server, client);
            if (client->fd >= 0) {
                serve_lines(server, client);
            }
        }
        if (client->fd >= 0 && client->reply_size > 0 &&
            fcsl_run_monotonic_ns(NULL) - client->reply_since_ns > UNREAD_MAX_NS) {
            drop_client(server, client);
        }
    } else if (events != 0) {
        receive(server, client);
    }
}

static void *run_server(void *argument)
{
    fcsl_vars_t *server = argument;
    for (;;) {
        struct pollfd entries[CLIENTS_MAX + 2] = {0};
        for (size_t i = 0; i < CLIENTS_MAX; i++) {
            const client_t *client = &server->clients[i];
            /* Nothing more is read from a client before it has read its reply. */
            entries[i] = (struct pollfd){.fd = client->fd, .events = client->reply_size > 0 ? POLLOUT : POLLIN};
        }
        entries[CLIENTS_MAX] = (struct pollfd){.fd = server->listener, .events = POLLIN};
        entries[CLIENTS_MAX + 1] = (struct pollfd){.fd = server->stop, .events = POLLIN};
        const int ready = poll(entries, CLIENTS_MAX + 2, POLL_MS);
        if ((ready < 0 && errno != EINTR) || entries[CLIENTS_MAX + 1].revents != 0) {
            break;
        }
        for (size_t i = 0; ready >= 0 && i < CLIENTS_MAX; i++) {
            if (server->clients[i].fd >= 0) {
                tend_client(server, &server->clients[i], entries[i].revents);
            }
        }
        if (ready > 0 && entries[CLIENTS_MAX].revents != 0) {
            accept_client(server);
        }
    }
    return NULL;
}

static int allocate(fcsl_vars_t *server)
{
    const size_t bytes = fcsl_history_bytes(server->history);
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        server->clients[i].request = malloc(REQUEST_BYTES_MAX + 1u);
        server->clients[i].reply = malloc(REPLY_BYTES_MAX);
        if (server->clients[i].request == NULL || server->clients[i].reply == NULL) {
            return -1;
        }
    }
    server->commander = (commander_t){.machine = server->blocks[0].machine,
                                      .history = server->history,
                                      .host = &server->host,
                                      .mailbox = &server->mailbox,
                                      .stop = server->stop,
                                      .counters = &server->counters};
    return fcsl_mailbox_open(&server->mailbox, bytes > REQUEST_BYTES_MAX ? bytes : REQUEST_BYTES_MAX) == 0
               ? commander_open(&server->commander)
               : -1;
}

static fcsl_vars_t *give_up(fcsl_vars_t *server, fcsl_error_t *error, const char *why)
{
    if (why != NULL) {
        (void)snprintf(error->text, sizeof error->text, "%s", why);
    }
    fcsl_vars_close(server);
    return NULL;
}

fcsl_vars_t *fcsl_vars_open(const fcsl_vars_options_t *options, const fcsl_vars_block_t *blocks, uint32_t block_count,
                            const fcsl_history_t *history, const fcsl_vars_host_t *host, fcsl_error_t *error)
{
    static const char NO_MEMORY[] = "out of memory for the variable server";
    fcsl_vars_t *server = calloc(1, sizeof *server);
    if (server == NULL) {
        return give_up(NULL, error, NO_MEMORY);
    }
    server->listener = -1;
    server->mailbox.answered = -1;
    server->blocks = blocks;
    server->block_count = block_count;
    server->history = history;
    server->host = *host;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        server->clients[i].fd = -1;
    }
    server->stop = eventfd(0, EFD_CLOEXEC);
    if (server->stop < 0 || allocate(server) != 0) {
        return give_up(server, error, NO_MEMORY);
    }
    server->listener = fcsl_socket_listen(options->address, SOCK_STREAM, BACKLOG, error->text, sizeof error->text);
    if (server->listener < 0) {
        return give_up(server, error, NULL);
    }
    (void)snprintf(server->address, sizeof server->address, "%s", options->address);
    return server;
}

int fcsl_vars_start(fcsl_vars_t *server, fcsl_error_t *error)
{
    const int code = pthread_create(&server->thread, NULL, run_server, server);
    if (code != 0) {
        (void)snprintf(error->text, sizeof error->text, "cannot start the variable server: %s", strerror(code));
        return -1;
    }
    server->started = 1;
    return 0;
}

void fcsl_vars_close(fcsl_vars_t *server)
{
    if (server == NULL) {
        return;
    }
    if (server->started) {
        const uint64_t one = 1;
        const ssize_t written = write(server->stop, &one, sizeof one);
        (void)written; /* an eventfd takes its first increment */
        (void)pthread_join(server->thread, NULL);
    }
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (server->clients[i].fd >= 0) {
            (void)close(server->clients[i].fd);
        }
        free(server->clients[i].request);
        free(server->clients[i].reply);
    }
    commander_free(&server->commander);
    fcsl_mailbox_free(&server->mailbox);
    if (server->listener >= 0) {
        (void)close(server->listener);
        (void)unlink(server->address);
    }
    if (server->stop >= 0) {
        (void)close(server->stop);
    }
    free(server);
}

const char *fcsl_vars_address(const fcsl_vars_t *server)
{
    return server->address;
}

void fcsl_vars_count(const fcsl_vars_t *server, fcsl_vars_counters_t *counters)
{
    *counters = (fcsl_vars_counters_t){.requests = atomic_load(&server->counters.requests),
                                       .requests_refused = atomic_load(&server->counters.requests_refused),
                                       .clients_dropped = atomic_load(&server->counters.clients_dropped)};
}
