/* SPDX-License-Identifier: Apache-2.0
 *
 * The thread that prints.
 */
#define _GNU_SOURCE
#include "printing.h"

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_log.h"
#include "fcsl/fcsl_monotonic.h"
#include "log.h"

enum { END_S = 1, INFO = 'i', ERROR = 'e' };

/* A process prints in one place. The first character of a line says whether it is an error. */
static fcsl_log_t lines;
static sem_t written; /* posted once per line, also for one that is dropped, and for the end */
static sem_t finished; /* posted by the thread: all is printed */
static atomic_int over;
static pthread_t thread;
static int started;

/* How many lines were dropped stands there without a first character of ours: it is an error. */
static void print_line(const char *text)
{
    if (text[0] == INFO) {
        log_info("%s", text + 1);
    } else {
        log_error("%s", text[0] == ERROR ? text + 1 : text);
    }
}

static void *print_lines(void *unused)
{
    (void)unused;
    char text[FCSL_LOG_BYTES];
    for (;;) {
        while (sem_wait(&written) != 0) {
        }
        const int ends = atomic_load(&over);
        if (fcsl_log_read(&lines, text)) {
            print_line(text);
        } else if (ends) {
            (void)sem_post(&finished);
            return NULL;
        }
    }
}

int printing_start(fcsl_error_t *error)
{
    sigset_t all;
    sigset_t before;
    (void)sigfillset(&all);
    if (sem_init(&written, 0, 0) != 0 || sem_init(&finished, 0, 0) != 0 ||
        pthread_sigmask(SIG_SETMASK, &all, &before) != 0) {
        return fcsl_fail(error, "cannot prepare the thread that prints");
    }
    /* Signals are for the thread that sleeps until the next period. */
    started = pthread_create(&thread, NULL, print_lines, NULL) == 0;
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    return started ? 0 : fcsl_fail(error, "cannot start the thread that prints");
}

void printing_end(void)
{
    if (!started) {
        return;
    }
    const struct timespec until = fcsl_timespec_of(fcsl_monotonic_ns() + END_S * (uint64_t)FCSL_NS_PER_S);
    atomic_store(&over, 1);
    (void)sem_post(&written);
    int waited = 0;
    do {
        waited = sem_clockwait(&finished, CLOCK_MONOTONIC, &until);
    } while (waited != 0 && errno == EINTR);
    /* A thread that still waits for the system ends with the process. */
    (void)(waited == 0 ? pthread_join(thread, NULL) : pthread_detach(thread));
    started = 0;
}

static void put_line(char kind, const char *format, va_list arguments)
{
    char text[FCSL_LOG_BYTES] = {kind};
    (void)vsnprintf(text + 1, sizeof text - 1u, format, arguments);
    fcsl_log_write(&lines, text);
    (void)sem_post(&written);
}

void print_info(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    put_line(INFO, format, arguments);
    va_end(arguments);
}

void print_error(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    put_line(ERROR, format, arguments);
    va_end(arguments);
}
