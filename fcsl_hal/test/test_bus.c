/* SPDX-License-Identifier: Apache-2.0
 *
 * Two sessions of the bus in two processes: order, who comes late, what is dropped, what is refused.
 */
#define _GNU_SOURCE
#include <dirent.h>

#include "bus_rig.h"

enum { VALUES = 8, ROUNDS = 1000, FLOOD = 20000, DEPTH = 4, SMALL = 16, SESSIONS = 8 };

static const char *const VALUE_KEYS[VALUES] = {"t/a", "t/b", "t/c", "t/d", "t/e", "t/f", "t/g", "t/h"};
static const char *const TICK_KEY[] = {"t/tick"};
static const char *const ANSWER_KEY[] = {"t/answer"};

/* ---- in lock-step: values first, then the tick that commits them ------------------------------------------------------ */

static fcsl_bus_role_t answering = FCSL_BUS_CLIENT;

/* Each value of a tick is there when its tick is. */
static void answer(const char *endpoint)
{
    fcsl_bus_input_t inputs[VALUES + 1] = {{.key = TICK_KEY[0], .bytes = sizeof(uint64_t), .depth = DEPTH}};
    for (uint32_t i = 0; i < VALUES; i++) {
        inputs[1 + i] = (fcsl_bus_input_t){.key = VALUE_KEYS[i], .bytes = sizeof(uint64_t), .depth = 1};
    }
    const fcsl_bus_options_t options = {.role = answering,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = ANSWER_KEY,
                                        .output_count = 1,
                                        .inputs = inputs,
                                        .input_count = VALUES + 1};
    fcsl_bus_t *bus = open_bus(&options);
    for (uint64_t tick = 0; tick < ROUNDS; tick++) {
        uint64_t got = 0;
        size_t size = 0;
        take_one(bus, 0, &got, sizeof got);
        CHECK(got == tick);
        for (uint32_t i = 0; i < VALUES; i++) {
            CHECK(fcsl_bus_take(bus, 1 + i, &got, &size) && size == sizeof got && got == tick * VALUES + i);
        }
        CHECK(fcsl_bus_post(bus, 0, &tick, sizeof tick) == 0);
    }
    const fcsl_bus_counters_t counters = counted(bus);
    CHECK(counters.received == ROUNDS * (VALUES + 1) && counters.replaced + counters.overflowed == 0);
    CHECK(counters.posted == ROUNDS && counters.refused == 0);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

static void test_values_come_before_their_tick(void)
{
    const char *outputs[VALUES + 1] = {TICK_KEY[0]};
    const fcsl_bus_input_t inputs[] = {{.key = ANSWER_KEY[0], .bytes = sizeof(uint64_t), .depth = DEPTH}};
    const char *endpoint = free_endpoint();
    const pid_t process = in_process(answer, endpoint);
    memcpy(outputs + 1, VALUE_KEYS, sizeof VALUE_KEYS);
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = endpoint,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = outputs,
                                        .output_count = VALUES + 1,
                                        .inputs = inputs,
                                        .input_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0) && fcsl_bus_matched(bus, VALUES));
    for (uint64_t tick = 0; tick < ROUNDS; tick++) {
        uint64_t got = 0;
        for (uint32_t i = 0; i < VALUES; i++) {
            const uint64_t value = tick * VALUES + i;
            CHECK(fcsl_bus_post(bus, 1 + i, &value, sizeof value) == 0);
        }
        CHECK(fcsl_bus_post(bus, 0, &tick, sizeof tick) == 0);
        take_one(bus, 0, &got, sizeof got);
        CHECK(got == tick);
    }
    check_success(process);
    WAIT_UNTIL(bus, !fcsl_bus_matched(bus, 0) && fcsl_bus_peers(bus) == 0);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

/* ---- quiet inputs ----------------------------------------------------------------------------------------------------- */

static void put_quietly(const char *endpoint)
{
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = VALUE_KEYS,
                                        .output_count = 1,
                                        .inputs = &(fcsl_bus_input_t){.key = TICK_KEY[0], .bytes = 1, .depth = 1},
                                        .input_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    uint8_t byte = 0;
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0));
    for (uint32_t i = 0; i < ROUNDS; i++) {
        CHECK(fcsl_bus_post(bus, 0, &byte, sizeof byte) == 0);
    }
    take_one(bus, 0, &byte, sizeof byte);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

