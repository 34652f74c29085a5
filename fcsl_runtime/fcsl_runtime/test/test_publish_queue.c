/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages through a publish queue: whole, in their order; dropped where there is no room, or waited for.
 */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_publish_queue.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl_check.h"

enum { MESSAGES = 200000, HEAD_BYTES = 8 };

static uint8_t taken[FCSL_PUBLISH_QUEUE_TAKE_MAX];

/* Of message number `number`: its length, and what stands in all its bytes. */
static uint32_t length_of(uint32_t number)
{
    return 1u + number * 7u % 300u;
}

static uint8_t *claim(fcsl_publish_queue_t *queue, uint32_t number)
{
    uint8_t *place = fcsl_publish_queue_claim(queue, number, length_of(number), FCSL_PUBLISH_QUEUE_STREAM);
    if (place != NULL) {
        memset(place, (int)(number % 251u), length_of(number));
        fcsl_publish_queue_put(queue);
    }
    return place;
}

/* Takes what is there, which must be whole messages of rising numbers from *next on. Returns how many. */
static uint32_t take(fcsl_publish_queue_t *queue, uint32_t *next)
{
    uint32_t count = 0;
    const size_t size = fcsl_publish_queue_take(queue, 1, taken);
    for (size_t at = 0; at < size; count++) {
        const uint32_t number = fcsl_get_u32(taken + at);
        const uint32_t length = fcsl_get_u32(taken + at + 4);
        CHECK(number >= *next && length == length_of(number));
        for (uint32_t i = 0; i < length; i++) {
            CHECK(taken[at + HEAD_BYTES + i] == number % 251u);
        }
        *next = number + 1u;
        at += HEAD_BYTES + (length + 7u) / 8u * 8u;
    }
    return count;
}

static void *put_all(void *queue)
{
    for (uint32_t i = 0; i < MESSAGES; i++) {
        CHECK(claim(queue, i) != NULL);
    }
    return NULL;
}

static void test_who_waits_loses_nothing(void)
{
    fcsl_error_t error;
    pthread_t thread;
    uint32_t next = 0;
    uint32_t count = 0;
    fcsl_publish_queue_t *queue = fcsl_publish_queue_new(1, &error);
    CHECK(queue != NULL && pthread_create(&thread, NULL, put_all, queue) == 0);
    while (count < MESSAGES) {
        count += take(queue, &next);
    }
    CHECK(pthread_join(thread, NULL) == 0 && next == MESSAGES && fcsl_publish_queue_dropped(queue) == 0);
    fcsl_publish_queue_free(queue);
}

static void test_what_finds_no_room_is_counted(void)
{
    fcsl_error_t error;
    uint32_t next = 0;
    uint32_t put = 0;
    uint32_t count = 0;
    fcsl_publish_queue_t *queue = fcsl_publish_queue_new(0, &error);
    CHECK(queue != NULL);
    while (put < MESSAGES && claim(queue, put) != NULL) {
        put++;
    }
    CHECK(put > 1000u && put < MESSAGES && fcsl_publish_queue_dropped(queue) == 1);
    /* Changes find room where streams do not. */
    uint8_t *place = fcsl_publish_queue_claim(queue, put, length_of(put), FCSL_PUBLISH_QUEUE_CHANGE);
    CHECK(place != NULL);
    memset(place, (int)(put % 251u), length_of(put));
    fcsl_publish_queue_put(queue);
    CHECK(fcsl_publish_queue_claim(queue, 0, FCSL_PUBLISH_QUEUE_TAKE_MAX, FCSL_PUBLISH_QUEUE_CHANGE) ==
          NULL); /* never */
    for (uint32_t more = 1; more > 0;) {
        more = take(queue, &next);
        count += more;
    }
    CHECK(count == put + 1u && next == put + 1u && fcsl_publish_queue_dropped(queue) == 2);
    fcsl_publish_queue_free(queue);
}

int main(void)
{
    test_who_waits_loses_nothing();
    test_what_finds_no_room_is_counted();
    return 0;
}
