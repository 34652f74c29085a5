/* SPDX-License-Identifier: Apache-2.0
 *
 * Named values as docs/reference/transports.md defines them: the test is the simulator, byte by byte, and the controller says what does not fit.
 */
#define _GNU_SOURCE
#include <signal.h>

#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_scalar.h"
#include "named_values/commit.h"
#include "wire_fixture.h"

enum { CONTROL = 0, TICK = 1, FLAG = 2, PACKET = 3, SHORT_MS = 300, HELLO_BYTES = 20, COMMIT_MAX = 64, GARBAGE = 12 };

static const char *const OUTPUTS[] = {"fleet/channels/@control", "fleet/channels/tick", "fleet/channels/flag",
                                      "fleet/channels/packet"};
static const char *const TOKENS[] = {"fleet/channels/@simulator"};
static const char *const WATCHED[] = {"fleet/channels/@controller"};
static const fcsl_bus_input_t INPUTS[] = {{.key = "fleet/channels/@control", .bytes = 256, .depth = 4},
                                          {.key = "fleet/channels/tick", .bytes = COMMIT_MAX, .depth = 4},
                                          {.key = "fleet/channels/command", .bytes = 16, .depth = 1},
                                          {.key = "fleet/channels/reply", .bytes = 2, .depth = 1}};
enum { COMMANDS = 2, REPLIES = 3 };

/* The simulator's session. It has no key for most of the channels. */
static fcsl_bus_t *listen_on_the_bus(void)
{
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = spec + strlen("zenoh:"),
                                        .ring_bytes = 4096,
                                        .outputs = OUTPUTS,
                                        .output_count = sizeof OUTPUTS / sizeof OUTPUTS[0],
                                        .inputs = INPUTS,
                                        .input_count = sizeof INPUTS / sizeof INPUTS[0],
                                        .tokens = TOKENS,
                                        .token_count = 1,
                                        .watched = WATCHED,
                                        .watched_count = 1};
    return open_bus(&options);
}

static void shake_hands(fcsl_bus_t *bus)
{
    uint8_t hello[256];
    take_one(bus, CONTROL, hello, HELLO_BYTES);
    CHECK(memcmp(hello, "FCSW\1\0\1\0", 8) == 0 && fcsl_get_u32(hello + 8) == fcsl_channel_table(&MACHINE).hash);
    hello[7] = 1; /* it sends the time */
    CHECK(fcsl_bus_post(bus, CONTROL, hello, HELLO_BYTES) == 0);
}

/* Commits a tick with a value of `flag` and of `packet`, or of one of them. */
static void post_commit(fcsl_bus_t *bus, uint64_t tick, int flag, int packet, size_t less, uint32_t hash_error)
{
    uint8_t bytes[COMMIT_MAX];
    uint8_t fresh[CHANNEL_COUNT] = {0};
    const commit_t commit = {.tick = tick,
                             .time_ns = time_of(tick),
                             .table_hash = fcsl_channel_table(&MACHINE).hash + hash_error,
                             .direction = FCSL_SENSOR,
                             .channels = CHANNEL_COUNT};
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        fresh[i] = (uint8_t)((flag && strcmp(CHANNELS[i].name, "flag") == 0) ||
                             (packet && strcmp(CHANNELS[i].name, "packet") == 0));
    }
    commit_write(&commit, fresh, bytes);
    CHECK(fcsl_bus_post(bus, TICK, bytes, commit_bytes(CHANNEL_COUNT) - less) == 0);
}

static void post_tick(fcsl_bus_t *bus, uint64_t tick)
{
    static const uint8_t on = 1;
    CHECK(fcsl_bus_post(bus, FLAG, &on, 1) == 0 && fcsl_bus_post(bus, PACKET, "abc", 3) == 0);
    post_commit(bus, tick, 1, 1, 0, 0);
}

/* What the controller answers lies on the bus under the names of its channels. */
static void take_answer(fcsl_bus_t *bus, uint64_t tick)
{
    uint8_t bytes[COMMIT_MAX];
    take_one(bus, TICK, bytes, commit_bytes(CHANNEL_COUNT));
    CHECK(fcsl_get_u64(bytes) == tick && bytes[20] == FCSL_ACTUATOR && bytes[21] == 1);
    take_one(bus, COMMANDS, bytes, 16);
    take_one(bus, REPLIES, bytes, 0);
}

/* A tick that the controller makes. */
static void fly_tick(fcsl_bus_t *bus, uint64_t tick)
{
    post_tick(bus, tick);
    take_answer(bus, tick);
}

typedef void (*sender_t)(fcsl_bus_t *bus);

static void value_missing(fcsl_bus_t *bus)
{
    static const uint8_t on = 1;
    CHECK(fcsl_bus_post(bus, FLAG, &on, 1) == 0);
    post_commit(bus, 2, 1, 1, 0, 0);
}

static void value_too_short(fcsl_bus_t *bus)
{
    CHECK(fcsl_bus_post(bus, FLAG, "", 0) == 0);
    post_commit(bus, 2, 1, 0, 0, 0);
}

static void value_that_is_none(fcsl_bus_t *bus)
{
    CHECK(fcsl_bus_post(bus, FLAG, "\2", 1) == 0);
    post_commit(bus, 2, 1, 0, 0, 0);
}

