/* SPDX-License-Identifier: Apache-2.0
 *
 * Checks what a session is to be, and says it to Zenoh.
 */
#define _GNU_SOURCE
#include "bus_config.h"

#include <netdb.h>
#include <stdio.h>
#include <string.h>

#include "bus_inbox.h"
#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_address.h"

enum { HOST_BYTES = 64, PORT_BYTES = 8, ENDPOINT_BYTES = 96, RING_BYTES_MIN = 64 };

/* A link is lost after a second of silence, and tried again up to 20 times a second. A put waits no longer than that for a
 * receiver. What comes in is bounded: a message by somewhat more than FCSL_BUS_MESSAGE_MAX, so that what is a little too long
 * arrives and is counted; sessions by 64. Nothing is looked for in the network. */
/* A thread that waits for a processor is no slow receiver: Zenoh's 1 ms would drop what is under way to it. While a receiver is slow
 * nothing waits a second time. */
static const char CONFIG[] =
    "{mode: '%s',"
    " connect: {endpoints: [%s], timeout_ms: %u, exit_on_failure: true,"
    "  retry: {period_init_ms: 50, period_max_ms: 200, period_increase_factor: 2}},"
    " listen: {endpoints: [%s], timeout_ms: 0, exit_on_failure: true},"
    " scouting: {multicast: {enabled: false}, gossip: {enabled: false}},"
    " transport: {unicast: {open_timeout: 1000, accept_timeout: 1000, max_sessions: 64},"
    "  link: {tx: {lease: 1000, keep_alive: 4,"
    "    queue: {congestion_control: {block: {wait_before_close: 1000000}, drop: {wait_before_drop: 20000}}}},"
    "   rx: {max_message_size: %u}}}}";

/* `longest`: bytes; `forbidden`: characters. */
static int check_key(const char *what, const char *key, size_t longest, const char *forbidden, fcsl_error_t *error)
{
    const size_t size = key != NULL ? strnlen(key, longest + 1u) : 0u;
    if (size == 0 || size > longest) {
        return fcsl_fail(error, "%s of the bus has a key of %s bytes: 1 to %zu are possible", what,
                         size == 0 ? "0" : "too many", longest);
    }
    if (strpbrk(key, forbidden) != NULL || key[0] == '/' || key[size - 1] == '/' || strstr(key, "//") != NULL) {
        return fcsl_fail(error, "%s of the bus has the key '%s': write words with one slash between them, without %s",
                         what, key, forbidden);
    }
    return 0;
}

static int check_keys(const char *what, const char *const *keys, uint32_t count, size_t longest, fcsl_error_t *error)
{
    if (count > FCSL_BUS_KEYS_MAX) {
        return fcsl_fail(error, "the bus has %u keys for %s; at most %u are possible", count, what, FCSL_BUS_KEYS_MAX);
    }
    for (uint32_t i = 0; i < count; i++) {
        if (check_key(what, keys[i], longest, "*$?#", error) != 0) {
            return -1;
        }
    }
    return 0;
}

static int check_inputs(const fcsl_bus_options_t *options, fcsl_error_t *error)
{
    uint64_t memory = options->ring_bytes;
    if (options->input_count > FCSL_BUS_KEYS_MAX) {
        return fcsl_fail(error, "the bus has %u inputs; at most %u are possible", options->input_count,
                         FCSL_BUS_KEYS_MAX);
    }
    if (options->service_count > options->input_count || options->busy_bytes > FCSL_BUS_MESSAGE_MAX) {
        return fcsl_fail(error, "the bus has %u services of %u inputs, and %u bytes for a busy one",
                         options->service_count, options->input_count, options->busy_bytes);
    }
    for (uint32_t i = 0; i < options->input_count; i++) {
        const fcsl_bus_input_t *input = &options->inputs[i];
        if (check_key("an input", input->key, FCSL_BUS_KEY_MAX, "$?#", error) != 0) {
            return -1;
        }
        if (input->bytes == 0 || input->bytes > FCSL_BUS_MESSAGE_MAX || input->depth == 0) {
            return fcsl_fail(
                error,
                "input '%s' of the bus has %u bytes and depth %u: 1 to %u bytes and a depth from 1 on are possible",
                input->key, input->bytes, input->depth, FCSL_BUS_MESSAGE_MAX);
        }
        memory += inbox_memory(input->bytes, input->depth);
    }
    if (memory > FCSL_BUS_MEMORY_MAX) {
        return fcsl_fail(error, "ring and inputs of the bus take %llu bytes; at most %u are possible",
                         (unsigned long long)memory, FCSL_BUS_MEMORY_MAX);
    }
    return 0;
}

