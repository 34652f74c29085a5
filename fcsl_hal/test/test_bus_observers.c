/* SPDX-License-Identifier: Apache-2.0
 *
 * Observers cannot stall a flight: while all of them are frozen and their session is full, another session of the same process
 * goes on in lock-step.
 */
#define _GNU_SOURCE
#include "bus_rig.h"

enum { OBSERVERS = 3, PUBLISHED_BYTES = 16000, PUBLISHED_RING = 1 << 18, TICKS_MIN = 50, TICKS_AFTER = 500 };
static const uint64_t LONGEST_NS = UINT64_C(5000000000); /* on a busy machine; a link that is closed can take 10 s */

static const char *const TICK[] = {"t/tick"};
static const char *const ANSWER[] = {"t/answer"};
static const char *const PUBLISHED[] = {"t/published"};
static const char *const OBSERVER[] = {"t/observer"};

/* Answers every tick, until it is killed. */
static void answer(const char *endpoint)
{
    const fcsl_bus_input_t inputs[] = {{.key = TICK[0], .bytes = sizeof(uint64_t), .depth = 2}};
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = ANSWER,
                                        .output_count = 1,
                                        .inputs = inputs,
                                        .input_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    for (;;) {
        uint64_t tick = 0;
        take_one(bus, 0, &tick, sizeof tick);
        CHECK(fcsl_bus_post(bus, 0, &tick, sizeof tick) == 0);
    }
}

static void observe(const char *endpoint)
{
    const fcsl_bus_input_t inputs[] = {{.key = PUBLISHED[0], .bytes = PUBLISHED_BYTES, .depth = 1}};
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .inputs = inputs,
                                        .input_count = 1,
                                        .tokens = OBSERVER,
                                        .token_count = 1};
    (void)open_bus(&options);
    for (;;) {
        (void)pause();
    }
}

static fcsl_bus_t *open_control(const char *endpoint)
{
    const fcsl_bus_input_t inputs[] = {{.key = ANSWER[0], .bytes = sizeof(uint64_t), .depth = 2}};
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = endpoint,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = TICK,
                                        .output_count = 1,
                                        .inputs = inputs,
                                        .input_count = 1};
    return open_bus(&options);
}

static fcsl_bus_t *open_publisher(const char *endpoint)
{
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = endpoint,
                                        .observer = 1,
                                        .ring_bytes = PUBLISHED_RING,
                                        .outputs = PUBLISHED,
                                        .output_count = 1,
                                        .watched = OBSERVER,
                                        .watched_count = 1};
    return open_bus(&options);
}

/* A tick there and back, and its copy for the observers; how long it took. */
static uint64_t fly_tick(fcsl_bus_t *control, fcsl_bus_t *publisher, uint64_t tick)
{
    static const uint8_t copy[PUBLISHED_BYTES];
    uint64_t got = 0;
    const uint64_t begun_ns = fcsl_monotonic_ns();
    CHECK(fcsl_bus_post(control, 0, &tick, sizeof tick) == 0);
    for (int i = 0; i < 4; i++) {
        (void)fcsl_bus_post(publisher, 0, copy, sizeof copy); /* refused when their ring is full */
    }
    take_one(control, 0, &got, sizeof got);
    CHECK(got == tick);
    return fcsl_monotonic_ns() - begun_ns;
}

int main(void)
{
    char control_endpoint[64];
    char publisher_endpoint[64];
    pid_t observers[OBSERVERS];
    (void)snprintf(control_endpoint, sizeof control_endpoint, "%s", free_endpoint());
    (void)snprintf(publisher_endpoint, sizeof publisher_endpoint, "%s", free_endpoint());
    (void)in_process(answer, control_endpoint);
    for (int i = 0; i < OBSERVERS; i++) {
        observers[i] = in_process(observe, publisher_endpoint);
    }
    fcsl_bus_t *control = open_control(control_endpoint);
    fcsl_bus_t *publisher = open_publisher(publisher_endpoint);
    WAIT_UNTIL(control, fcsl_bus_matched(control, 0));
    WAIT_UNTIL(publisher, fcsl_bus_matched(publisher, 0) && fcsl_bus_token_count(publisher, 0) == OBSERVERS);
    for (int i = 0; i < OBSERVERS; i++) {
        CHECK(kill(observers[i], SIGSTOP) == 0);
    }
    /* Frozen, they take what their kernels have room for, and after the lease their links are closed. Neither is felt. */
    uint64_t tick = 0;
    uint64_t longest_ns = 0;
    uint64_t after = 0;
    while (after < TICKS_AFTER) {
        const uint64_t took_ns = fly_tick(control, publisher, tick++);
        longest_ns = took_ns > longest_ns ? took_ns : longest_ns;
        after += fcsl_bus_token_count(publisher, 0) == 0;
    }
    (void)printf("%llu ticks while the observers were frozen, the longest %.2f ms\n",
                 (unsigned long long)(tick - after), (double)longest_ns * 1e-6);
    CHECK(tick - after >= TICKS_MIN && longest_ns < LONGEST_NS);
    CHECK(counted(control).refused == 0 && counted(control).received == tick);
    CHECK(fcsl_bus_close(control, CLOSE_MS) == 0);
    (void)fcsl_bus_close(publisher, CLOSE_MS);
    return 0;
}
