/* SPDX-License-Identifier: Apache-2.0
 *
 * The buffer between the guard's loop and the thread of a device: the newest values, whole, in their order, and nobody is left asleep.
 * The source is compiled in: it is part of fcsl-guard.
 */
#define _POSIX_C_SOURCE 200809L
#include "../board/triple_buffer.c"

#include <pthread.h>
#include <semaphore.h>

#include "fcsl_check.h"

enum { WORDS = 64, PUTS = 200000 };

static triple_buffer_t buffer;
static sem_t wake;

static void put(uint64_t value)
{
    uint64_t *values = triple_buffer_back(&buffer);
    for (int i = 0; i < WORDS; i++) {
        values[i] = value;
    }
    if (triple_buffer_put(&buffer)) {
        CHECK(sem_post(&wake) == 0);
    }
}

static void test_alone(void)
{
    CHECK(triple_buffer_take(&buffer) == 0);
    put(1);
    CHECK(triple_buffer_take(&buffer) == 1 && *(const uint64_t *)triple_buffer_front(&buffer) == 1);
    CHECK(triple_buffer_take(&buffer) == 0 && *(const uint64_t *)triple_buffer_front(&buffer) == 1);
    put(2);
    put(3);
    put(4);
    CHECK(triple_buffer_take(&buffer) == 4 && *(const uint64_t *)triple_buffer_front(&buffer) == 4);
    CHECK(triple_buffer_take(&buffer) == 0);
    int posts = 0; /* one for each that was taken */
    CHECK(sem_getvalue(&wake, &posts) == 0 && posts == 2);
}

/* Sleeps whenever it has no post, and ends with the last values. */
static void *read_all(void *unused)
{
    (void)unused;
    uint64_t last = 4;
    while (last < PUTS) {
        CHECK(sem_wait(&wake) == 0);
        const uint64_t number = triple_buffer_take(&buffer);
        const uint64_t *values = triple_buffer_front(&buffer);
        CHECK(number == 0u || number > last);
        last = number > 0u ? number : last;
        for (int i = 0; i < WORDS; i++) {
            CHECK(values[i] == last);
        }
    }
    return NULL;
}

int main(void)
{
    pthread_t reader;
    CHECK(triple_buffer_open(&buffer, WORDS * sizeof(uint64_t)) == 0 && sem_init(&wake, 0, 0) == 0);
    test_alone();
    CHECK(pthread_create(&reader, NULL, read_all, NULL) == 0);
    for (uint64_t value = 5; value <= PUTS; value++) {
        put(value);
    }
    CHECK(pthread_join(reader, NULL) == 0);
    triple_buffer_close(&buffer);
    return 0;
}
