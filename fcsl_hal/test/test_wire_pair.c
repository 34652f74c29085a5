/* SPDX-License-Identifier: Apache-2.0
 *
 * Two ends within a process, over the link layer: order, sizes, a full queue, and what is left when one of them goes.
 */
#define _GNU_SOURCE
#include <string.h>

#include "fcsl/fcsl_link.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_wire.h"
#include "fcsl_check.h"

enum { MESSAGE_MAX = 4096, MESSAGES = 2000, WAIT_S = 20 };

static uint64_t soon(void)
{
    return fcsl_monotonic_ns() + (uint64_t)WAIT_S * FCSL_NS_PER_S;
}

static void open_pair(fcsl_wire_t ends[2])
{
    fcsl_error_t error;
    CHECK(fcsl_wire_pair(MESSAGE_MAX, ends, &error) == 0);
}

static void close_pair(const fcsl_wire_t ends[2])
{
    ends[0].close(ends[0].ctx);
    ends[1].close(ends[1].ctx);
}

static void fill(uint8_t *message, uint32_t number, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        message[i] = (uint8_t)(number + 31u * i);
    }
}

/* Messages of every size, many under way at a time, both ways. */
static void test_all_arrive_in_order(void)
{
    static uint8_t message[MESSAGE_MAX];
    static uint8_t got[MESSAGE_MAX];
    fcsl_wire_t ends[2];
    uint32_t sent[2] = {0, 0};
    uint32_t received[2] = {0, 0};
    open_pair(ends);
    while (received[0] < MESSAGES || received[1] < MESSAGES) {
        for (uint32_t i = 0; i < 2; i++) {
            const size_t size = 1u + (sent[i] * 97u + i) % MESSAGE_MAX;
            fill(message, sent[i], size);
            sent[i] += sent[i] < MESSAGES && ends[i].send(ends[i].ctx, message, size) == FCSL_WIRE_OK ? 1u : 0u;
        }
        for (uint32_t i = 0; i < 2; i++) {
            size_t length = 0;
            const int last = received[i] < sent[1u - i] && sent[1u - i] == MESSAGES;
            if (ends[i].receive(ends[i].ctx, last ? soon() : 0, got, sizeof got, &length) != FCSL_WIRE_OK) {
                CHECK(!last);
                continue;
            }
            const size_t size = 1u + (received[i] * 97u + (1u - i)) % MESSAGE_MAX;
            fill(message, received[i], size);
            CHECK(length == size && memcmp(message, got, size) == 0);
            received[i]++;
        }
    }
    close_pair(ends);
}

/* Who does not read makes send say that there is no room; nothing is lost when they do. */
static void test_a_full_wire(void)
{
    static uint8_t message[MESSAGE_MAX];
    static uint8_t got[MESSAGE_MAX];
    fcsl_wire_t ends[2];
    uint32_t sent = 0;
    size_t length = 0;
    open_pair(ends);
    const uint64_t deadline = soon();
    for (int refused = 0; refused < 1000;) {
        fill(message, sent, MESSAGE_MAX);
        const fcsl_wire_status_t status = ends[0].send(ends[0].ctx, message, MESSAGE_MAX);
        CHECK(status == FCSL_WIRE_OK || status == FCSL_WIRE_NONE);
        sent += status == FCSL_WIRE_OK;
        refused += status == FCSL_WIRE_NONE;
        CHECK(sent < 64 && deadline > 0);
    }
    for (uint32_t i = 0; i < sent; i++) {
        fill(message, i, MESSAGE_MAX);
        CHECK(ends[1].receive(ends[1].ctx, soon(), got, sizeof got, &length) == FCSL_WIRE_OK);
        CHECK(length == MESSAGE_MAX && memcmp(message, got, length) == 0);
    }
    close_pair(ends);
}

static void test_sizes(void)
{
    static uint8_t large[FCSL_LINK_BUFFER];
    uint8_t small[16];
    uint64_t counters[FCSL_WIRE_COUNTERS_MAX / sizeof(uint64_t)] = {0};
    fcsl_wire_t ends[2];
    fcsl_error_t error;
    size_t length = 0;
    CHECK(fcsl_wire_pair(sizeof large, ends, &error) != 0 && strstr(error.text, "use unix:PATH") != NULL);
    open_pair(ends);
    CHECK(ends[0].send(ends[0].ctx, large, sizeof large) == FCSL_WIRE_ERROR);
    CHECK(strstr(ends[0].explain(ends[0].ctx), "too long for the link") != NULL);
    /* Too long for who receives: dropped, counted, and the next one comes. */
    CHECK(ends[0].send(ends[0].ctx, large, 100) == FCSL_WIRE_OK && ends[0].send(ends[0].ctx, large, 9) == FCSL_WIRE_OK);
    CHECK(ends[1].receive(ends[1].ctx, soon(), small, sizeof small, &length) == FCSL_WIRE_OK && length == 9);
    CHECK(ends[1].counters->bytes <= sizeof counters);
    ends[1].count(ends[1].ctx, counters);
    for (uint32_t i = 0; i < ends[1].counters->field_count; i++) {
        const fcsl_field_t *field = &ends[1].counters->fields[i];
        if (strcmp(field->path, "link.port0.too_large") == 0) {
            CHECK(counters[field->offset / sizeof(uint64_t)] == 1);
        }
    }
    close_pair(ends);
}

/* What was sent before one end closed is there for the other one. */
static void test_what_is_left(void)
{
    uint8_t got[16];
    size_t length = 0;
    fcsl_wire_t ends[2];
    open_pair(ends);
    CHECK(ends[0].send(ends[0].ctx, (const uint8_t *)"first", 5) == FCSL_WIRE_OK);
    CHECK(ends[1].receive(ends[1].ctx, soon(), got, sizeof got, &length) == FCSL_WIRE_OK); /* they have met */
    CHECK(ends[0].send(ends[0].ctx, (const uint8_t *)"last", 4) == FCSL_WIRE_OK);
    ends[0].close(ends[0].ctx);
    CHECK(ends[1].receive(ends[1].ctx, soon(), got, sizeof got, &length) == FCSL_WIRE_OK);
    CHECK(length == 4 && memcmp(got, "last", 4) == 0);
    CHECK(ends[1].receive(ends[1].ctx, 0, got, sizeof got, &length) != FCSL_WIRE_OK);
    ends[1].close(ends[1].ctx);
}

int main(void)
{
    test_all_arrive_in_order();
    test_a_full_wire();
    test_sizes();
    test_what_is_left();
    return 0;
}
