/* SPDX-License-Identifier: Apache-2.0
 *
 * Where the threads of a session meet: the ring of what goes out, and the inboxes of what comes in. Two threads each, and every
 * message tells its number and its length.
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <string.h>
#include <time.h>

#include "bus/bus_inbox.h"
#include "bus/bus_ring.h"
#include "fcsl_check.h"

enum { MESSAGES = 20000, BYTES = 48, LEAST = 2, CAPACITY = 208, DEPTH = 3 };

/* A yield would wait for the time slices of whatever else computes on this core; who sleeps comes back before them. */
static void let_the_other_run(void)
{
    const struct timespec moment = {.tv_nsec = 20000};
    (void)nanosleep(&moment, NULL);
}

static size_t fill(uint8_t *message, uint32_t number)
{
    const size_t size = sizeof number + number % (BYTES - sizeof number + 1u);
    memset(message, (int)(number & 0xffu), size);
    memcpy(message, &number, sizeof number);
    return size;
}

static uint32_t check(const uint8_t *message, size_t size)
{
    uint8_t expected[BYTES];
    uint32_t number = 0;
    CHECK(size >= sizeof number);
    memcpy(&number, message, sizeof number);
    CHECK(fill(expected, number) == size && memcmp(expected, message, size) == 0);
    return number;
}

static void *push_all(void *ring)
{
    uint8_t message[BYTES];
    for (uint32_t i = 0; i < MESSAGES; i++) {
        const size_t size = fill(message, i);
        while (ring_push(ring, i % 7u, message, size) != 0) {
            let_the_other_run();
        }
    }
    return NULL;
}

static void test_ring_keeps_all_in_order(void)
{
    ring_t ring;
    pthread_t thread;
    CHECK(ring_open(&ring, CAPACITY) == 0 && pthread_create(&thread, NULL, push_all, &ring) == 0);
    for (uint32_t i = 0; i < MESSAGES; i++) {
        uint32_t output = 0;
        const uint8_t *bytes = NULL;
        size_t size = 0;
        while (!ring_front(&ring, &output, &bytes, &size)) {
            let_the_other_run();
        }
        CHECK(check(bytes, size) == i && output == i % 7u);
        ring_pop(&ring);
    }
    CHECK(pthread_join(thread, NULL) == 0);
    ring_close(&ring);
}

/* A message of half of the ring goes in wherever the last one ended; a longer one never does. */
static void test_ring_limits(void)
{
    static const uint8_t message[CAPACITY];
    ring_t ring;
    uint32_t output = 0;
    const uint8_t *bytes = NULL;
    size_t size = 0;
    CHECK(ring_open(&ring, CAPACITY) == 0);
    CHECK(!ring_front(&ring, &output, &bytes, &size));
    for (size_t first = 0; first < CAPACITY / 2u - 8u; first++) {
        CHECK(ring_push(&ring, 1, message, first) == 0 && ring_front(&ring, &output, &bytes, &size));
        ring_pop(&ring);
        CHECK(ring_push(&ring, 2, message, CAPACITY / 2u - 8u) == 0);
        CHECK(ring_front(&ring, &output, &bytes, &size) && output == 2 && size == CAPACITY / 2u - 8u);
        CHECK(ring_push(&ring, 3, message, CAPACITY / 2u) != 0 && ring_push(&ring, 3, message, SIZE_MAX) != 0);
        ring_pop(&ring);
        CHECK(!ring_front(&ring, &output, &bytes, &size));
    }
    ring_close(&ring);
}

typedef struct {
    inbox_t inbox;
    uint32_t taken;
    uint32_t replaced;
} rig_t;

static void *put_all(void *argument)
{
    rig_t *rig = argument;
    uint8_t message[BYTES];
    for (uint32_t i = 0; i < MESSAGES; i++) {
        const size_t size = fill(message, i);
        inbox_result_t result = inbox_put(&rig->inbox, message, size);
        while (result == INBOX_OVERFLOWED) {
            CHECK(rig->inbox.depth > 1);
            let_the_other_run();
            result = inbox_put(&rig->inbox, message, size);
        }
        CHECK(result == INBOX_TAKEN || (result == INBOX_REPLACED && rig->inbox.depth == 1));
        rig->replaced += result == INBOX_REPLACED;
    }
    return NULL;
}

/* A queue gives all in order. The newest message alone is whole, too, and never older than the one before; the last one comes,
 * and each one is taken or counted as replaced. */
static void test_inbox(uint32_t depth)
{
    static rig_t rig;
    uint8_t message[BYTES];
    pthread_t thread;
    size_t size = 0;
    uint32_t next = 0;
    memset(&rig, 0, sizeof rig);
    CHECK(inbox_open(&rig.inbox, BYTES, 0, depth) == 0 && !inbox_take(&rig.inbox, message, &size));
    CHECK(pthread_create(&thread, NULL, put_all, &rig) == 0);
    while (next < MESSAGES) {
        if (!inbox_take(&rig.inbox, message, &size)) {
            let_the_other_run();
            continue;
        }
        const uint32_t number = check(message, size);
        CHECK(number == next || (depth == 1 && number > next));
        next = number + 1u;
        rig.taken++;
    }
    CHECK(pthread_join(thread, NULL) == 0 && !inbox_take(&rig.inbox, message, &size));
    CHECK(rig.taken + rig.replaced == MESSAGES);
    inbox_close(&rig.inbox);
}

static void test_inbox_limits(void)
{
    const uint8_t message[BYTES + 1] = {0};
    uint8_t got[BYTES];
    inbox_t inbox;
    size_t size = BYTES;
    CHECK(inbox_open(&inbox, BYTES, LEAST, DEPTH) == 0);
    CHECK(inbox_put(&inbox, message, BYTES + 1u) == INBOX_WRONG_SIZE);
    CHECK(inbox_put(&inbox, message, LEAST - 1u) == INBOX_WRONG_SIZE);
    for (uint32_t i = 0; i < DEPTH; i++) {
        CHECK(inbox_put(&inbox, message, LEAST + i) == INBOX_TAKEN);
    }
    CHECK(inbox_put(&inbox, message, BYTES) == INBOX_OVERFLOWED);
    CHECK(inbox_take(&inbox, got, &size) && size == LEAST);
    CHECK(inbox_put(&inbox, message, BYTES) == INBOX_TAKEN);
    inbox_close(&inbox);
}

int main(void)
{
    test_ring_keeps_all_in_order();
    test_ring_limits();
    test_inbox(1);
    test_inbox(DEPTH);
    test_inbox_limits();
    return 0;
}
