/* SPDX-License-Identifier: Apache-2.0
 *
 * The event loop: each turn polls all clients, serves a few requests of each, and sends replies and samples. The server's
 * thread runs it. The step thread of a paused host, which has nothing else to do, may run it instead: then a command finds
 * it awake, and no thread wakes another for the reply. While the step thread executes a command, the server's thread may
 * take the loop back, so that requests that only read never wait long.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

#include "server.h"

enum { STREAM_POLL_MS = 2 }; /* for publications, which wake no thread */

/* How often the server's thread checks whether the step thread executes a command, and the loop may be taken back. */
static const uint64_t LOOP_POLL_NS = 50000000u;

/* The thread that runs the loop: the server's thread hands it over on request, and sleeps until it has it back. */
enum {
    SERVER_THREAD,
    REQUESTED,
    STEP_THREAD,
    STEP_THREAD_BUSY, /* it executes a command: the server's thread may take the loop */
    STOPPED
};

/* What a turn polls: these, then one for each client. */
enum { LISTENER, WAKEUP, FIRST_CLIENT };
_Static_assert(FIRST_CLIENT + CLIENTS_MAX == POLLED_MAX, "every client may be connected");

void fcsl_vars_wake_loop(const fcsl_vars_t *vars)
{
    const uint64_t one = 1;
    const ssize_t written = write(vars->wakeup, &one, sizeof one);
    (void)written; /* one that is full has been written before */
}

/* ---- a client: its requests, its replies, its time limits -------------------------------------------------------- */

void fcsl_vars_close_client(fcsl_vars_t *vars, client_t *client)
{
    if (client->has_command) {
        vars->command_client = CLIENTS_MAX;
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

void fcsl_vars_drop_client(fcsl_vars_t *vars, client_t *client, const char *code, const char *why, uint64_t now_ns)
{
    json_out_t out = fcsl_client_room(client, OUT_BYTES);
    fcsl_protocol_error(&out, code, why);
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
    return client->fd >= 0 && !client->closing && !client->has_command && !client->blocked &&
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
            fcsl_vars_drop_client(vars, client, "too_large", "a request has at most 65536 bytes", now_ns);
        }
        return 0;
    }
    json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
    const serve_status_t status = fcsl_protocol_serve(&vars->protocol, client, line, size, &out);
    client->blocked = status == SERVE_BUSY;
    if (client->blocked) {
        return 0;
    }
    fcsl_client_next(client, size, now_ns);
    client->has_command = status == SERVE_POSTED;
    if (client->has_command) {
        vars->command_client = (uint32_t)(client - vars->clients);
        vars->tick_by_ns = 0;
        return 0;
    }
    fcsl_client_put(client, &out, now_ns);
    if (status == SERVE_UNTRUSTED) {
        atomic_fetch_add(&vars->counters.clients_dropped, 1);
        client->closing = 1;
    } else if (client->bad_in_a_row >= BAD_IN_A_ROW_MAX) {
        fcsl_vars_drop_client(vars, client, "bad_json", "16 requests in a row were no JSON", now_ns);
        return 0;
    }
    fcsl_vars_send(vars, client, now_ns);
    return 1;
}

void fcsl_vars_serve_client(fcsl_vars_t *vars, client_t *client, short events, uint64_t now_ns)
{
    size_t size = 0;
    if (client->has_command && (events & (POLLHUP | POLLERR)) != 0) {
        fcsl_vars_close_client(vars, client); /* no peer reads the reply, nor the rest of a long `tick` */
        return;
    }
    if ((events & (POLLIN | POLLHUP | POLLERR)) != 0 && !fcsl_client_receive(client, now_ns)) {
        fcsl_vars_close_client(vars, client);
        return;
    }
    for (int i = 0; i < REQUESTS_PER_TURN && client->fd >= 0 && serve_line(vars, client, now_ns); i++) {
    }
    if (client->fd >= 0 && client->ended && !client->has_command && !client->blocked &&
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
        fcsl_vars_drop_client(vars, client, "too_slow", why, now_ns);
        if (client->fd >= 0 && client->unsent_since_ns != 0) {
            fcsl_vars_close_client(vars, client);
        }
    }
}

