/* SPDX-License-Identifier: Apache-2.0
 *
 * server.h: what clients send to the socket of the variable server, in pieces. Input: pieces of client (1), length (2),
 * bytes; bit 7 of the client sends the piece 64 times, a length of 65535 ends the connection. Client 3 leaves its replies
 * unread.
 */
#include "vars/server.c" /* whose memory is taken here, and whose loop runs here, in this thread */

#include <sys/socket.h>

#include "vars_host.h"

enum { CLIENTS = 4, LENGTH_END = 0xffff, MANY = 64 };

static void drain(int fd)
{
    char text[4096];
    while (recv(fd, text, sizeof text, MSG_DONTWAIT) > 0) {
    }
}

/* Buffers alone outlive an input: they are large. */
static void open_connections(fcsl_vars_t *vars, int *ends)
{
    static fcsl_vars_block_t block;
    if (vars->protocol.tokens == NULL) {
        block = hosted_block();
        vars->history = &hosted.history;
        vars->listener.fd = -1;
        vars->wakeup = -1; /* no other thread waits */
        FUZZ_CHECK(allocate(vars, &block, 1) == 0);
    }
    vars->host = hosted_host(); /* of this input's run */
    vars->protocol.snapshot_of = 0;
    vars->protocol.checkpoint.number = 0;
    vars->protocol.ticks_left = 0;
    vars->command_client = CLIENTS_MAX;
    vars->cursor = 0;
    vars->overtaken = 0;
    vars->used = CLIENTS;
    for (size_t i = 0; i < CLIENTS; i++) {
        int pair[2];
        FUZZ_CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair) == 0);
        fcsl_client_begin(&vars->clients[i], pair[0], 1, fcsl_run_monotonic_ns(NULL));
        ends[i] = pair[1];
    }
}

/* A turn of the event loop, and the step thread's part behind it. */
static void run(fcsl_vars_t *vars, size_t i, const int *ends)
{
    client_t *client = &vars->clients[i];
    const uint64_t now_ns = fcsl_run_monotonic_ns(NULL);
    struct pollfd entry;
    (void)fcsl_vars_prepare_streams(vars);
    (void)fcsl_vars_watch(client, &entry);
    if (client->fd >= 0) {
        fcsl_vars_serve_client(vars, client, entry.fd >= 0 ? entry.events : 0, now_ns);
    }
    fcsl_vars_serve(vars);
    fcsl_vars_reply_command(vars, now_ns);
    fcsl_vars_stream(vars, now_ns);
    for (size_t c = 0; c < CLIENTS; c++) {
        FUZZ_CHECK(vars->clients[c].received <= REQUEST_BYTES_MAX + 1u);
        FUZZ_CHECK(vars->clients[c].out_from <= vars->clients[c].out_to && vars->clients[c].out_to <= OUT_BYTES);
        if (ends[c] >= 0 && c + 1u < CLIENTS) {
            drain(ends[c]);
        }
    }
}

static void close_connections(fcsl_vars_t *vars, int *ends)
{
    for (size_t i = 0; i < CLIENTS; i++) {
        if (ends[i] >= 0) {
            (void)close(ends[i]);
            ends[i] = -1;
        }
    }
    /* A command under way ends, whoever it was for. */
    for (int turn = 0; turn < 1000 && (vars->protocol.ticks_left > 0 || !fcsl_slot_is_free(&vars->slot)); turn++) {
        run(vars, 0, ends);
    }
    FUZZ_CHECK(vars->protocol.ticks_left == 0 && fcsl_slot_is_free(&vars->slot));
    for (size_t i = 0; i < CLIENTS; i++) {
        if (vars->clients[i].fd >= 0) {
            fcsl_vars_close_client(vars, &vars->clients[i]);
        }
    }
}

static void send_piece(fcsl_vars_t *vars, int *ends, bytes_t *bytes)
{
    const uint64_t who = take_number(bytes, 1);
    const size_t i = (size_t)who % CLIENTS;
    size_t length = (size_t)take_number(bytes, 2);
    if (length == LENGTH_END && ends[i] >= 0) {
        (void)close(ends[i]);
        ends[i] = -1;
        run(vars, i, ends);
        return;
    }
    uint8_t *piece = take_copy(bytes, &length);
    for (int turn = 0; turn < ((who & 0x80u) != 0 ? MANY : 1) && ends[i] >= 0; turn++) {
        (void)send(ends[i], piece, length, MSG_NOSIGNAL | MSG_DONTWAIT);
        run(vars, i, ends);
    }
    free(piece);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static fcsl_vars_t vars;
    bytes_t bytes = {data, size};
    int ends[CLIENTS];
    hosted_open();
    open_connections(&vars, ends);
    while (bytes.left > 0) {
        send_piece(&vars, ends, &bytes);
    }
    close_connections(&vars, ends);
    hosted_close();
    return 0;
}