static void bad_commits(fcsl_bus_t *bus)
{
    post_commit(bus, 2, 0, 0, 1, 0);
    post_commit(bus, 2, 0, 0, 0, 1);
}

/* Two ticks, and then something that does not fit: the controller ends with this status and text. */
static void check_end(sender_t send, fcsl_hal_status_t status, const char *text)
{
    const pid_t child = start_controller(&MACHINE, SHORT_MS * 10, status, text);
    fcsl_bus_t *bus = listen_on_the_bus();
    shake_hands(bus);
    fly_tick(bus, 0);
    fly_tick(bus, 1);
    send(bus);
    join(child);
    (void)fcsl_bus_close(bus, WAIT_MS);
}

static void test_value_missing(void)
{
    check_end(value_missing, FCSL_HAL_ERROR,
              "the commit of tick 2 says that channel 'packet' has a value, and none came");
}

static void test_value_too_short(void)
{
    check_end(value_too_short, FCSL_HAL_ERROR,
              "the commit of tick 2 says that channel 'flag' has a value, and none came");
}

static void test_value_that_is_none(void)
{
    check_end(value_that_is_none, FCSL_HAL_ERROR,
              "the commit of tick 2 says that channel 'flag' has a value, and what came is none");
}

/* Whoever else is on the bus cannot hide a tick with commits of another machine. */
static void test_a_tick_behind_bad_commits(void)
{
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_ERROR, "went away before tick 2");
    fcsl_bus_t *bus = listen_on_the_bus();
    shake_hands(bus);
    fly_tick(bus, 0);
    for (uint32_t i = 0; i < 3; i++) {
        post_commit(bus, 1, 0, 0, 0, 1);
    }
    fly_tick(bus, 1);
    (void)fcsl_bus_close(bus, WAIT_MS);
    join(child);
}

/* More commits of another machine, and packets that are none, than there are places, before the simulator answers and begins; the
 * controller stands still meanwhile, so that all of them are there before it looks. The answer and tick 0 must find a place. */
static void test_a_start_behind_garbage(void)
{
    uint8_t hello[256];
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_ERROR, "went away before tick 1");
    fcsl_bus_t *bus = listen_on_the_bus();
    take_one(bus, CONTROL, hello, HELLO_BYTES);
    CHECK(kill(child, SIGSTOP) == 0);
    for (uint32_t i = 0; i < GARBAGE; i++) {
        post_commit(bus, 0, 0, 0, 0, 1);
        CHECK(fcsl_bus_post(bus, CONTROL, "garbage", 7) == 0);
    }
    hello[7] = 1;
    CHECK(fcsl_bus_post(bus, CONTROL, hello, HELLO_BYTES) == 0);
    post_tick(bus, 0);
    for (fcsl_bus_counters_t counters = {0}; counters.put == 0 || counters.put < counters.posted;) {
        fcsl_monotonic_wait(fcsl_monotonic_ns() + FCSL_NS_PER_MS);
        fcsl_bus_count(bus, &counters);
    }
    CHECK(kill(child, SIGCONT) == 0);
    take_answer(bus, 0);
    (void)fcsl_bus_close(bus, WAIT_MS);
    join(child);
}

/* It would send values faster than they are taken, and a commit would have those of the next one. */
static void test_a_rig(void)
{
    uint8_t hello[256];
    const pid_t child = start_controller(&MACHINE, WAIT_MS, FCSL_HAL_ERROR,
                                         "runs free: named values in lock-step need one that paces the run");
    fcsl_bus_t *bus = listen_on_the_bus();
    take_one(bus, CONTROL, hello, HELLO_BYTES);
    CHECK(fcsl_bus_post(bus, CONTROL, hello, HELLO_BYTES) == 0);
    join(child);
    (void)fcsl_bus_close(bus, WAIT_MS);
}

/* A simulator that ends without an answer is one that was not found: the controller looks on, and meets the next one. */
static void look_on(void)
{
    fcsl_error_t error = {""};
    fcsl_hal_t hal;
    CHECK(fcsl_hal_bus(spec, "fleet", &MACHINE, WAIT_MS, WAIT_MS, &hal, &error) == 0);
    CHECK(hal.open(&hal, &error) == 1 && strstr(error.text, "went away before it answered") != NULL);
    CHECK(hal.open(&hal, &error) == 0 && hal.paces);
    hal.close(hal.ctx);
}

static void test_a_simulator_that_does_not_answer(void)
{
    uint8_t hello[256];
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        look_on();
        _exit(0);
    }
    fcsl_bus_t *bus = listen_on_the_bus();
    take_one(bus, CONTROL, hello, HELLO_BYTES);
    (void)fcsl_bus_close(bus, WAIT_MS);
    bus = listen_on_the_bus();
    shake_hands(bus);
    join(child);
    (void)fcsl_bus_close(bus, WAIT_MS);
}

static void test_bad_commits(void)
{
    check_end(bad_commits, FCSL_HAL_TIMEOUT, "no time message of tick 2");
}

int main(void)
{
    named = 1;
    use_port("zenoh:tcp:");
    check_alone(test_value_missing);
    check_alone(test_value_too_short);
    check_alone(test_value_that_is_none);
    check_alone(test_bad_commits);
    check_alone(test_a_tick_behind_bad_commits);
    check_alone(test_a_start_behind_garbage);
    check_alone(test_a_rig);
    check_alone(test_a_simulator_that_does_not_answer);
    return 0;
}
