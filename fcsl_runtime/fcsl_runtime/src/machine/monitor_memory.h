/* SPDX-License-Identifier: Apache-2.0
 *
 * What the requirements of a machine remember, as bytes that follow its struct in checkpoints and records: source_hash and
 * layout_hash of the monitor (64 bytes each), the bytes of its struct (u32), its struct with canonical NaNs.
 */
#ifndef FCSL_MONITOR_MEMORY_H
#define FCSL_MONITOR_MEMORY_H

#include <stddef.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monitor.h"

/* 0 without a monitor (null). */
size_t fcsl_monitor_memory_bytes(const fcsl_monitor_t *monitor);
/* `data`: the struct of the monitor. `out` has those bytes. */
void fcsl_monitor_memory_put(const fcsl_monitor_t *monitor, const uint8_t *data, uint8_t *out);
/* Where the monitor's struct is in `memory`; null for none (`size` 0), and for that of other requirements. 0, or -1: it is
 * damaged. */
int fcsl_monitor_memory_find(const fcsl_monitor_t *monitor, const uint8_t *memory, size_t size, const uint8_t **data,
                             fcsl_error_t *error);

#endif /* FCSL_MONITOR_MEMORY_H */