/* They are taken like others, but wake nobody. */
static void test_a_quiet_input(void)
{
    const struct timespec moment = {.tv_nsec = 1000000};
    const uint64_t limit_ns = later_ns();
    const char *endpoint = free_endpoint();
    const pid_t process = in_process(put_quietly, endpoint);
    const fcsl_bus_input_t inputs[] = {{.key = VALUE_KEYS[0], .bytes = 1, .depth = 1, .quiet = 1}};
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = endpoint,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = TICK_KEY,
                                        .output_count = 1,
                                        .inputs = inputs,
                                        .input_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    uint8_t byte = 1;
    size_t size = 0;
    uint32_t news = 0;
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0));
    while (counted(bus).received < ROUNDS && fcsl_monotonic_ns() < limit_ns) {
        (void)nanosleep(&moment, NULL);
        news += (uint32_t)fcsl_bus_wait(bus, 0);
    }
    CHECK(counted(bus).received == ROUNDS && news < 5u); /* the match may have been told late */
    CHECK(fcsl_bus_take(bus, 0, &byte, &size) && byte == 0);
    CHECK(fcsl_bus_post(bus, 0, &byte, sizeof byte) == 0);
    check_success(process);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

static void test_a_peer_is_as_good(void)
{
    answering = FCSL_BUS_PEER;
    test_values_come_before_their_tick();
}

/* ---- who comes late --------------------------------------------------------------------------------------------------- */

static int first_listener = -1; /* takes the first connection, and is no session */

static void say_once(const char *endpoint)
{
    const uint64_t word = 42;
    if (first_listener >= 0) {
        CHECK(close(first_listener) == 0); /* this process has it, too */
    }
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = ANSWER_KEY,
                                        .output_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0));
    CHECK(fcsl_bus_post(bus, 0, &word, sizeof word) == 0);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0); /* what was posted is put */
}

