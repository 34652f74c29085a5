/* SPDX-License-Identifier: Apache-2.0
 *
 * Runs ticks and copies parts of the structs of machines and models after each of them.
 */
#include <string.h>

#include "fcsl/fcsl_sim.h"

int fcsl_sim_run_traced(fcsl_sim_t *sim, uint64_t ticks, const fcsl_sim_part_t *parts, uint32_t count, uint8_t *rows,
                        uint64_t *done, fcsl_error_t *error)
{
    for (*done = 0; *done < ticks; ++*done) {
        const int64_t ran = fcsl_sim_run(sim, 1, error);
        if (ran <= 0) {
            return ran < 0 ? -1 : 0;
        }
        for (uint32_t i = 0; i < count; i++) {
            memcpy(rows, parts[i].data, parts[i].size);
            rows += parts[i].size;
        }
    }
    return 0;
}
