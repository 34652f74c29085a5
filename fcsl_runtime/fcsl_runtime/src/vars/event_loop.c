/* SPDX-License-Identifier: Apache-2.0
 *
 * Rounds: one looks at every client once, in turn, and serves a few requests of each. The server's thread makes them.
 * The step thread of a paused host, which has nothing else to do, may make them instead: then a command finds it awake,
 * and no thread wakes another for the reply. While it works on a command the server's thread may take the rounds back,
 * so that those who only look never wait long.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

#include "server.h"

enum { STREAM_POLL_MS = 2 }; /* for publications, which wake nobody */

/* How often the server's thread looks whether the step thread is at work, and the rounds with it. */
static const uint64_t LOOK_EVERY_NS = 50000000u;

/* Who makes the rounds: the server's thread hands them over when it is asked, and sleeps until it has them back. */
enum {
    BY_SERVER,
    ASKED_FOR,
    BY_STEP_THREAD,
    AT_WORK, /* the step thread has them, and a command: the server's thread may take them */
    OVER
};

/* Entries of a round: these, then one for each place in use. */
enum { LISTENER, ATTENTION, FIRST_CLIENT };
_Static_assert(FIRST_CLIENT + CLIENTS_MAX == ENTRIES_MAX, "every place may be in use");

void fcsl_vars_call(const fcsl_vars_t *vars)
{
    const uint64_t one = 1;
    const ssize_t written = write(vars->attention, &one, sizeof one);
    (void)written; /* one that is full has been written before */
}

static int least(int a_ms, int b_ms)
{
    return b_ms == FOREVER || (a_ms != FOREVER && a_ms < b_ms) ? a_ms : b_ms;
}

/* What a round waits for; returns how long it may, in ms. It has no end where no time limit runs: one would cost each round
 * a timer. */
static int prepare(fcsl_vars_t *vars, struct pollfd *entries, uint32_t used, int most_ms)
{
    const int streams = fcsl_vars_prepare_streams(vars) || vars->tick_by_ns != 0;
    int timeout_ms = least(most_ms, streams ? STREAM_POLL_MS : FOREVER);
    for (uint32_t i = 0; i < used; i++) {
        timeout_ms = least(timeout_ms, fcsl_vars_watch(&vars->clients[i], &entries[FIRST_CLIENT + i]));
    }
    if (vars->accept_at_ns != 0) {
        vars->accept_at_ns = fcsl_monotonic_ns() < vars->accept_at_ns ? vars->accept_at_ns : 0;
        timeout_ms = least(timeout_ms, POLL_MS);
    }
    entries[LISTENER] = (struct pollfd){.fd = vars->accept_at_ns == 0 ? vars->listener.fd : -1, .events = POLLIN};
    entries[ATTENTION] = (struct pollfd){.fd = vars->attention, .events = POLLIN};
    return timeout_ms;
}

static void make_round(fcsl_vars_t *vars, int most_ms)
{
    struct pollfd entries[ENTRIES_MAX];
    const uint32_t used = vars->used;
    int ready = poll(entries, FIRST_CLIENT + used, prepare(vars, entries, used, most_ms));
    if (ready < 0 && errno != EINTR) {
        /* Short of memory, or of files since the start. What was asked waits; the end does not. */
        ready = poll(&entries[ATTENTION], 1, least(most_ms, POLL_MS));
    }
    if (ready > 0 && entries[ATTENTION].revents != 0) {
        uint64_t calls = 0;
        const ssize_t got = read(vars->attention, &calls, sizeof calls);
        (void)got; /* what it was called for shows elsewhere */
    }
    const uint64_t now_ns = fcsl_monotonic_ns();
    fcsl_vars_serve_command(vars, now_ns);
    fcsl_vars_stream(vars, now_ns);
    const uint32_t first = vars->next < used ? vars->next : 0;
    for (uint32_t i = 0; i < used; i++) {
        const uint32_t number = (first + i) % used;
        if (vars->clients[number].fd >= 0) {
            fcsl_vars_serve_client(vars, &vars->clients[number],
                                   (short)(ready > 0 ? entries[FIRST_CLIENT + number].revents : 0), now_ns);
        }
    }
    if (ready > 0 && entries[LISTENER].revents != 0) {
        fcsl_vars_accept(vars, now_ns);
    }
}

/* ---- the server's thread ---------------------------------------------------------------------------------------- */

static int pass(fcsl_vars_t *vars, int from, int to)
{
    return atomic_compare_exchange_strong(&vars->rounds, &from, to);
}

/* Until the rounds are given back, or can be taken. */
static void sleep_aside(fcsl_vars_t *vars)
{
    do {
        const struct timespec until = fcsl_timespec_of(fcsl_monotonic_ns() + LOOK_EVERY_NS);
        if (sem_clockwait(&vars->returned, CLOCK_MONOTONIC, &until) == 0) {
            return;
        }
    } while (!pass(vars, AT_WORK, BY_SERVER));
}

/* Hands the rounds over if they are asked for. 0 when they are over. */
static int stand_aside(fcsl_vars_t *vars)
{
    if (pass(vars, ASKED_FOR, BY_STEP_THREAD)) {
        fcsl_mailbox_wake(&vars->mailbox);
        sleep_aside(vars);
    }
    return atomic_load(&vars->rounds) != OVER;
}

void *fcsl_vars_make_rounds(void *argument)
{
    fcsl_vars_t *vars = argument;
    do {
        make_round(vars, FOREVER);
    } while (stand_aside(vars));
    if (vars->poster < CLIENTS_MAX) {
        client_t *client = &vars->clients[vars->poster];
        json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
        const uint64_t now_ns = fcsl_monotonic_ns();
        fcsl_commander_abandon(&vars->commander, &client->session, &out);
        fcsl_client_put(client, &out, now_ns);
        fcsl_vars_send(vars, client, now_ns);
    }
    return NULL;
}

/* ---- the step thread -------------------------------------------------------------------------------------------- */

static void give_back(fcsl_vars_t *vars, int rounds)
{
    if (atomic_exchange(&vars->rounds, rounds) == BY_STEP_THREAD) {
        (void)sem_post(&vars->returned);
    }
}

void fcsl_vars_end_rounds(fcsl_vars_t *vars)
{
    give_back(vars, OVER);
    fcsl_vars_call(vars);
}

int fcsl_vars_begin_work(fcsl_vars_t *vars)
{
    return pass(vars, BY_STEP_THREAD, AT_WORK);
}

int fcsl_vars_end_work(fcsl_vars_t *vars)
{
    return pass(vars, AT_WORK, BY_STEP_THREAD);
}

void fcsl_vars_leave(fcsl_vars_t *vars)
{
    if (atomic_load_explicit(&vars->rounds, memory_order_relaxed) != BY_SERVER) {
        give_back(vars, BY_SERVER);
    }
}

void fcsl_vars_attend(fcsl_vars_t *vars, uint64_t deadline_ns)
{
    if (atomic_load(&vars->rounds) != BY_STEP_THREAD) {
        if (pass(vars, BY_SERVER, ASKED_FOR)) {
            fcsl_vars_call(vars);
        }
        fcsl_mailbox_wait(&vars->mailbox, deadline_ns);
        return;
    }
    const uint64_t now_ns = fcsl_monotonic_ns();
    const int waits = fcsl_mailbox_take(&vars->mailbox) == NULL && now_ns < deadline_ns;
    make_round(vars, waits ? (int)((deadline_ns - now_ns) / 1000000u) + 1 : 0);
}
