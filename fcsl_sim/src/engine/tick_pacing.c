/* SPDX-License-Identifier: Apache-2.0
 *
 * Pacing of a simulation by the clock. Tick k begins at the earliest (k - k0) periods of simulated time, divided by the
 * speed, after tick k0, which is the first tick, or the first one after a pause. Deadlines are absolute: the lateness of one
 * tick does not delay the next. The clock only decides when a tick runs: results are the same at every speed.
 */
#define _GNU_SOURCE
#include "tick_pacing.h"

#include <math.h>
#include <time.h>

#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"

/* Longest wait before fcsl_sim_run returns to its caller. */
static const double SLICE_NS = 50e6;
static const double FORGIVEN_NS = 100e6;

int fcsl_sim_set_speed(fcsl_sim_t *sim, double speed, fcsl_error_t *error)
{
    if (!isfinite(speed) || speed < 0) {
        return fcsl_fail(error, "a speed of %g: write simulated seconds per second, or 0 for as fast as possible",
                         speed);
    }
    sim->pace.speed = speed;
    fcsl_sim_pace_anew(sim);
    return 0;
}

void fcsl_sim_pace_anew(fcsl_sim_t *sim)
{
    sim->pace.anchored = 0;
}

/* Time until the next tick is due, at the pace that is kept: negative when it is late. Doubles cannot overflow, and are exact for a
 * hundred days. */
static double left_ns(const fcsl_sim_t *sim, uint64_t now)
{
    const fcsl_pace_t *pace = &sim->pace;
    const int64_t simulated_ns = fcsl_grid_time_ns(sim->tick - pace->from_tick, sim->machine->tick_hz);
    return (double)simulated_ns / pace->speed - (double)(now - pace->from_ns);
}

void fcsl_sim_forgive(fcsl_sim_t *sim)
{
    const fcsl_pace_t *pace = &sim->pace;
    if (pace->anchored && pace->speed > 0 && left_ns(sim, fcsl_monotonic_ns()) < -FORGIVEN_NS) {
        fcsl_sim_pace_anew(sim);
    }
}

uint64_t fcsl_sim_wait_until(fcsl_sim_t *sim)
{
    fcsl_pace_t *pace = &sim->pace;
    const int paused = pace->paused;
    if (!paused && !(pace->speed > 0)) {
        return 0;
    }
    const uint64_t now = fcsl_monotonic_ns();
    if (paused) {
        return now + (uint64_t)SLICE_NS;
    }
    if (!pace->anchored) {
        *pace = (fcsl_pace_t){.speed = pace->speed, .anchored = 1, .from_ns = now, .from_tick = sim->tick};
    }
    const double left = left_ns(sim, now);
    return left > 0 ? now + (uint64_t)fmin(ceil(left), SLICE_NS) : 0;
}

void fcsl_sim_sleep_until(uint64_t deadline_ns)
{
    const struct timespec until = {.tv_sec = (time_t)(deadline_ns / FCSL_NS_PER_S),
                                   .tv_nsec = (long)(deadline_ns % FCSL_NS_PER_S)};
    (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL); /* a signal ends it; the caller handles that */
}
