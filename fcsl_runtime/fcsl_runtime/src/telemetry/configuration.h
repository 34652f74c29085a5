/* SPDX-License-Identifier: Apache-2.0
 *
 * The bytes of a configuration (docs/guide/monitoring.md, "Configuration").
 */
#ifndef FCSL_TELEMETRY_CONFIGURATION_H
#define FCSL_TELEMETRY_CONFIGURATION_H

#include "vars/catalog.h"

/* What a configuration says besides its channels. */
typedef struct {
    const fcsl_machine_t *machine;
    const char *views; /* at most FCSL_VIEWS_BYTES_MAX bytes, which is what a text can have */
    uint32_t every;
    int64_t wall_ns;
} announcement_t;

/* Writes the configuration of the chosen entries (chosen[i] of entry i), or with null `bytes` only counts its bytes. Returns
 * them, or 0 when a text is too long, or its labels too many, for the 16 bits that count them. */
size_t fcsl_configuration_write(const announcement_t *announcement, uint32_t data_bytes, const catalog_t *catalog,
                                const uint8_t *chosen, uint8_t *bytes);

#endif /* FCSL_TELEMETRY_CONFIGURATION_H */
