/* SPDX-License-Identifier: Apache-2.0
 *
 * Logs an instance once for each place at which it faults.
 */
#include "fault_log.h"

#include <inttypes.h>
#include <stdlib.h>

#include "machine/fault_place.h"
#include "machine/machine_struct.h"
#include "log.h"

int fault_log_open(fault_log_t *log, const loop_t *loop)
{
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    const uint8_t *data = fcsl_run_data(loop->run);
    *log = (fault_log_t){.loop = loop,
                         .bytes = malloc(fcsl_history_bytes(&loop->history) + 1u),
                         .faults = calloc(machine->instance_count + 1u, sizeof *log->faults),
                         .places = calloc(machine->instance_count + 1u, sizeof *log->places)};
    if (log->bytes == NULL || log->faults == NULL || log->places == NULL) {
        return -1;
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        log->faults[i] = fcsl_read_u64(data, machine->instances[i].faults_offset);
    }
    return 0;
}

void fault_log_update(fault_log_t *log)
{
    const fcsl_machine_t *machine = fcsl_run_machine(log->loop->run);
    fcsl_moment_t moment;
    if (log->bytes == NULL || fcsl_history_latest(&log->loop->history, &moment, log->bytes) != FCSL_HISTORY_OK) {
        return;
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_instance_t *instance = &machine->instances[i];
        const uint64_t faults = fcsl_read_u64(log->bytes, instance->faults_offset);
        const uint32_t place = fcsl_read_u32(log->bytes, instance->fault_place_offset);
        char text[FCSL_FAULT_TEXT_MAX];
        if (faults > log->faults[i] && (place != log->places[i] || log->faults[i] == 0)) {
            log_error("'%s' faulted: %s (%" PRIu64 " by tick %" PRIu64 ")", instance->name,
                      fcsl_fault_text(machine, log->bytes, i, text), faults, moment.tick);
            log->places[i] = place;
        }
        log->faults[i] = faults;
    }
}

void fault_log_close(fault_log_t *log)
{
    free(log->bytes);
    free(log->faults);
    free(log->places);
    *log = (fault_log_t){0};
}
