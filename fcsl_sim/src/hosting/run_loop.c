/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks in a row, with commands of clients between them.
 */
#include "exchange.h"
#include "variable_server.h"

int64_t fcsl_sim_run(fcsl_sim_t *sim, uint64_t ticks, fcsl_error_t *error)
{
    int64_t done = 0;
    while ((uint64_t)done < ticks && sim->status == FCSL_SIM_RUNNING) {
        const int32_t state = fcsl_sim_state(sim);
        const int goes_on = fcsl_sim_serve_clients(sim);
        if (sim->service_failed) {
            *error = sim->failure;
            return -1;
        }
        if (!goes_on) {
            break;
        }
        if (fcsl_sim_tick_once(sim, error)) {
            return -1;
        }
        done++;
        if (fcsl_sim_state(sim) != state) {
            break;
        }
    }
    return done;
}