static int check_answers(const fcsl_bus_options_t *options, fcsl_error_t *error)
{
    if (options->answer_count > FCSL_BUS_KEYS_MAX) {
        return fcsl_fail(error, "the bus has %u answers; at most %u are possible", options->answer_count,
                         FCSL_BUS_KEYS_MAX);
    }
    for (uint32_t i = 0; i < options->answer_count; i++) {
        const fcsl_bus_answer_t *answer = &options->answers[i];
        if (check_key("an answer", answer->key, FCSL_BUS_KEY_MAX, "*$?#", error) != 0) {
            return -1;
        }
        if (answer->size > FCSL_BUS_MESSAGE_MAX) {
            return fcsl_fail(error, "answer '%s' of the bus has %u bytes; at most %u are possible", answer->key,
                             answer->size, FCSL_BUS_MESSAGE_MAX);
        }
    }
    return 0;
}

int fcsl_bus_endpoint_read(const char *endpoint, struct sockaddr_storage *address, socklen_t *length)
{
    const int is_tcp = strncmp(endpoint, "tcp", 3) == 0 && (endpoint[3] == ':' || endpoint[3] == '/');
    return is_tcp ? fcsl_address_read(endpoint + 4, address, length) : -1;
}

/* The endpoint as Zenoh writes it, with a number for its host. */
static int read_endpoint(const char *endpoint, char text[ENDPOINT_BYTES], fcsl_error_t *error)
{
    struct sockaddr_storage address;
    socklen_t length = 0;
    char host[HOST_BYTES];
    char port[PORT_BYTES];
    if (fcsl_bus_endpoint_read(endpoint, &address, &length) != 0 ||
        getnameinfo((const struct sockaddr *)&address, length, host, sizeof host, port, sizeof port,
                    NI_NUMERICHOST | NI_NUMERICSERV) != 0) {
        return fcsl_fail(error, "%s: write tcp:HOST:PORT in numbers, like tcp:127.0.0.1:7447", endpoint);
    }
    const int six = address.ss_family == AF_INET6;
    (void)snprintf(text, ENDPOINT_BYTES, "'tcp/%s%s%s:%s'", six ? "[" : "", host, six ? "]" : "", port);
    return 0;
}

int bus_config_check(const fcsl_bus_options_t *options, fcsl_error_t *error)
{
    char endpoint[ENDPOINT_BYTES];
    if ((options->endpoint == NULL) == (options->config_path == NULL)) {
        return fcsl_fail(error, "a session on the bus has an endpoint or a configuration file, one of the two");
    }
    if (options->ring_bytes < RING_BYTES_MIN) {
        return fcsl_fail(error, "the ring of the bus has %u bytes; %d is the least", options->ring_bytes,
                         RING_BYTES_MIN);
    }
    if (options->endpoint != NULL && read_endpoint(options->endpoint, endpoint, error) != 0) {
        return -1;
    }
    if (check_keys("an output", options->outputs, options->output_count, FCSL_BUS_KEY_MAX, error) != 0 ||
        check_keys("a token", options->tokens, options->token_count, FCSL_BUS_TOKEN_MAX, error) != 0 ||
        check_keys("a watched token", options->watched, options->watched_count, FCSL_BUS_KEY_MAX, error) != 0) {
        return -1;
    }
    return check_answers(options, error) != 0 ? -1 : check_inputs(options, error);
}

int bus_config_write(const fcsl_bus_options_t *options, char text[BUS_CONFIG_BYTES], fcsl_error_t *error)
{
    char endpoint[ENDPOINT_BYTES];
    const int listens = options->role == FCSL_BUS_LISTEN;
    if (read_endpoint(options->endpoint, endpoint, error) != 0) {
        return -1;
    }
    (void)snprintf(text, BUS_CONFIG_BYTES, CONFIG, options->role == FCSL_BUS_CLIENT ? "client" : "peer",
                   listens ? "" : endpoint, options->timeout_ms, listens ? endpoint : "", 2u * FCSL_BUS_MESSAGE_MAX);
    return 0;
}
