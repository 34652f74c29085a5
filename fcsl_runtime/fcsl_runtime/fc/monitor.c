/* SPDX-License-Identifier: Apache-2.0
 *
 * The monitor thread: signals, watchdog, log of faults, of events, of a failed recording and of the HAL.
 */
#define _GNU_SOURCE
#include "monitor.h"

#include <inttypes.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"
#include "guard_link.h"
#include "log.h"

static const uint64_t MILLISECOND_NS = 1000000u;
/* A step thread that has not ended this long after a signal is stuck. */
static const uint64_t TIMEOUT_NS = 3000000000u;
enum { POLL_MS = 100, POLLS_PER_LIMIT = 4, TEXT_BYTES = 256, PIPE_BYTES = 65536 };

/* A stuck step is found a quarter of the limit late at most. */
static uint64_t period_of(const watchdog_t *watchdog)
{
    const uint64_t most = POLL_MS * MILLISECOND_NS;
    const uint64_t wanted = watchdog->limit_ns / POLLS_PER_LIMIT;
    return watchdog->limit_ns == 0 || wanted > most ? most : wanted;
}

/* What the step thread has to say: a full ring, and how many lines it had no room for. */
static void print_log(const monitor_t *monitor)
{
    char text[FCSL_LOG_BYTES];
    const fcsl_hal_t *hal = &monitor->loop->hal;
    for (int i = 0; i < FCSL_LOG_LINES + 1 && fcsl_log_read(hal->log, text); i++) {
        log_info("%s", text);
    }
}

static void check(monitor_t *monitor, uint64_t now)
{
    char text[TEXT_BYTES];
    print_log(monitor);
    fcsl_tick_stats_t *stats = &monitor->loop->stats;
    if (watchdog_finds(&monitor->watchdog, fcsl_tick_stats_get(&stats->begun_ns), now)) {
        watchdog_describe(monitor->loop, now, text, sizeof text);
        fcsl_tick_stats_put(&stats->watchdog_trips, fcsl_tick_stats_get(&stats->watchdog_trips) + 1u);
        log_error("watchdog (%" PRIu64 " ms): %s", monitor->watchdog.limit_ns / MILLISECOND_NS, text);
    }
    const int failed = atomic_load_explicit(&monitor->loop->record_failed, memory_order_acquire);
    if (atomic_load_explicit(&monitor->loop->record_logged, memory_order_relaxed) != failed) {
        log_error("tick %" PRIu64 ": %s", fcsl_tick_stats_get(&stats->tick), monitor->loop->record_failure);
        atomic_store_explicit(&monitor->loop->record_logged, failed, memory_order_release);
    }
    event_log_update(&monitor->events, monitor->loop->run);
    fault_log_update(&monitor->faults);
    guard_link_check(monitor->loop);
}

/* Whoever started the program holds the other end of a pipe, which the system closes when they die. What they write says
 * nothing; all that a pipe holds is taken at once, since its end comes behind it. */
static int stdin_closed(const monitor_t *monitor)
{
    char bytes[PIPE_BYTES];
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    return monitor->exit_on_stdin_eof && poll(&input, 1, 0) > 0 && read(STDIN_FILENO, bytes, sizeof bytes) <= 0;
}

/* A HAL that waits for its peer is woken, and so is a paused loop. */
static void stop(monitor_t *monitor)
{
    loop_t *loop = monitor->loop;
    atomic_store(loop->stop, 1);
    loop->hal.interrupt(loop->hal.ctx);
    if (loop->vars != NULL) {
        fcsl_vars_wake(loop->vars);
    }
}

static void *run_monitor(void *argument)
{
    monitor_t *monitor = argument;
    const uint64_t period = period_of(&monitor->watchdog);
    const struct timespec wait = {.tv_nsec = (long)period};
    uint64_t give_up = UINT64_MAX;
    for (;;) {
        const int number = sigtimedwait(&monitor->signals, NULL, &wait);
        const uint64_t now = fcsl_monotonic_ns();
        if (atomic_load(&monitor->loop_over)) {
            print_log(monitor); /* the last ticks */
            event_log_update(&monitor->events, monitor->loop->run);
            fault_log_update(&monitor->faults);
            return NULL;
        }
        if ((number > 0 || stdin_closed(monitor)) && give_up == UINT64_MAX) {
            stop(monitor);
            give_up = now + TIMEOUT_NS;
        }
        check(monitor, now);
        if (now > give_up) {
            char text[TEXT_BYTES];
            watchdog_describe(monitor->loop, now, text, sizeof text);
            monitor->abandon(monitor->ctx, text);
        }
    }
}

void monitor_block_signals(monitor_t *monitor)
{
    (void)sigemptyset(&monitor->signals);
    (void)sigaddset(&monitor->signals, SIGINT);
    (void)sigaddset(&monitor->signals, SIGTERM);
    /* The terminal is gone; whom nohup started flies on. */
    struct sigaction hangup;
    if (sigaction(SIGHUP, NULL, &hangup) == 0 && hangup.sa_handler != SIG_IGN) {
        (void)sigaddset(&monitor->signals, SIGHUP);
    }
    (void)pthread_sigmask(SIG_BLOCK, &monitor->signals, NULL);
}

void monitor_let_signals(const monitor_t *monitor)
{
    (void)pthread_sigmask(SIG_UNBLOCK, &monitor->signals, NULL);
}

int monitor_start(monitor_t *monitor)
{
    monitor->started = fault_log_open(&monitor->faults, monitor->loop) == 0 &&
                       pthread_create(&monitor->thread, NULL, run_monitor, monitor) == 0;
    return monitor->started ? 0 : -1;
}

void monitor_end(monitor_t *monitor)
{
    if (monitor->started) {
        atomic_store(&monitor->loop_over, 1);
        (void)pthread_kill(monitor->thread, SIGTERM);
        (void)pthread_join(monitor->thread, NULL);
        monitor->started = 0;
    }
    fault_log_close(&monitor->faults);
}
