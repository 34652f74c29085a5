/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulation's values as UDP (fcsl_telemetry.h). The sender's thread reads the published data; no tick waits for it.
 */
#include "fcsl/fcsl_error.h"
#include "publish.h"

int fcsl_sim_telemetry(fcsl_sim_t *sim, const char *address, const char *fields, fcsl_error_t *error)
{
    if (sim->telemetry || sim->service || sim->tick || sim->sensed) {
        return fcsl_fail(error, "telemetry begins before variables are served and before the first tick");
    }
    if (fcsl_sim_publish_begin(sim, error)) {
        return -1;
    }
    const struct fcsl_sim_published *published = sim->published;
    const fcsl_telemetry_options_t options = {
        .address = address, .fields = fields, .machine = sim->machine, .views = fcsl_run_views(sim->run)};
    sim->telemetry = fcsl_telemetry_open(&options, published->blocks, published->count, &published->history, error);
    return sim->telemetry ? fcsl_telemetry_start(sim->telemetry, error) : -1;
}

void fcsl_sim_telemetry_stop(fcsl_sim_t *sim, fcsl_telemetry_counters_t *counters)
{
    *counters = (fcsl_telemetry_counters_t){0};
    if (sim->telemetry) {
        fcsl_telemetry_stop(sim->telemetry);
        fcsl_telemetry_count(sim->telemetry, counters);
    }
}
