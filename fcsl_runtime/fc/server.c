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

enum { CLIENTS_MAX = 8, BACKLOG = 8, PATH_BYTES = 128, POLL_MS = 200 };
/* A client that leaves a reply unread for this long is dropped. */
static const uint64_t UNREAD_MAX_NS = 5000000000u;

typedef struct {
    int fd; /* -1: free */
    int closing; /* drop once the reply is sent */
    size_t received;
    size_t reply_size;
    size_t reply_sent;
    uint64_t reply_since_ns;
    char *request; /* REQUEST_BYTES_MAX + 1: the newline */
    char *reply;   /* REPLY_BYTES_MAX */
} client_t;

struct server {
    int listener;
    int stop; /* eventfd */
    int started;
    atomic_int ended;
    pthread_t thread;
    service_counters_t *counters;
    commander_t commander;
    client_t clients[CLIENTS_MAX];
    char path[PATH_BYTES];
};

static void close_client(client_t *client)
{
    (void)close(client->fd);
    client->fd = -1;
}

static void drop_client(server_t *server, client_t *client)
{
    close_client(client);
    atomic_fetch_add(&server->counters->clients_dropped, 1);
}

/* Sends what is left of the reply without waiting. */
static void send_reply(server_t *server, client_t *client)
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

static void start_reply(server_t *server, client_t *client, size_t size)
{
    client->reply_size = size;
    client->reply_sent = 0;
    client->reply_since_ns = fcsl_run_monotonic_ns(NULL);
    send_reply(server, client);
}

/* Serves the complete lines that were received, one reply at a time. */
static void serve_lines(server_t *server, client_t *client)
{
    while (client->fd >= 0 && client->reply_size == 0) {
        const char *newline = memchr(client->request, '\n', client->received);
        if (newline == NULL) {
            if (client->received > REQUEST_BYTES_MAX) {
                client->closing = 1;
                atomic_fetch_add(&server->counters->requests_refused, 1);
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

static void receive(server_t *server, client_t *client)
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

static void accept_client(server_t *server)
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
    atomic_fetch_add(&server->counters->clients_dropped, 1);
}

static void tend_client(server_t *server, client_t *client, short events)
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
    server_t *server = argument;
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
    atomic_store(&server->ended, 1);
    return NULL;
}

static int allocate(server_t *server, const fcsl_machine_t *machine, mailbox_t *mailbox)
{
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        server->clients[i].request = malloc(REQUEST_BYTES_MAX + 1u);
        server->clients[i].reply = malloc(REPLY_BYTES_MAX);
        if (server->clients[i].request == NULL || server->clients[i].reply == NULL) {
            return -1;
        }
    }
    return commander_open(&server->commander, machine, mailbox, server->counters);
}

server_t *server_listen(const char *path, const fcsl_machine_t *machine, mailbox_t *mailbox,
                        service_counters_t *counters, fcsl_error_t *error)
{
    server_t *server = calloc(1, sizeof *server);
    if (server == NULL) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the command server");
        return NULL;
    }
    server->listener = -1;
    server->counters = counters;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        server->clients[i].fd = -1;
    }
    server->stop = eventfd(0, EFD_CLOEXEC);
    if (server->stop < 0 || allocate(server, machine, mailbox) != 0) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the command server");
        server_free(server);
        return NULL;
    }
    server->listener = fcsl_socket_listen(path, SOCK_STREAM, BACKLOG, error->text, sizeof error->text);
    if (server->listener < 0) {
        server_free(server);
        return NULL;
    }
    (void)snprintf(server->path, sizeof server->path, "%s", path);
    return server;
}

int server_start(server_t *server, fcsl_error_t *error)
{
    const int code = pthread_create(&server->thread, NULL, run_server, server);
    if (code != 0) {
        (void)snprintf(error->text, sizeof error->text, "cannot start the command server: %s", strerror(code));
        return -1;
    }
    server->started = 1;
    return 0;
}

void server_stop(server_t *server)
{
    const uint64_t one = 1;
    const ssize_t written = write(server->stop, &one, sizeof one);
    (void)written; /* an eventfd takes its first increment */
}

int server_ended(const server_t *server)
{
    return !server->started || atomic_load(&server->ended);
}

void server_free(server_t *server)
{
    if (server == NULL) {
        return;
    }
    if (server->started) {
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
    if (server->listener >= 0) {
        (void)close(server->listener);
        (void)unlink(server->path);
    }
    if (server->stop >= 0) {
        (void)close(server->stop);
    }
    free(server);
}
