/* SPDX-License-Identifier: Apache-2.0
 *
 * The recorder's ring between two threads: order, content, wrap-around, waiting, dropping. The source is compiled in: it
 * is not part of the library's interface.
 */
#include "ring.c"

#include <pthread.h>

#include "fcsl/fcsl_check.h"

enum { RECORDS = 200000, SIZE_MAX_BYTES = 700 };

static uint32_t size_of(uint64_t number)
{
    return (uint32_t)(number * 2654435761u % SIZE_MAX_BYTES);
}

static void fill(uint64_t number, uint8_t *data)
{
    memset(data, (int)(number & 0xff), size_of(number));
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
    fcsl_ring_status_t status = FCSL_RING_IDLE;
    while ((status = fcsl_ring_front(&consumer->ring, &record, &data)) != FCSL_RING_ENDED) {
        if (status == FCSL_RING_IDLE) {
            continue;
        }
        CHECK(consumer->received == 0 || record.time_ns > consumer->last);
        CHECK(record.size == size_of(record.time_ns) && record.topic == (uint32_t)(record.time_ns % 7));
        for (uint32_t i = 0; i < record.size; i++) {
            CHECK(data[i] == (uint8_t)record.time_ns);
        }
        consumer->last = record.time_ns;
        consumer->received++;
        fcsl_ring_pop(&consumer->ring);
    }
    return NULL;
}

static void test_two_threads(int wait)
{
    static uint8_t data[SIZE_MAX_BYTES];
    consumer_t consumer = {0};
    pthread_t thread;
    uint64_t dropped = 0;
    CHECK(fcsl_ring_open(&consumer.ring, 16384) == 0);
    CHECK(pthread_create(&thread, NULL, consume, &consumer) == 0);
    for (uint64_t number = 1; number <= RECORDS; number++) {
        const fcsl_record_t record = {.time_ns = number, .size = size_of(number), .topic = (uint32_t)(number % 7)};
        fill(number, data);
        dropped += fcsl_ring_push(&consumer.ring, &record, data, wait) != 0;
    }
    fcsl_ring_end(&consumer.ring);
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK(consumer.received + dropped == RECORDS);
    CHECK(!wait || dropped == 0);
    fcsl_ring_free(&consumer.ring);
}

/* Without a consumer the ring takes what fits and refuses the rest without waiting. */
static void test_full(void)
{
    static uint8_t data[SIZE_MAX_BYTES];
    fcsl_ring_t ring;
    fcsl_record_t record = {.size = 240};
    uint32_t pushed = 0;
    CHECK(fcsl_ring_open(&ring, 4096) == 0);
    while (fcsl_ring_push(&ring, &record, data, 0) == 0) {
        pushed++;
    }
    CHECK(pushed == 4096 / 256);
    record.size = 4096;
    CHECK(fcsl_ring_push(&ring, &record, data, 1) != 0);
    fcsl_ring_end(&ring);
    const uint8_t *out = NULL;
    for (uint32_t i = 0; i < pushed; i++) {
        CHECK(fcsl_ring_front(&ring, &record, &out) == FCSL_RING_RECORD && record.size == 240);
        fcsl_ring_pop(&ring);
    }
    CHECK(fcsl_ring_front(&ring, &record, &out) == FCSL_RING_ENDED);
    fcsl_ring_free(&ring);
}

int main(void)
{
    test_full();
    test_two_threads(1);
    test_two_threads(0);
    return 0;
}
