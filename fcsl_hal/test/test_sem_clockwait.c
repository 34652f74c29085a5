/* SPDX-License-Identifier: Apache-2.0
 *
 * Waiting on a semaphore where glibc has no sem_clockwait(): it is posted before, meanwhile, or not at all.
 */
#define FCSL_TEST_SEM_CLOCKWAIT
#include "../src/base/sem_clockwait.c"

#include "fcsl/fcsl_monotonic.h"
#include "fcsl_check.h"

enum { SHORT_MS = 30 };

static struct timespec in_ms(long ms)
{
    struct timespec at;
    (void)clock_gettime(CLOCK_MONOTONIC, &at);
    at.tv_nsec += ms * 1000000;
    at.tv_sec += at.tv_nsec / FCSL_NS_PER_S;
    at.tv_nsec %= FCSL_NS_PER_S;
    return at;
}

static int is_past(struct timespec at)
{
    const struct timespec now = in_ms(0);
    return now.tv_sec > at.tv_sec || (now.tv_sec == at.tv_sec && now.tv_nsec >= at.tv_nsec);
}

static void *post_later(void *semaphore)
{
    const struct timespec pause = {0, SHORT_MS * 1000000};
    (void)nanosleep(&pause, NULL);
    (void)sem_post(semaphore);
    return NULL;
}

int main(void)
{
    sem_t semaphore;
    pthread_t thread;
    CHECK(sem_init(&semaphore, 0, 1) == 0);
    struct timespec until = in_ms(-1000);
    CHECK(wait_on_realtime(&semaphore, CLOCK_MONOTONIC, &until) == 0); /* posted: no matter that it is late */
    CHECK(wait_on_realtime(&semaphore, CLOCK_MONOTONIC, &until) == -1 && errno == ETIMEDOUT);
    until = in_ms(SHORT_MS);
    CHECK(wait_on_realtime(&semaphore, CLOCK_MONOTONIC, &until) == -1 && errno == ETIMEDOUT && is_past(until));
    until = in_ms(60000);
    CHECK(pthread_create(&thread, NULL, post_later, &semaphore) == 0);
    CHECK(wait_on_realtime(&semaphore, CLOCK_MONOTONIC, &until) == 0 && !is_past(until));
    CHECK(pthread_join(thread, NULL) == 0);
    return 0;
}
