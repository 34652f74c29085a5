/* SPDX-License-Identifier: Apache-2.0
 *
 * server.h: what clients send to the socket of fcsl-fc, in pieces. Input: pieces of client (1), length (2), bytes; bit 7 of
 * the client sends the piece 64 times, a length of 65535 ends the connection. Client 3 leaves its replies unread.
 */
#include "server.c" /* serves connections that are made here, in this thread */

#include "hosted.h"

enum { CLIENTS = 4, LENGTH_END = 0xffff, MANY = 64 };

static void drain(int fd)
{
    char text[4096];
    while (recv(fd, text, sizeof text, MSG_DONTWAIT) > 0) {
    }
}

/* Buffers alone outlive an input: they are large. */
static void open_connections(server_t *server, int *ends)
{
    static service_counters_t counters;
    if (server->clients[0].request == NULL) {
        *server = (server_t){.listener = -1, .stop = -1, .counters = &counters};
        FUZZ_CHECK(allocate(server, fcsl_machines[0], &hosted_mailbox) == 0);
    }
    for (size_t i = 0; i < CLIENTS; i++) {
        int pair[2];
        client_t *client = &server->clients[i];
        FUZZ_CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair) == 0);
        *client = (client_t){.fd = pair[0], .request = client->request, .reply = client->reply};
        ends[i] = pair[1];
    }
}

static void close_connections(server_t *server, const int *ends)
{
    for (size_t i = 0; i < CLIENTS; i++) {
        if (server->clients[i].fd >= 0) {
            close_client(&server->clients[i]);
        }
        if (ends[i] >= 0) {
            (void)close(ends[i]);
        }
    }
}

static void tend(server_t *server, size_t i, int end)
{
    client_t *client = &server->clients[i];
    for (int turn = 0; turn < 4 && client->fd >= 0; turn++) {
        tend_client(server, client, client->reply_size > 0 ? POLLOUT : POLLIN);
        if (end >= 0 && i + 1u < CLIENTS) {
            drain(end);
        }
    }
    FUZZ_CHECK(client->received <= REQUEST_BYTES_MAX + 1u && client->reply_sent <= client->reply_size);
}

static void send_piece(server_t *server, int *ends, bytes_t *bytes)
{
    const uint64_t who = take_number(bytes, 1);
    const size_t i = (size_t)who % CLIENTS;
    size_t length = (size_t)take_number(bytes, 2);
    if (length == LENGTH_END && ends[i] >= 0) {
        (void)close(ends[i]);
        ends[i] = -1;
        tend(server, i, -1);
        return;
    }
    uint8_t *piece = take_copy(bytes, &length);
    for (int turn = 0; turn < ((who & 0x80u) != 0 ? MANY : 1) && ends[i] >= 0; turn++) {
        (void)send(ends[i], piece, length, MSG_NOSIGNAL | MSG_DONTWAIT);
        tend(server, i, ends[i]);
    }
    free(piece);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static server_t server;
    bytes_t bytes = {data, size};
    int ends[CLIENTS];
    hosted_open();
    open_connections(&server, ends);
    while (bytes.left > 0) {
        send_piece(&server, ends, &bytes);
    }
    close_connections(&server, ends);
    hosted_close();
    return 0;
}
