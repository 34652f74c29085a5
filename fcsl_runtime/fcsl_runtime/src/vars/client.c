/* SPDX-License-Identifier: Apache-2.0
 *
 * One connection: received requests, unsent replies, time limits.
 */
#define _GNU_SOURCE
#include "client.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const uint64_t UNSENT_MAX_NS = UNSENT_MAX_S * UINT64_C(1000000000);
static const uint64_t UNREAD_MAX_NS = UNREAD_MAX_S * UINT64_C(1000000000);

int fcsl_client_allocate(client_t *client)
{
    client->fd = -1;
    client->in = malloc(REQUEST_BYTES_MAX + 1u);
    client->out = malloc(OUT_BYTES);
    char *paths = malloc((size_t)SUBSCRIPTIONS_MAX * SUBSCRIBED_MAX * PATH_BYTES_MAX);
    for (size_t i = 0; paths != NULL && i < SUBSCRIPTIONS_MAX; i++) {
        client->subscriptions[i].paths = paths + i * SUBSCRIBED_MAX * PATH_BYTES_MAX;
    }
    return client->in != NULL && client->out != NULL && paths != NULL ? 0 : -1;
}

void fcsl_client_free(client_t *client)
{
    free(client->in);
    free(client->out);
    free(client->subscriptions[0].paths);
}

void fcsl_client_begin(client_t *client, int fd, int trusted, uint64_t now_ns)
{
    client->fd = fd;
    client->ended = 0;
    client->closing = 0;
    client->has_command = 0;
    client->blocked = 0;
    client->received = 0;
    client->out_from = 0;
    client->out_to = 0;
    client->unsent_since_ns = 0;
    client->unread_since_ns = now_ns;
    client->trusted = trusted;
    client->bad_in_a_row = 0;
    client->checkpoint_number = 0;
    for (size_t i = 0; i < SUBSCRIPTIONS_MAX; i++) {
        client->subscriptions[i].number = 0;
    }
}

void fcsl_client_close(client_t *client)
{
    (void)close(client->fd);
    client->fd = -1;
}

int fcsl_client_receive(client_t *client, uint64_t now_ns)
{
    const ssize_t got =
        recv(client->fd, client->in + client->received, REQUEST_BYTES_MAX + 1u - client->received, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return 1;
    }
    if (got < 0) {
        return 0;
    }
    client->ended = got == 0;
    client->received += (size_t)got;
    client->unread_since_ns = client->unread_since_ns == 0 ? now_ns : client->unread_since_ns;
    return 1;
}

const char *fcsl_client_line(const client_t *client, size_t *size)
{
    const char *newline = memchr(client->in, '\n', client->received);
    *size = newline != NULL ? (size_t)(newline - client->in) : client->received;
    return newline != NULL ? client->in : NULL;
}

void fcsl_client_next(client_t *client, size_t size, uint64_t now_ns)
{
    client->received -= size + 1u;
    memmove(client->in, client->in + size + 1u, client->received);
    client->unread_since_ns = client->received > 0 ? now_ns : 0;
}

size_t fcsl_client_unsent(const client_t *client)
{
    return client->out_to - client->out_from;
}

json_out_t fcsl_client_room(client_t *client, size_t capacity)
{
    json_out_t out;
    if (client->out_from > 0) {
        memmove(client->out, client->out + client->out_from, fcsl_client_unsent(client));
        client->out_to -= client->out_from;
        client->out_from = 0;
    }
    const size_t room = OUT_BYTES - client->out_to;
    fcsl_json_begin(&out, client->out + client->out_to, capacity < room ? capacity : room);
    return out;
}

void fcsl_client_put(client_t *client, const json_out_t *out, uint64_t now_ns)
{
    client->out_to += out->at;
    client->unsent_since_ns = client->unsent_since_ns == 0 ? now_ns : client->unsent_since_ns;
}

int fcsl_client_send(client_t *client, uint64_t now_ns)
{
    while (client->out_from < client->out_to) {
        const ssize_t sent =
            send(client->fd, client->out + client->out_from, fcsl_client_unsent(client), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent <= 0) {
            return sent < 0 && (errno == EAGAIN || errno == EINTR);
        }
        client->out_from += (size_t)sent;
        client->unsent_since_ns = now_ns;
    }
    client->unsent_since_ns = 0;
    return 1;
}

const char *fcsl_client_overdue(const client_t *client, uint64_t now_ns)
{
    if (client->unsent_since_ns != 0 && now_ns - client->unsent_since_ns > UNSENT_MAX_NS) {
        return "replies and samples were left unread for 5 s";
    }
    /* Only while the server waits for the client. */
    const int awaited = client->unread_since_ns != 0 && !client->has_command && !client->blocked &&
                        fcsl_client_unsent(client) <= SAMPLES_BYTES_MAX;
    if (awaited && now_ns - client->unread_since_ns > UNREAD_MAX_NS &&
        memchr(client->in, '\n', client->received) == NULL) {
        return "no complete request came for 10 s";
    }
    return NULL;
}
