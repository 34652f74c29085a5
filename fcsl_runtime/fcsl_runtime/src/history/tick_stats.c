/* SPDX-License-Identifier: Apache-2.0
 *
 * Sums of the fault and overrun counters of all instances.
 */
#include "fcsl/fcsl_tick_stats.h"

#include <string.h>

void fcsl_tick_stats_faults(const fcsl_machine_t *machine, const uint8_t *data, uint64_t *faults, uint64_t *overruns)
{
    *faults = 0;
    *overruns = 0;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        uint64_t count = 0;
        memcpy(&count, data + machine->instances[i].faults_offset, sizeof count);
        *faults += count;
        memcpy(&count, data + machine->instances[i].overruns_offset, sizeof count);
        *overruns += count;
    }
}
