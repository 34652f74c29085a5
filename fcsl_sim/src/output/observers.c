/* SPDX-License-Identifier: Apache-2.0
 *
 * The hosted machine's channels on a bus of their own (fcsl_observers.h). Its thread reads the published data; no tick waits
 * for it.
 */
#include "fcsl/fcsl_error.h"
#include "publish.h"

int fcsl_sim_observers(fcsl_sim_t *sim, const char *endpoint, const char *name_space, fcsl_error_t *error)
{
    if (sim->external) {
        return fcsl_fail(error, "with an external controller its channels are there: give `--observers` to it");
    }
    if (sim->observers || sim->service || sim->tick || sim->sensed) {
        return fcsl_fail(error, "observers come before variables are served and before the first tick");
    }
    if (fcsl_sim_publish_begin(sim, error)) {
        return -1;
    }
    const fcsl_observers_options_t options = {.endpoint = endpoint, .name_space = name_space, .run = sim->run};
    sim->observers = fcsl_observers_open(&options, &sim->published->history, error);
    return sim->observers ? fcsl_observers_start(sim->observers, error) : -1;
}

void fcsl_sim_observers_stop(fcsl_sim_t *sim, fcsl_observers_counters_t *counters)
{
    *counters = (fcsl_observers_counters_t){0};
    if (sim->observers) {
        fcsl_observers_stop(sim->observers);
        fcsl_observers_count(sim->observers, counters);
    }
}
