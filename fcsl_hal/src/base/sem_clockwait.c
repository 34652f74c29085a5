/* SPDX-License-Identifier: Apache-2.0
 *
 * sem_clockwait() of programs that are built for a glibc before 2.30, as those of the wheel are. Where they run, glibc is
 * usually newer, and its own function waits. Otherwise sem_timedwait() waits by CLOCK_REALTIME: if somebody sets that clock back
 * meanwhile, the wait lasts as much longer; if forward, no wait ends early.
 */
#define _GNU_SOURCE
#include <semaphore.h>

#if !__GLIBC_PREREQ(2, 30) || defined FCSL_TEST_SEM_CLOCKWAIT

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <time.h>

#include "fcsl/fcsl_monotonic.h"

static int wait_on_realtime(sem_t *semaphore, clockid_t clock, const struct timespec *until)
{
    for (;;) {
        struct timespec now, day;
        (void)clock_gettime(clock, &now);
        (void)clock_gettime(CLOCK_REALTIME, &day);
        day.tv_sec += until->tv_sec - now.tv_sec;
        day.tv_nsec += until->tv_nsec - now.tv_nsec;
        if (day.tv_nsec < 0) {
            day.tv_nsec += FCSL_NS_PER_S;
            day.tv_sec--;
        } else if (day.tv_nsec >= FCSL_NS_PER_S) {
            day.tv_nsec -= FCSL_NS_PER_S;
            day.tv_sec++;
        }
        if (sem_timedwait(semaphore, &day) == 0) {
            return 0;
        }
        (void)clock_gettime(clock, &now);
        if (errno != ETIMEDOUT || now.tv_sec > until->tv_sec ||
            (now.tv_sec == until->tv_sec && now.tv_nsec >= until->tv_nsec)) {
            return -1;
        }
    }
}

#ifndef FCSL_TEST_SEM_CLOCKWAIT

static int (*system_wait)(sem_t *semaphore, clockid_t clock, const struct timespec *until);

static void find_system_wait(void)
{
    *(void **)&system_wait = dlsym(RTLD_DEFAULT, "sem_clockwait");
}

/* Hidden, so that no other library finds this one in place of the system's. */
__attribute__((visibility("hidden"))) int sem_clockwait(sem_t *semaphore, clockid_t clock, const struct timespec *until)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    (void)pthread_once(&once, find_system_wait);
    return (system_wait != NULL ? system_wait : wait_on_realtime)(semaphore, clock, until);
}

#endif
#else
typedef int sem_clockwait_is_of_the_system; /* a file of C is not empty */
#endif
