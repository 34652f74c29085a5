/* SPDX-License-Identifier: Apache-2.0
 *
 * What telemetry sends: the chosen channels, where their values lie in a publication, and the configuration that tells it.
 */
#ifndef FCSL_TELEMETRY_CHANNELS_H
#define FCSL_TELEMETRY_CHANNELS_H

#include "configuration.h"

/* Scalars of one type that lie one behind the other, in a publication and so in a packet. */
typedef struct {
    size_t at; /* in a publication */
    uint32_t count;
    uint8_t type;
} piece_t;

typedef struct {
    piece_t *pieces;
    uint32_t piece_count;
    uint32_t data_bytes; /* of a data packet's body */
    uint8_t *configuration;
    uint32_t configuration_bytes;
} channels_t;

/* What stands before the values in a data packet. */
typedef struct {
    uint64_t tick; /* that left the values */
    uint64_t time_ns;
    uint64_t overwritten;
} data_head_t;

/* Chooses channels by `globs` (null: FCSL_TELEMETRY_FIELDS) and writes the configuration. 0, or -1; freed in either case by
 * fcsl_channels_close. */
int fcsl_channels_open(channels_t *channels, const catalog_t *catalog, const char *globs,
                       const announcement_t *announcement, fcsl_error_t *error);
void fcsl_channels_close(channels_t *channels);

/* Writes the body of a data packet. */
void fcsl_channels_pack(const channels_t *channels, const data_head_t *head, const uint8_t *publication, uint8_t *body);

#endif /* FCSL_TELEMETRY_CHANNELS_H */
