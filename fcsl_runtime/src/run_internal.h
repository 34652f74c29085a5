/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_RUN_INTERNAL_H
#define FCSL_RUN_INTERNAL_H

#include <string.h>

#include "error.h"
#include "message.h"

typedef struct fcsl_recorder fcsl_recorder_t;

/* What an instance's overrun verdict was before a tick, to tell a measured overrun from an injected one. */
typedef struct {
    uint64_t overruns;
    uint8_t injected;
} fcsl_verdict_t;

struct fcsl_run {
    void *library;
    const fcsl_machine_t *machine;
    uint8_t *data;
    uint8_t *staging; /* the struct's size: a checked copy before it replaces data */
    fcsl_host_t host;
    fcsl_layout_t *layouts;   /* per instance */
    fcsl_verdict_t *verdicts; /* per instance */
    uint64_t frames_refused;
    fcsl_recorder_t *recorder; /* null: not recording */
};

static inline int32_t fcsl_read_i32(const uint8_t *data, uint32_t offset)
{
    int32_t value = 0;
    memcpy(&value, data + offset, sizeof value);
    return value;
}

static inline uint64_t fcsl_read_u64(const uint8_t *data, uint32_t offset)
{
    uint64_t value = 0;
    memcpy(&value, data + offset, sizeof value);
    return value;
}

/* Copies the struct with canonical NaNs in every float field: what leaves the process does not depend on the processor. */
void fcsl_copy_canonical(const fcsl_machine_t *machine, uint8_t *out, const uint8_t *in);

#endif /* FCSL_RUN_INTERNAL_H */
