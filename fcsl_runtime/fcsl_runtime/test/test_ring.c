/* SPDX-License-Identifier: Apache-2.0
 *
 * The recorder's ring between two threads: order, content, wrap-around, waiting, dropping. The source is compiled in: it
 * is not part of the library's interface.
 */
#include "record/ring.c"

#include <pthread.h>

#include "fcsl_check.h"

enum { RECORDS = 200000, SIZE_MAX_BYTES = 700 };

static uint32_t size_of(uint64_t number)
{
    return (uint32_t)(number * 2654435761u % SIZE_MAX_BYTES);
}

/* Record `number`, if it finds room. */
static int push(fcsl_ring_t *ring, uint64_t number, fcsl_ring_policy_t policy)
{
    const fcsl_record_t record = {.tick = number, .size = size_of(number), .kind = (uint32_t)(number % 7)};
    uint8_t *data = fcsl_ring_claim(ring, &record, policy);
    if (data == NULL) {
        return 0;
    }
    memset(data, (int)(number & 0xff), record.size);
    fcsl_ring_publish(ring);
    return 1;
}

typedef struct {
    fcsl_ring_t ring;
    uint64_t received;
    uint64_t last;
} consumer_t;

/* Numbers rise, and every record is what the producer made of its number. */
static void *consume(void *argument)
{
    consumer_t *consumer = argument;
    fcsl_record_t record;
    const uint8_t *data = NULL;
    fcsl_ring_status_t status = FCSL_RING_EMPTY;
    while ((status = fcsl_ring_front(&consumer->ring, &record, &data)) != FCSL_RING_ENDED) {
        if (status == FCSL_RING_EMPTY) {
            fcsl_ring_nap(&consumer->ring);
            continue;
        }
        CHECK(consumer->received == 0 || record.tick > consumer->last);
        CHECK(record.size == size_of(record.tick) && record.kind == (uint32_t)(record.tick % 7));
        for (uint32_t i = 0; i < record.size; i++) {
            CHECK(data[i] == (uint8_t)record.tick);
        }
        consumer->last = record.tick;
        consumer->received++;
        fcsl_ring_pop(&consumer->ring);
    }
    return NULL;
}

static void test_two_threads(fcsl_ring_policy_t policy)
{
    consumer_t consumer = {0};
    pthread_t thread;
    uint64_t dropped = 0;
    CHECK(fcsl_ring_open(&consumer.ring, 16384) == 0);
    CHECK(pthread_create(&thread, NULL, consume, &consumer) == 0);
    for (uint64_t number = 1; number <= RECORDS; number++) {
        dropped += !push(&consumer.ring, number, policy);
    }
    fcsl_ring_end(&consumer.ring);
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK(consumer.received + dropped == RECORDS);
    CHECK(policy != FCSL_RING_WAIT || dropped == 0);
    fcsl_ring_free(&consumer.ring);
}

/* Claims and publishes a record of `size` bytes. */
static int push_sized(fcsl_ring_t *ring, uint32_t size, fcsl_ring_policy_t policy)
{
    const fcsl_record_t record = {.size = size};
    if (fcsl_ring_claim(ring, &record, policy) == NULL) {
        return 0;
    }
    fcsl_ring_publish(ring);
    return 1;
}

/* Without a consumer the ring takes what fits and refuses the rest without waiting; some sooner, to leave room for others. */
static void test_full(void)
{
    fcsl_ring_t ring;
    fcsl_record_t record;
    uint32_t pushed = 0;
    CHECK(fcsl_ring_open(&ring, 4096) == 0);
    while (push_sized(&ring, 224, FCSL_RING_DROP_EARLIER)) {
        pushed++;
    }
    CHECK(pushed == (4096 - 512) / 256);
    while (push_sized(&ring, 224, FCSL_RING_DROP)) {
        pushed++;
    }
    CHECK(pushed == 4096 / 256);
    CHECK(!push_sized(&ring, 4096, FCSL_RING_WAIT));
    fcsl_ring_end(&ring);
    const uint8_t *out = NULL;
    for (uint32_t i = 0; i < pushed; i++) {
        CHECK(fcsl_ring_front(&ring, &record, &out) == FCSL_RING_RECORD && record.size == 224);
        fcsl_ring_pop(&ring);
    }
    CHECK(fcsl_ring_front(&ring, &record, &out) == FCSL_RING_ENDED);
    fcsl_ring_free(&ring);
}

/* What was claimed but not published is nobody's. */
static void test_unpublished(void)
{
    fcsl_ring_t ring;
    fcsl_record_t record = {.size = 8};
    const uint8_t *out = NULL;
    CHECK(fcsl_ring_open(&ring, 4096) == 0);
    CHECK(fcsl_ring_claim(&ring, &record, FCSL_RING_DROP) != NULL);
    CHECK(fcsl_ring_front(&ring, &record, &out) == FCSL_RING_EMPTY);
    fcsl_ring_publish(&ring);
    CHECK(fcsl_ring_front(&ring, &record, &out) == FCSL_RING_RECORD);
    fcsl_ring_free(&ring);
}

int main(void)
{
    test_full();
    test_unpublished();
    test_two_threads(FCSL_RING_WAIT);
    test_two_threads(FCSL_RING_DROP);
    test_two_threads(FCSL_RING_DROP_EARLIER);
    return 0;
}