int fcsl_vars_watch(const client_t *client, struct pollfd *polled)
{
    size_t size = 0;
    const int more = client->received <= REQUEST_BYTES_MAX && may_reply(client) && !client->ended;
    *polled = (struct pollfd){.fd = -1};
    if (client->fd < 0) {
        return FOREVER;
    }
    polled->events = (short)((more ? POLLIN : 0) | (fcsl_client_unsent(client) > 0 ? POLLOUT : 0));
    polled->fd = polled->events != 0 || client->has_command ? client->fd : -1; /* poll reports a hang-up always */
    if (may_reply(client) && client->received > 0 && fcsl_client_line(client, &size) != NULL) {
        return 0; /* a request was left for the next turn */
    }
    return client->unsent_since_ns != 0 || client->unread_since_ns != 0 || client->closing ? POLL_MS : FOREVER;
}

/* ---- the command that the step thread has ------------------------------------------------------------------------ */

/* How long a `tick` waits for subscribers to take what they have been sent. */
static const uint64_t TICK_TIMEOUT_NS = 1000000000u;

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
    protocol_t *protocol = &vars->protocol;
    vars->tick_by_ns = vars->tick_by_ns == 0 ? now_ns + TICK_TIMEOUT_NS : vars->tick_by_ns;
    if (protocol->ticks_at_once != 0 && !subscribers_have_room(vars) && now_ns < vars->tick_by_ns) {
        return;
    }
    vars->slot.command.count = fcsl_protocol_next_ticks(protocol);
    vars->tick_by_ns = 0;
    fcsl_slot_post(&vars->slot);
}

static void send_reply(fcsl_vars_t *vars, uint64_t now_ns)
{
    fcsl_protocol_complete(&vars->protocol);
    client_t *client = vars->command_client < CLIENTS_MAX ? &vars->clients[vars->command_client] : NULL;
    for (size_t i = 0; i < vars->used; i++) {
        vars->clients[i].blocked = 0;
    }
    vars->next = vars->command_client < CLIENTS_MAX ? (vars->command_client + 1u) % CLIENTS_MAX : vars->next;
    vars->command_client = CLIENTS_MAX;
    if (client == NULL) {
        return;
    }
    json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
    fcsl_protocol_reply(&vars->protocol, client, &out);
    client->has_command = 0;
    fcsl_client_put(client, &out, now_ns);
    fcsl_vars_send(vars, client, now_ns);
}

void fcsl_vars_reply_command(fcsl_vars_t *vars, uint64_t now_ns)
{
    protocol_t *protocol = &vars->protocol;
    if (fcsl_slot_take_back(&vars->slot)) {
        const int goes_on = vars->slot.command.kind == COMMAND_TICK && vars->slot.command.status == FCSL_VARS_OK &&
                            vars->command_client < CLIENTS_MAX;
        protocol->ticks_left = goes_on ? protocol->ticks_left : 0;
        fcsl_vars_stream(vars, now_ns);
        if (protocol->ticks_left == 0) {
            send_reply(vars, now_ns);
        }
    }
    if (protocol->ticks_left == 0 || !fcsl_slot_is_free(&vars->slot)) {
        return;
    }
    if (protocol->ticks_stopped) {
        send_reply(vars, now_ns);
        protocol->ticks_left = 0;
    } else {
        continue_ticks(vars, now_ns);
    }
}

/* ---- one turn ---------------------------------------------------------------------------------------------------- */

static int least(int a_ms, int b_ms)
{
    return b_ms == FOREVER || (a_ms != FOREVER && a_ms < b_ms) ? a_ms : b_ms;
}

/* What a turn waits for; returns how long it may, in ms. It has no end where no time limit runs: one would cost each turn
 * a timer. */
static int prepare(fcsl_vars_t *vars, struct pollfd *polled, uint32_t used, int most_ms)
{
    const int streams = fcsl_vars_prepare_streams(vars) || vars->tick_by_ns != 0;
    int timeout_ms = least(most_ms, streams ? STREAM_POLL_MS : FOREVER);
    for (uint32_t i = 0; i < used; i++) {
        timeout_ms = least(timeout_ms, fcsl_vars_watch(&vars->clients[i], &polled[FIRST_CLIENT + i]));
    }
    if (vars->accept_at_ns != 0) {
        vars->accept_at_ns = fcsl_monotonic_ns() < vars->accept_at_ns ? vars->accept_at_ns : 0;
        timeout_ms = least(timeout_ms, POLL_MS);
    }
    polled[LISTENER] = (struct pollfd){.fd = vars->accept_at_ns == 0 ? vars->listener.fd : -1, .events = POLLIN};
    polled[WAKEUP] = (struct pollfd){.fd = vars->wakeup, .events = POLLIN};
    return timeout_ms;
}

