/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "attendant.h"

#include <inttypes.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include "tell.h"

static const uint64_t MILLISECOND_NS = 1000000u;
/* A step thread that has not ended this long after a signal is stuck. */
static const uint64_t PATIENCE_NS = 3000000000u;
enum { LOOK_MS = 100, LOOKS_PER_LIMIT = 4, TEXT_BYTES = 256, PIPE_BYTES = 65536 };

/* A stuck step is found a quarter of the limit late at most. */
static uint64_t period_of(const watchdog_t *watchdog)
{
    const uint64_t most = LOOK_MS * MILLISECOND_NS;
    const uint64_t wanted = watchdog->limit_ns / LOOKS_PER_LIMIT;
    return watchdog->limit_ns == 0 || wanted > most ? most : wanted;
}

static void look(attendant_t *attendant, uint64_t now)
{
    char text[TEXT_BYTES];
    fcsl_tick_stats_t *stats = &attendant->loop->stats;
    if (watchdog_finds(&attendant->watchdog, fcsl_tick_stats_get(&stats->begun_ns), now)) {
        watchdog_describe(attendant->loop, now, text, sizeof text);
        fcsl_tick_stats_put(&stats->stuck, fcsl_tick_stats_get(&stats->stuck) + 1u);
        tell("watchdog (%" PRIu64 " ms): %s", attendant->watchdog.limit_ns / MILLISECOND_NS, text);
    }
    const int failed = atomic_load_explicit(&attendant->loop->record_failed, memory_order_acquire);
    if (atomic_load_explicit(&attendant->loop->record_told, memory_order_relaxed) != failed) {
        tell("tick %" PRIu64 ": %s", fcsl_tick_stats_get(&stats->tick), attendant->loop->record_failure);
        atomic_store_explicit(&attendant->loop->record_told, failed, memory_order_release);
    }
    fault_log_look(&attendant->faults);
}

/* Whoever started the program holds the other end of a pipe, which the system closes when they die. What they write says
 * nothing; all that a pipe holds is taken at once, since its end comes behind it. */
static int let_go(const attendant_t *attendant)
{
    char bytes[PIPE_BYTES];
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    return attendant->leash && poll(&input, 1, 0) > 0 && read(STDIN_FILENO, bytes, sizeof bytes) <= 0;
}

/* A HAL that waits for its peer is woken, and so is a paused loop. */
static void stop(attendant_t *attendant)
{
    loop_t *loop = attendant->loop;
    atomic_store(loop->stop, 1);
    loop->hal.interrupt(loop->hal.ctx);
    if (loop->vars != NULL) {
        fcsl_vars_wake(loop->vars);
    }
}

static void *attend(void *argument)
{
    attendant_t *attendant = argument;
    const uint64_t period = period_of(&attendant->watchdog);
    const struct timespec wait = {.tv_nsec = (long)period};
    uint64_t give_up = UINT64_MAX;
    for (;;) {
        const int number = sigtimedwait(&attendant->signals, NULL, &wait);
        const uint64_t now = fcsl_run_monotonic_ns(NULL);
        if (atomic_load(&attendant->loop_over)) {
            fault_log_look(&attendant->faults); /* the last ticks */
            return NULL;
        }
        if ((number > 0 || let_go(attendant)) && give_up == UINT64_MAX) {
            stop(attendant);
            give_up = now + PATIENCE_NS;
        }
        look(attendant, now);
        if (now > give_up) {
            char text[TEXT_BYTES];
            watchdog_describe(attendant->loop, now, text, sizeof text);
            attendant->abandon(attendant->ctx, text);
        }
    }
}

void attendant_block_signals(attendant_t *attendant)
{
    (void)sigemptyset(&attendant->signals);
    (void)sigaddset(&attendant->signals, SIGINT);
    (void)sigaddset(&attendant->signals, SIGTERM);
    /* The terminal is gone; whom nohup started flies on. */
    struct sigaction hangup;
    if (sigaction(SIGHUP, NULL, &hangup) == 0 && hangup.sa_handler != SIG_IGN) {
        (void)sigaddset(&attendant->signals, SIGHUP);
    }
    (void)pthread_sigmask(SIG_BLOCK, &attendant->signals, NULL);
}

void attendant_let_signals(const attendant_t *attendant)
{
    (void)pthread_sigmask(SIG_UNBLOCK, &attendant->signals, NULL);
}

int attendant_start(attendant_t *attendant)
{
    attendant->started = fault_log_open(&attendant->faults, attendant->loop) == 0 &&
                         pthread_create(&attendant->thread, NULL, attend, attendant) == 0;
    return attendant->started ? 0 : -1;
}

void attendant_end(attendant_t *attendant)
{
    if (attendant->started) {
        atomic_store(&attendant->loop_over, 1);
        (void)pthread_kill(attendant->thread, SIGTERM);
        (void)pthread_join(attendant->thread, NULL);
        attendant->started = 0;
    }
    fault_log_close(&attendant->faults);
}
