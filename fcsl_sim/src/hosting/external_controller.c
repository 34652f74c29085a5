/* SPDX-License-Identifier: Apache-2.0
 *
 * A controller in another process: how it connects, and how it is told that the simulation waits or ends.
 */
#include "external_controller.h"

#include <string.h>

#include "fcsl/fcsl_external.h"
#include "fcsl/fcsl_error.h"

int fcsl_sim_external_failed(const fcsl_sim_t *sim, fcsl_hal_status_t status, const char *doing, fcsl_error_t *error)
{
    const unsigned long long tick = sim->tick;
    if (status == FCSL_HAL_NONE) {
        return fcsl_fail(error, "interrupted at tick %llu", tick);
    }
    return fcsl_fail(error, "tick %llu: %s: %s", tick, doing, fcsl_external_explain(sim->external));
}

int fcsl_sim_listen(fcsl_sim_t *sim, const char *peer, const char *name_space, uint32_t timeout_ms, fcsl_error_t *error)
{
    static const char WIRE[] = "wire:";
    const size_t prefix = sizeof WIRE - 1u;
    if (sim->external || sim->tick || sim->sensed || sim->recording) {
        return fcsl_fail(error, "a controller must connect before the first tick, once, and records itself");
    }
    if (sim->reads_fields || sim->write_count > 0) {
        return fcsl_fail(error,
                         "fields of the machine are connected: only channels reach a controller in another process");
    }
    const int failed = strncmp(peer, WIRE, prefix) == 0
                           ? fcsl_external_open(peer + prefix, sim->machine, &sim->external, error)
                           : fcsl_external_open_bus(peer, name_space, sim->machine, &sim->external, error);
    if (failed) {
        sim->external = NULL;
        return -1;
    }
    sim->external_timeout_ms = timeout_ms;
    return 0;
}

int fcsl_sim_accept(fcsl_sim_t *sim, uint32_t wait_ms, fcsl_error_t *error)
{
    if (!sim->external || sim->tick) {
        return fcsl_fail(error, "nothing listens for a controller, or it has connected already");
    }
    if (fcsl_external_runs_free(sim->external)) {
        return 0;
    }
    const fcsl_hal_status_t status = fcsl_external_accept(sim->external, wait_ms);
    if (status == FCSL_HAL_OK) {
        return 0;
    }
    if (status == FCSL_HAL_NONE) {
        return fcsl_fail(error, "interrupted while waiting for a controller");
    }
    (void)fcsl_fail(error, "%s", fcsl_external_explain(sim->external));
    return status == FCSL_HAL_TIMEOUT ? 1 : -1;
}

int fcsl_sim_read_log(fcsl_sim_t *sim, char text[FCSL_LOG_BYTES])
{
    return sim->external && fcsl_external_read_log(sim->external, text);
}

void fcsl_sim_count_commands(const fcsl_sim_t *sim, fcsl_external_counters_t *counters)
{
    *counters = sim->external ? fcsl_external_counters(sim->external) : (fcsl_external_counters_t){0};
}

void fcsl_sim_keep_alive(fcsl_sim_t *sim)
{
    if (sim->external && sim->status == FCSL_SIM_RUNNING) {
        fcsl_external_keep_alive(sim->external);
    }
}

void fcsl_sim_end(fcsl_sim_t *sim, int another_follows)
{
    if (sim->external) {
        fcsl_external_end(sim->external, another_follows);
    }
}