static void take_turn(fcsl_vars_t *vars, int most_ms)
{
    struct pollfd polled[POLLED_MAX];
    const uint32_t used = vars->used;
    int ready = poll(polled, FIRST_CLIENT + used, prepare(vars, polled, used, most_ms));
    if (ready < 0 && errno != EINTR) {
        /* Short of memory, or of files since the start. Requests wait; the end does not. */
        ready = poll(&polled[WAKEUP], 1, least(most_ms, POLL_MS));
    }
    if (ready > 0 && polled[WAKEUP].revents != 0) {
        uint64_t calls = 0;
        const ssize_t got = read(vars->wakeup, &calls, sizeof calls);
        (void)got; /* the reason shows elsewhere */
    }
    const uint64_t now_ns = fcsl_monotonic_ns();
    fcsl_vars_reply_command(vars, now_ns);
    fcsl_vars_stream(vars, now_ns);
    const uint32_t first = vars->next < used ? vars->next : 0;
    for (uint32_t i = 0; i < used; i++) {
        const uint32_t number = (first + i) % used;
        if (vars->clients[number].fd >= 0) {
            fcsl_vars_serve_client(vars, &vars->clients[number],
                                   (short)(ready > 0 ? polled[FIRST_CLIENT + number].revents : 0), now_ns);
        }
    }
    if (ready > 0 && polled[LISTENER].revents != 0) {
        fcsl_vars_accept(vars, now_ns);
    }
}

/* ---- the server's thread ---------------------------------------------------------------------------------------- */

static int hand_over(fcsl_vars_t *vars, int from, int to)
{
    return atomic_compare_exchange_strong(&vars->loop_owner, &from, to);
}

/* Until the loop is returned, or can be taken back. */
static void wait_for_loop(fcsl_vars_t *vars)
{
    do {
        const struct timespec until = fcsl_timespec_of(fcsl_monotonic_ns() + LOOP_POLL_NS);
        if (sem_clockwait(&vars->loop_returned, CLOCK_MONOTONIC, &until) == 0) {
            return;
        }
    } while (!hand_over(vars, STEP_THREAD_BUSY, SERVER_THREAD));
}

/* Hands the loop over if it is requested. 0 when it has stopped. */
static int yield_loop(fcsl_vars_t *vars)
{
    if (hand_over(vars, REQUESTED, STEP_THREAD)) {
        fcsl_slot_wake(&vars->slot);
        wait_for_loop(vars);
    }
    return atomic_load(&vars->loop_owner) != STOPPED;
}

void *fcsl_vars_run_loop(void *argument)
{
    fcsl_vars_t *vars = argument;
    do {
        take_turn(vars, FOREVER);
    } while (yield_loop(vars));
    if (vars->command_client < CLIENTS_MAX) {
        client_t *client = &vars->clients[vars->command_client];
        json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
        const uint64_t now_ns = fcsl_monotonic_ns();
        fcsl_protocol_reply_ended(&vars->protocol, client, &out);
        fcsl_client_put(client, &out, now_ns);
        fcsl_vars_send(vars, client, now_ns);
    }
    return NULL;
}

/* ---- the step thread -------------------------------------------------------------------------------------------- */

static void return_loop(fcsl_vars_t *vars, int owner)
{
    if (atomic_exchange(&vars->loop_owner, owner) == STEP_THREAD) {
        (void)sem_post(&vars->loop_returned);
    }
}

void fcsl_vars_stop_loop(fcsl_vars_t *vars)
{
    return_loop(vars, STOPPED);
    fcsl_vars_wake_loop(vars);
}

int fcsl_vars_begin_command(fcsl_vars_t *vars)
{
    return hand_over(vars, STEP_THREAD, STEP_THREAD_BUSY);
}

int fcsl_vars_end_command(fcsl_vars_t *vars)
{
    return hand_over(vars, STEP_THREAD_BUSY, STEP_THREAD);
}

void fcsl_vars_stop_serving(fcsl_vars_t *vars)
{
    if (atomic_load_explicit(&vars->loop_owner, memory_order_relaxed) != SERVER_THREAD) {
        return_loop(vars, SERVER_THREAD);
    }
}

void fcsl_vars_wait_serving(fcsl_vars_t *vars, uint64_t deadline_ns)
{
    if (atomic_load(&vars->loop_owner) != STEP_THREAD) {
        if (hand_over(vars, SERVER_THREAD, REQUESTED)) {
            fcsl_vars_wake_loop(vars);
        }
        fcsl_slot_wait(&vars->slot, deadline_ns);
        return;
    }
    const uint64_t now_ns = fcsl_monotonic_ns();
    const int waits = fcsl_slot_take(&vars->slot) == NULL && now_ns < deadline_ns;
    take_turn(vars, waits ? (int)((deadline_ns - now_ns) / 1000000u) + 1 : 0);
}
