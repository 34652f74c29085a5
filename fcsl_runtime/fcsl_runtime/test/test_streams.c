/* SPDX-License-Identifier: Apache-2.0
 *
 * How many ticks a `tick` may make between two readings of the history, so that no subscriber misses one. The sources are
 * compiled in.
 */
#define _GNU_SOURCE
#include "vars/streams.c"

#include "vars/client.c"
#include "vars/json_read.c"
#include "vars/json_write.c"
#include "vars/subscription.c"
#include "vars/value.c"
#include "machine/enumerators.c"
#include "machine/scalar_text.c"
#include "machine/view.c"

#include "fcsl_check.h"

enum { SLOTS = 64 };

static fcsl_vars_t vars;
static const fcsl_history_t history = {.slots = SLOTS};

static void subscribe(size_t client, size_t subscription, size_t bytes)
{
    vars.clients[client].subscriptions[subscription].number = 1;
    vars.clients[client].subscriptions[subscription].bytes = bytes;
}

static void nobody(void)
{
    vars = (fcsl_vars_t){.history = &history, .used = CLIENTS_MAX};
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        vars.clients[i].fd = -1;
    }
}

static void check_ticks(uint32_t ticks)
{
    CHECK(fcsl_vars_prepare_streams(&vars) == (ticks > 0) && vars.protocol.ticks_at_once == ticks);
}

static void test_nobody(void)
{
    nobody();
    vars.cursor = 7;
    vars.overtaken = 3;
    check_ticks(0);
    CHECK(vars.cursor == 0 && vars.overtaken == 0); /* nothing was published: whoever comes begins there */
    vars.clients[2].fd = 9; /* connected, and subscribes to nothing */
    check_ticks(0);
    subscribe(3, 0, 100); /* of a connection that is gone */
    check_ticks(0);
}

static void test_room_of_a_client(void)
{
    nobody();
    vars.clients[CLIENTS_MAX - 1].fd = 9;
    subscribe(CLIENTS_MAX - 1, SUBSCRIPTIONS_MAX - 1, 100);
    check_ticks(SLOTS / 2);
    subscribe(CLIENTS_MAX - 1, SUBSCRIPTIONS_MAX - 1, SAMPLES_BYTES_MAX / SLOTS);
    check_ticks(SLOTS / 2);
    subscribe(CLIENTS_MAX - 1, SUBSCRIPTIONS_MAX - 1, SAMPLES_BYTES_MAX / SLOTS + 1);
    check_ticks(SLOTS / 2 - 1);
    subscribe(CLIENTS_MAX - 1, 0, SAMPLE_BYTES_MAX - SAMPLES_BYTES_MAX / SLOTS - 1);
    check_ticks(2);
    vars.clients[0].fd = 10;
    subscribe(0, 0, SAMPLES_BYTES_MAX / 2);
    check_ticks(1);
    subscribe(0, 0, SAMPLES_BYTES_MAX);
    check_ticks(1);
}

int main(void)
{
    test_nobody();
    test_room_of_a_client();
    return 0;
}
