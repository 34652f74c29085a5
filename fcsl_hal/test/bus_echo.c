/* SPDX-License-Identifier: Apache-2.0
 *
 * bus_echo ENDPOINT|FILE: a session that listens, on the endpoint or as the configuration file says, and sends back what it
 * gets (t/in to t/out), until its standard input ends. Then it prints its counters. For clients that are not ours.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <poll.h>

#include "bus_rig.h"

enum { MESSAGE_BYTES = 64, DEPTH = 256, LOOK_NS = 20000000 };

static int input_ended(void)
{
    struct pollfd entry = {.fd = STDIN_FILENO, .events = POLLIN};
    return poll(&entry, 1, 0) > 0;
}

int main(int argc, char **argv)
{
    static const char *const outputs[] = {"t/out"};
    static const char *const tokens[] = {"t/alive"};
    const fcsl_bus_answer_t answer = {.key = "t/about", .bytes = "echo", .size = 4};
    const fcsl_bus_input_t inputs[] = {{.key = "t/in", .bytes = MESSAGE_BYTES, .depth = DEPTH}};
    CHECK(argc == 2);
    const int is_endpoint = strncmp(argv[1], "tcp/", 4) == 0;
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = is_endpoint ? argv[1] : NULL,
                                        .config_path = is_endpoint ? NULL : argv[1],
                                        .ring_bytes = RING_BYTES,
                                        .outputs = outputs,
                                        .output_count = 1,
                                        .inputs = inputs,
                                        .input_count = 1,
                                        .tokens = tokens,
                                        .token_count = 1,
                                        .answers = &answer,
                                        .answer_count = 1,
                                        .watched = tokens,
                                        .watched_count = 1,
                                        .strays = "t/**"};
    fcsl_bus_t *bus = open_bus(&options);
    (void)printf("listening\n");
    (void)fflush(stdout);
    uint32_t alive = 0;
    while (!input_ended()) {
        uint8_t message[MESSAGE_BYTES];
        size_t size = 0;
        while (fcsl_bus_take(bus, 0, message, &size)) {
            CHECK(fcsl_bus_post(bus, 0, message, size) == 0);
        }
        alive = fcsl_bus_token_count(bus, 0) > alive ? fcsl_bus_token_count(bus, 0) : alive;
        (void)fcsl_bus_wait(bus, fcsl_monotonic_ns() + LOOK_NS);
    }
    const fcsl_bus_counters_t counters = counted(bus);
    (void)printf("{\"received\": %" PRIu64 ", \"wrong_size\": %" PRIu64 ", \"deletions\": %" PRIu64
                 ", \"strays\": %" PRIu64 ", \"posted\": %" PRIu64 ", \"overflowed\": %" PRIu64 ", \"alive\": %u}\n",
                 counters.received, counters.wrong_size, counters.deletions, counters.strays, counters.posted,
                 counters.overflowed, alive);
    CHECK(fcsl_bus_close(bus, CLOSE_MS) == 0);
    return 0;
}