/* The client has tried, in vain, before anybody listens. */
static void test_a_listener_that_comes_late(void)
{
    const fcsl_bus_input_t inputs[] = {{.key = ANSWER_KEY[0], .bytes = sizeof(uint64_t), .depth = 1}};
    const struct linger reset = {.l_onoff = 1};
    uint64_t word = 0;
    uint16_t port = 0;
    first_listener = bind_free_port(&port);
    CHECK(listen(first_listener, 1) == 0);
    const char *endpoint = endpoint_of(port);
    const pid_t process = in_process(say_once, endpoint);
    const int tried = accept(first_listener, NULL, NULL);
    CHECK(tried >= 0 && setsockopt(tried, SOL_SOCKET, SO_LINGER, &reset, sizeof reset) == 0);
    CHECK(close(tried) == 0 && close(first_listener) == 0);
    const fcsl_bus_options_t options = {
        .role = FCSL_BUS_LISTEN, .endpoint = endpoint, .ring_bytes = RING_BYTES, .inputs = inputs, .input_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    take_one(bus, 0, &word, sizeof word);
    CHECK(word == 42);
    check_success(process);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

/* ---- who meets whom -------------------------------------------------------------------------------------------------- */

static void hear_once(const char *endpoint)
{
    const fcsl_bus_input_t inputs[] = {{.key = ANSWER_KEY[0], .bytes = sizeof(uint64_t), .depth = 1}};
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .inputs = inputs,
                                        .input_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    uint64_t word = 0;
    take_one(bus, 0, &word, sizeof word);
    CHECK(word == 42 && fcsl_bus_close(bus, CLOSE_MS) == 0);
}

/* Two clients of one that listens. */
static void test_clients_meet(void)
{
    const char *endpoint = free_endpoint();
    const pid_t hears = in_process(hear_once, endpoint);
    const pid_t says = in_process(say_once, endpoint);
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN, .endpoint = endpoint, .ring_bytes = RING_BYTES};
    fcsl_bus_t *bus = open_bus(&options);
    check_success(says);
    check_success(hears);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

/* ---- what is dropped -------------------------------------------------------------------------------------------------- */

static const char *const RUDE_KEYS[] = {"t/small", "t/queue", "t/unknown", "t/done"};

static void be_rude(const char *endpoint)
{
    static const uint8_t large[4096];
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = RUDE_KEYS,
                                        .output_count = 4};
    fcsl_bus_t *bus = open_bus(&options);
    for (uint32_t i = 0; i < 4; i++) {
        WAIT_UNTIL(bus, fcsl_bus_matched(bus, i));
    }
    CHECK(fcsl_bus_post(bus, 0, large, SMALL + 1) == 0 && fcsl_bus_post(bus, 0, large, sizeof large) == 0);
    CHECK(fcsl_bus_post(bus, 0, large, SMALL) == 0 && fcsl_bus_post(bus, 0, large, 0) == 0);
    CHECK(fcsl_bus_post(bus, 2, large, sizeof large) == 0);
    for (uint32_t i = 0; i < FLOOD;) {
        i += fcsl_bus_post(bus, 1, &i, sizeof i) == 0; /* refused where the ring is full */
    }
    CHECK(fcsl_bus_post(bus, 4, large, 1) != 0 && fcsl_bus_post(bus, 0, large, RING_BYTES) != 0);
    while (fcsl_bus_post(bus, 3, large, 1) != 0) {
    }
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

static void test_what_is_dropped_is_counted(void)
{
    const fcsl_bus_input_t inputs[] = {{.key = RUDE_KEYS[0], .bytes = SMALL, .depth = 1},
                                       {.key = RUDE_KEYS[1], .bytes = SMALL, .depth = DEPTH},
                                       {.key = RUDE_KEYS[3], .bytes = SMALL, .depth = 1}};
    const char *endpoint = free_endpoint();
    const pid_t process = in_process(be_rude, endpoint);
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = endpoint,
                                        .ring_bytes = RING_BYTES,
                                        .inputs = inputs,
                                        .input_count = 3,
                                        .strays = "t/**"};
    fcsl_bus_t *bus = open_bus(&options);
    uint8_t got[SMALL];
    size_t size = 0;
    take_one(bus, 2, got, 1);
    const fcsl_bus_counters_t counters = counted(bus);
    CHECK(counters.wrong_size == 2 && counters.replaced == 1 && counters.strays == 1);
    CHECK(counters.overflowed == FLOOD - DEPTH && counters.received == 5 + FLOOD);
    CHECK(fcsl_bus_take(bus, 0, got, &size) && size == 0 && !fcsl_bus_take(bus, 0, got, &size));
    for (uint32_t i = 0; i < DEPTH; i++) { /* of a flood, the first ones wait */
        uint32_t number = UINT32_MAX;
        CHECK(fcsl_bus_take(bus, 1, got, &size) && size == sizeof number);
        memcpy(&number, got, sizeof number);
        CHECK(number == i);
    }
    CHECK(!fcsl_bus_take(bus, 1, got, &size) && !fcsl_bus_take(bus, 3, got, &size));
    check_success(process);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
}

/* ---- what is refused -------------------------------------------------------------------------------------------------- */

static void check_refused(const fcsl_bus_options_t *options, const char *reason)
{
    fcsl_bus_t *bus = NULL;
    fcsl_error_t error = {""};
    CHECK(fcsl_bus_open(options, &bus, &error) != 0 && bus == NULL);
    if (strstr(error.text, reason) == NULL) {
        (void)fprintf(stderr, "'%s' lacks '%s'\n", error.text, reason);
    }
    CHECK(strstr(error.text, reason) != NULL);
}

static void test_options(void)
{
    static const char *const wild[] = {"t/*"};
    static const char *const empty[] = {""};
    const fcsl_bus_input_t malformed[] = {{.key = "t/a*", .bytes = 1, .depth = 1}};
    const fcsl_bus_input_t large[] = {{.key = "t/a", .bytes = FCSL_BUS_MESSAGE_MAX + 1u, .depth = 1}};
    const fcsl_bus_input_t many[] = {{.key = "t/a", .bytes = FCSL_BUS_MESSAGE_MAX, .depth = 1000}};
    const fcsl_bus_options_t sound = {.endpoint = "tcp:127.0.0.1:1", .ring_bytes = RING_BYTES, .role = FCSL_BUS_CLIENT};
    fcsl_bus_options_t options = sound;
    options.endpoint = NULL;
    check_refused(&options, "an endpoint or a configuration file");
    options.endpoint = "tcp:example.org:7447";
    check_refused(&options, "write tcp:HOST:PORT in numbers, like tcp:127.0.0.1:7447");
    options.endpoint = "udp/127.0.0.1:7447";
    check_refused(&options, "udp/127.0.0.1:7447: write tcp:HOST:PORT");
    options.endpoint = "tcp127.0.0.1:7447";
    check_refused(&options, "tcp127.0.0.1:7447: write tcp:HOST:PORT");
    options = sound;
    options.ring_bytes = 8;
    check_refused(&options, "the ring of the bus has 8 bytes");
    options = sound;
    options.outputs = wild;
    options.output_count = 1;
    check_refused(&options, "an output of the bus has the key 't/*'");
    options.outputs = empty;
    check_refused(&options, "a key of 0 bytes");
    options = sound;
    options.inputs = large;
    options.input_count = 1;
    check_refused(&options, "input 't/a' of the bus has 1048577 bytes");
    options.inputs = many;
    check_refused(&options, "ring and inputs of the bus take");
    options.inputs = malformed;
    options.role = FCSL_BUS_LISTEN;
    options.endpoint = free_endpoint();
    check_refused(&options, "the bus refuses a key: ");
    options = sound;
    options.endpoint = NULL;
    options.config_path = "/nowhere/zenoh.json5";
    check_refused(&options, "cannot open a session of the bus with /nowhere/zenoh.json5");
}

/* Nobody listens, or somebody listens already: told in its time. */
static void test_nobody_and_somebody(void)
{
    uint16_t port = 0;
    const int taken = bind_free_port(&port);
    const uint64_t begun_ns = fcsl_monotonic_ns();
    fcsl_bus_options_t options = {
        .role = FCSL_BUS_CLIENT, .endpoint = endpoint_of(port), .timeout_ms = 300, .ring_bytes = RING_BYTES};
    check_refused(&options, "cannot connect to tcp:127.0.0.1:");
    CHECK(fcsl_monotonic_ns() - begun_ns >= 300000000u &&
          fcsl_monotonic_ns() - begun_ns < (uint64_t)LONG_S * FCSL_NS_PER_S);
    CHECK(listen(taken, 1) == 0);
    options.role = FCSL_BUS_LISTEN;
    check_refused(&options, "cannot listen on tcp:127.0.0.1:");
    CHECK(close(taken) == 0);
}

/* Opening does not wait. What was posted before somebody listens is dropped; what comes then arrives. */
static void test_one_that_connects_later(void)
{
    uint64_t value = 1;
    const fcsl_bus_input_t inputs[] = {{.key = ANSWER_KEY[0], .bytes = sizeof value, .depth = DEPTH}};
    /* Not of those ports from which the system takes one for who tries to connect. */
    const char *endpoint = endpoint_of((uint16_t)(20000 + getpid() % 12000));
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = 200,
                                        .connects_later = 1,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = ANSWER_KEY,
                                        .output_count = 1};
    const fcsl_bus_options_t listening = {
        .role = FCSL_BUS_LISTEN, .endpoint = endpoint, .ring_bytes = RING_BYTES, .inputs = inputs, .input_count = 1};
    fcsl_bus_t *alone = open_bus(&options);
    CHECK(fcsl_bus_peers(alone) == 0 && fcsl_bus_close(alone, CLOSE_MS) == 0);
    fcsl_bus_t *bus = open_bus(&options);
    CHECK(fcsl_bus_post(bus, 0, &value, sizeof value) == 0);
    fcsl_bus_t *listener = open_bus(&listening);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0) && counted(bus).put_failed == 1u);
    value = 2;
    CHECK(fcsl_bus_post(bus, 0, &value, sizeof value) == 0);
    take_one(listener, 0, &value, sizeof value);
    WAIT_UNTIL(bus, counted(bus).put == 1u); /* it may be taken before it is counted */
    CHECK(value == 2 && counted(bus).put_failed == 1);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0 && fcsl_bus_close(listener, CLOSE_MS) == 0);
}

