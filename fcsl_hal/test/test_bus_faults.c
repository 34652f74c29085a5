/* SPDX-License-Identifier: Apache-2.0
 *
 * A peer of a session freezes, is killed, comes back. Whoever posts never waits for it, and it is told.
 */
#define _GNU_SOURCE
#include "bus_rig.h"

enum { POSTS = 20000, MESSAGE_BYTES = 1000, SOON_MS = 500, STUCK_NS = 100000000 };
static const uint64_t A_WHILE_NS = UINT64_C(60000000000); /* the lease of a second, on a busy computer */

static const char *const KEY[] = {"t/value"};
static const char *const TOKEN[] = {"t/alive"};

/* Listens, lives, and takes what comes. */
static void live(const char *endpoint)
{
    const fcsl_bus_input_t inputs[] = {{.key = KEY[0], .bytes = MESSAGE_BYTES, .depth = 1}};
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = endpoint,
                                        .ring_bytes = RING_BYTES,
                                        .inputs = inputs,
                                        .input_count = 1,
                                        .tokens = TOKEN,
                                        .token_count = 1};
    (void)open_bus(&options);
    for (;;) {
        (void)pause();
    }
}

static fcsl_bus_t *open_client(const char *endpoint, int observer)
{
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .observer = observer,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = KEY,
                                        .output_count = 1,
                                        .watched = TOKEN,
                                        .watched_count = 1};
    return open_bus(&options);
}

static void end(pid_t process, int number)
{
    int status = 0;
    CHECK(kill(process, number) == 0 && waitpid(process, &status, 0) == process && WIFSIGNALED(status));
}

/* Posts until Zenoh takes no more: the kernel has some megabytes of room for a peer that does not read. A busy computer may need the
 * lease for that; who is gone then takes everything. */
static void fill_up(fcsl_bus_t *bus)
{
    static const uint8_t message[MESSAGE_BYTES];
    uint64_t put_ns = fcsl_monotonic_ns();
    while (fcsl_monotonic_ns() - put_ns < STUCK_NS && fcsl_bus_matched(bus, 0)) {
        const uint64_t before = counted(bus).put;
        const int refused = fcsl_bus_post(bus, 0, message, sizeof message);
        put_ns = !refused || counted(bus).put != before ? fcsl_monotonic_ns() : put_ns;
    }
}

/* A post that waited for the peer would take a second, and more. */
static void post_to_a_frozen_peer(int observer)
{
    static const uint8_t message[MESSAGE_BYTES];
    const char *endpoint = free_endpoint();
    const pid_t process = in_process(live, endpoint);
    fcsl_bus_t *bus = open_client(endpoint, observer);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0) && fcsl_bus_token_count(bus, 0) == 1);
    CHECK(kill(process, SIGSTOP) == 0);
    const uint64_t stopped_ns = fcsl_monotonic_ns();
    if (!observer) {
        fill_up(bus);
    }
    const uint64_t posting_ns = fcsl_monotonic_ns();
    for (int i = 0; i < POSTS; i++) {
        (void)fcsl_bus_post(bus, 0, message, sizeof message);
    }
    const uint64_t posted_ns = fcsl_monotonic_ns() - posting_ns;
    CHECK(posted_ns < A_WHILE_NS / 2u);
    WAIT_UNTIL(bus, fcsl_bus_token_count(bus, 0) == 0);
    const uint64_t noticed_ns = fcsl_monotonic_ns() - stopped_ns;
    WAIT_UNTIL(bus, !fcsl_bus_matched(bus, 0) && fcsl_bus_peers(bus) == 0);
    CHECK(noticed_ns < A_WHILE_NS);
    const uint64_t closing_ns = fcsl_monotonic_ns();
    const int closed = fcsl_bus_close(bus, SOON_MS);
    const uint64_t closed_ns = fcsl_monotonic_ns() - closing_ns;
    CHECK(closed_ns < SOON_MS * UINT64_C(1000000) + A_WHILE_NS / 2u);
    (void)printf("%s, peer frozen: %d posts in %.1f ms, noticed after %.2f s, close gave %d after %.2f s\n",
                 observer ? "observer" : "control", POSTS, (double)posted_ns * 1e-6, (double)noticed_ns * 1e-9, closed,
                 (double)closed_ns * 1e-9);
    end(process, SIGKILL);
}

static void test_a_frozen_peer(void)
{
    post_to_a_frozen_peer(0);
}

static void test_a_frozen_peer_of_an_observer(void)
{
    post_to_a_frozen_peer(1);
}

/* Closing while the peer is frozen and the ring is full keeps its limit. */
static void test_closing_with_a_frozen_peer(void)
{
    const char *endpoint = free_endpoint();
    const pid_t process = in_process(live, endpoint);
    fcsl_bus_t *bus = open_client(endpoint, 0);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0));
    CHECK(kill(process, SIGSTOP) == 0);
    fill_up(bus);
    const uint64_t closing_ns = fcsl_monotonic_ns();
    const int closed = fcsl_bus_close(bus, 200);
    const uint64_t closed_ns = fcsl_monotonic_ns() - closing_ns;
    CHECK(closed_ns < A_WHILE_NS / 2u);
    (void)printf("peer frozen, ring full: close gave %d after %.2f s\n", closed, (double)closed_ns * 1e-9);
    end(process, SIGKILL);
}

static int may_start[2]; /* a pipe */

static void live_later(const char *endpoint)
{
    uint8_t byte = 0;
    CHECK(read(may_start[0], &byte, 1) == 1);
    live(endpoint);
}

/* Killed, it is gone at once; a new one on the same endpoint is found, and gets messages. */
static void test_a_peer_that_is_killed_and_returns(void)
{
    static const uint8_t message[MESSAGE_BYTES];
    const char *endpoint = free_endpoint();
    CHECK(pipe(may_start) == 0);
    const pid_t first = in_process(live, endpoint);
    const pid_t second = in_process(live_later, endpoint);
    fcsl_bus_t *bus = open_client(endpoint, 0);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0) && fcsl_bus_token_count(bus, 0) == 1);
    const uint64_t killed_ns = fcsl_monotonic_ns();
    end(first, SIGKILL);
    WAIT_UNTIL(bus, fcsl_bus_token_count(bus, 0) == 0);
    const uint64_t noticed_ns = fcsl_monotonic_ns() - killed_ns;
    CHECK(noticed_ns < A_WHILE_NS);
    WAIT_UNTIL(bus, !fcsl_bus_matched(bus, 0) && fcsl_bus_peers(bus) == 0);
    CHECK(fcsl_bus_post(bus, 0, message, sizeof message) == 0); /* to nobody: taken, and lost */
    WAIT_UNTIL(bus, counted(bus).put == 1);
    const uint64_t started_ns = fcsl_monotonic_ns();
    CHECK(write(may_start[1], "x", 1) == 1);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0) && fcsl_bus_token_count(bus, 0) == 1 && fcsl_bus_peers(bus) == 1);
    (void)printf("peer killed: noticed after %.3f s; its successor found after %.2f s\n", (double)noticed_ns * 1e-9,
                 (double)(fcsl_monotonic_ns() - started_ns) * 1e-9);
    const fcsl_bus_counters_t counters = counted(bus);
    CHECK(counters.connects == 2 && counters.disconnects == 1 && counters.put == 1 && counters.put_failed == 0);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
    end(second, SIGKILL);
}

int main(void)
{
    check_alone(test_a_frozen_peer);
    check_alone(test_a_frozen_peer_of_an_observer);
    check_alone(test_closing_with_a_frozen_peer);
    check_alone(test_a_peer_that_is_killed_and_returns);
    return 0;
}
