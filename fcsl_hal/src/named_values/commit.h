/* SPDX-License-Identifier: Apache-2.0
 *
 * The commit of a tick (docs/reference/transports.md): says that the values of the tick were put, and which channels have one.
 *
 *   offset size
 *   0      8   tick
 *   8      8   simulated time in ns; of a controller 0
 *   16     4   channel-table hash
 *   20     1   direction: 0 sensors, 1 actuators, 2 reports
 *   21     1   1: the actuators are armed; of others 0
 *   22     2   channels in the table
 *   24     n   a bit for each channel of the table, the first one the lowest of the first byte: it has a value
 */
#ifndef FCSL_COMMIT_H
#define FCSL_COMMIT_H

#include "fcsl/fcsl_scalar.h"

enum { COMMIT_HEAD_BYTES = 24 };

typedef struct {
    uint64_t tick;
    uint64_t time_ns;
    uint32_t table_hash;
    uint8_t direction; /* fcsl_direction_t */
    uint8_t armed;
    uint16_t channels;
} commit_t;

static inline size_t commit_bytes(uint32_t channels)
{
    return COMMIT_HEAD_BYTES + ((size_t)channels + 7u) / 8u;
}

/* Whether the bytes may be a commit of this direction for this table; `what`: the table's hash, above it the direction. */
static inline int commit_fits(uint64_t what, const uint8_t *bytes, size_t size)
{
    return size >= COMMIT_HEAD_BYTES && fcsl_get_u32(bytes + 16) == (uint32_t)what && bytes[20] == what >> 32;
}

/* `fresh`: a byte for each channel. */
static inline void commit_write(const commit_t *commit, const uint8_t *fresh, uint8_t *bytes)
{
    memset(bytes, 0, commit_bytes(commit->channels));
    fcsl_put_u64(bytes, commit->tick);
    fcsl_put_u64(bytes + 8, commit->time_ns);
    fcsl_put_u32(bytes + 16, commit->table_hash);
    bytes[20] = commit->direction;
    bytes[21] = commit->armed;
    fcsl_put_u16(bytes + 22, commit->channels);
    for (uint32_t i = 0; i < commit->channels; i++) {
        bytes[COMMIT_HEAD_BYTES + i / 8u] |= (uint8_t)((fresh[i] != 0u) << i % 8u);
    }
}

/* Returns 0, or -1 where the bytes are no commit of so many channels. */
static inline int commit_read(const uint8_t *bytes, size_t size, uint32_t channels, commit_t *commit, uint8_t *fresh)
{
    if (size != commit_bytes(channels) || fcsl_get_u16(bytes + 22) != channels || bytes[20] > FCSL_REPORT ||
        bytes[21] > 1u) {
        return -1;
    }
    *commit = (commit_t){.tick = fcsl_get_u64(bytes),
                         .time_ns = fcsl_get_u64(bytes + 8),
                         .table_hash = fcsl_get_u32(bytes + 16),
                         .direction = bytes[20],
                         .armed = bytes[21],
                         .channels = (uint16_t)channels};
    for (uint32_t i = 0; i < channels; i++) {
        fresh[i] = (bytes[COMMIT_HEAD_BYTES + i / 8u] >> i % 8u) & 1u;
    }
    return 0;
}

#endif /* FCSL_COMMIT_H */