static int open_files(void)
{
    int count = 0;
    DIR *files = opendir("/proc/self/fd");
    CHECK(files != NULL);
    while (readdir(files) != NULL) {
        count++;
    }
    CHECK(closedir(files) == 0);
    return count;
}

/* A session has two files of its own. Zenoh's threads stay, with what the first session opened for them. */
static void test_closing_leaves_nothing(void)
{
    const fcsl_bus_input_t inputs[] = {{.key = ANSWER_KEY[0], .bytes = sizeof(uint64_t), .depth = DEPTH}};
    int open_after_one = 0;
    for (int round = 0; round < SESSIONS; round++) {
        const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                            .endpoint = free_endpoint(),
                                            .ring_bytes = RING_BYTES,
                                            .inputs = inputs,
                                            .input_count = 1};
        CHECK(fcsl_bus_close(open_bus(&options), CLOSE_MS) == 0);
        open_after_one = round == 0 ? open_files() : open_after_one;
    }
    const uint64_t deadline_ns = later_ns();
    while (open_files() > open_after_one + SESSIONS / 2) { /* the last of its threads frees it */
        CHECK(fcsl_monotonic_ns() < deadline_ns);
        CHECK(usleep(1000) == 0);
    }
}

int main(void)
{
    check_alone(test_closing_leaves_nothing);
    check_alone(test_values_come_before_their_tick);
    check_alone(test_a_quiet_input);
    check_alone(test_a_peer_is_as_good);
    check_alone(test_a_listener_that_comes_late);
    check_alone(test_clients_meet);
    check_alone(test_what_is_dropped_is_counted);
    check_alone(test_options);
    check_alone(test_nobody_and_somebody);
    check_alone(test_one_that_connects_later);
    return 0;
}
