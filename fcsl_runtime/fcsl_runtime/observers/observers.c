/* SPDX-License-Identifier: Apache-2.0
 *
 * Observers' library interface: the mirror of the machine's channels, fed with every tick.
 */
#include "fcsl/fcsl_observers.h"

#include <stdlib.h>

#include "base/error.h"
#include "descriptor.h"
#include "fcsl/fcsl_mirror.h"
#include "follower.h"
#include "run/tick_time.h"

struct fcsl_observers {
    follower_t follower;
    fcsl_mirror_t *mirror;
    uint64_t tick_hz;
};

static int is_watched(void *ctx)
{
    return fcsl_mirror_watched(((const fcsl_observers_t *)ctx)->mirror);
}

static void pass_over(void *ctx)
{
    fcsl_mirror_begin(((fcsl_observers_t *)ctx)->mirror);
}

static int is_ready(void *ctx)
{
    return fcsl_mirror_ready(((fcsl_observers_t *)ctx)->mirror);
}

static int put(void *ctx, const followed_tick_t *tick)
{
    const fcsl_observers_t *o = ctx;
    return fcsl_mirror_post(o->mirror, tick->publication, tick->number, fcsl_tick_time_ns(o->tick_hz, tick->number));
}

static int listen_on(fcsl_observers_t *o, const fcsl_observers_options_t *options, fcsl_error_t *error)
{
    char reason[256];
    char *descriptor = fcsl_observers_descriptor(options->machine, error);
    if (descriptor == NULL) {
        return -1;
    }
    const fcsl_mirror_options_t mirror = {
        .endpoint = options->endpoint, .name_space = options->name_space, .descriptor = descriptor};
    const int failed = fcsl_mirror_open(&mirror, options->machine, &o->mirror, reason, sizeof reason);
    free(descriptor);
    return failed ? fcsl_fail(error, "no observers: %s", reason) : 0;
}

fcsl_observers_t *fcsl_observers_open(const fcsl_observers_options_t *options, const fcsl_history_t *history,
                                      fcsl_error_t *error)
{
    fcsl_observers_t *o = calloc(1, sizeof *o);
    if (o == NULL) {
        (void)fcsl_fail(error, "out of memory for observers");
        return NULL;
    }
    const follower_sink_t sink = {.ctx = o, .wants = is_watched, .pass_over = pass_over, .ready = is_ready, .put = put};
    o->tick_hz = options->machine->tick_hz;
    if (follower_open(&o->follower, history, o->tick_hz, &sink) != 0) {
        (void)fcsl_fail(error, "out of memory for observers");
    } else if (listen_on(o, options, error) == 0) {
        return o;
    }
    fcsl_observers_close(o);
    return NULL;
}

int fcsl_observers_start(fcsl_observers_t *observers, fcsl_error_t *error)
{
    return follower_start(&observers->follower, error);
}

void fcsl_observers_stop(fcsl_observers_t *observers)
{
    if (observers != NULL) {
        follower_stop(&observers->follower);
    }
}

void fcsl_observers_close(fcsl_observers_t *observers)
{
    if (observers == NULL) {
        return;
    }
    follower_close(&observers->follower);
    fcsl_mirror_close(observers->mirror);
    free(observers);
}

void fcsl_observers_count(const fcsl_observers_t *observers, fcsl_observers_counters_t *counters)
{
    *counters = (fcsl_observers_counters_t){.ticks = follower_ticks(&observers->follower),
                                            .dropped = follower_dropped(&observers->follower)};
}

void fcsl_observers_stats(const fcsl_observers_t *observers, fcsl_vars_out_t *out)
{
    fcsl_observers_counters_t counters;
    fcsl_observers_count(observers, &counters);
    fcsl_vars_begin(out, "observers");
    fcsl_vars_number(out, "ticks", counters.ticks);
    fcsl_vars_number(out, "dropped", counters.dropped);
    fcsl_vars_end(out);
}
