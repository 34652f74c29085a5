/* SPDX-License-Identifier: Apache-2.0
 *
 * What the log says of faults: a line when an instance has faulted at another place than before, so that one that faults in every
 * tick does not fill the log.
 */
#ifndef FC_FAULT_LOG_H
#define FC_FAULT_LOG_H

#include "loop.h"

typedef struct {
    const loop_t *loop;
    uint8_t *bytes; /* a publication of the loop's history */
    uint64_t *faults; /* of each instance, by the last look */
    uint32_t *places;
} fault_log_t;

/* Before the first tick; what has faulted by then (a checkpoint says so) is not told. 0, or -1 without memory. */
int fault_log_open(fault_log_t *log, const loop_t *loop);
/* Tells what has happened since the last look. */
void fault_log_update(fault_log_t *log);
void fault_log_close(fault_log_t *log);

#endif /* FC_FAULT_LOG_H */
