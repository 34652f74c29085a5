/* SPDX-License-Identifier: Apache-2.0
 *
 * The newest values from one thread to another: whole, in their order, and the reader is not left asleep.
 */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <semaphore.h>

#include "fcsl/fcsl_latest.h"
#include "fcsl_check.h"

enum { WORDS = 64, PUTS = 200000 };

static fcsl_latest_t latest;
static sem_t wake;

static void put(uint64_t value)
{
    uint64_t *values = fcsl_latest_back(&latest);
    for (int i = 0; i < WORDS; i++) {
        values[i] = value;
    }
    if (fcsl_latest_put(&latest)) {
        CHECK(sem_post(&wake) == 0);
    }
}

static void test_alone(void)
{
    CHECK(fcsl_latest_take(&latest) == 0);
    put(1);
    CHECK(fcsl_latest_take(&latest) == 1 && *(const uint64_t *)fcsl_latest_front(&latest) == 1);
    CHECK(fcsl_latest_take(&latest) == 0 && *(const uint64_t *)fcsl_latest_front(&latest) == 1);
    put(2);
    put(3);
    put(4);
    CHECK(fcsl_latest_take(&latest) == 4 && *(const uint64_t *)fcsl_latest_front(&latest) == 4);
    CHECK(fcsl_latest_take(&latest) == 0);
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
        const uint64_t number = fcsl_latest_take(&latest);
        const uint64_t *values = fcsl_latest_front(&latest);
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
    CHECK(fcsl_latest_open(&latest, WORDS * sizeof(uint64_t)) == 0 && sem_init(&wake, 0, 0) == 0);
    test_alone();
    CHECK(pthread_create(&reader, NULL, read_all, NULL) == 0);
    for (uint64_t value = 5; value <= PUTS; value++) {
        put(value);
    }
    CHECK(pthread_join(reader, NULL) == 0);
    fcsl_latest_close(&latest);
    return 0;
}
