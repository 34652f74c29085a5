/* SPDX-License-Identifier: Apache-2.0
 *
 * Samples of chosen fields at a divided rate, in the order of ticks: JSON lines or binary frames (docs/reference/variables.md).
 */
#ifndef FCSL_VARS_SUBSCRIPTION_H
#define FCSL_VARS_SUBSCRIPTION_H

#include "catalog.h"
#include "json.h"

enum { FRAME_HEADER_BYTES = 32 };

typedef struct {
    uint32_t number; /* 0: free */
    int binary;
    uint64_t every;
    uint64_t due;  /* the coming tick of which a sample is sent */
    uint64_t lost; /* samples since the beginning */
    size_t bytes;  /* most of one sample */
    uint32_t count;
    target_t targets[SUBSCRIBED_MAX];
    char *paths; /* as the client wrote them, one after the other: SUBSCRIBED_MAX * PATH_BYTES_MAX */
} subscription_t;

/* Most bytes of one sample, of all paths and their targets. */
size_t fcsl_subscription_bytes(const subscription_t *subscription);

/* Sets `due` to the first tick behind `tick` that is wanted. */
void fcsl_subscription_begin(subscription_t *subscription, uint64_t tick);

/* Checks a publication: 1 when a sample of it is due. Counts those that were missed before it, where `overtaken`
 * publications were: ticks that a restore jumped over never were. */
int fcsl_subscription_due(subscription_t *subscription, uint64_t tick, uint64_t overtaken);

/* Writes the sample. */
void fcsl_subscription_write(const subscription_t *subscription, const fcsl_moment_t *moment, const uint8_t *snapshot,
                             json_out_t *out);

#endif /* FCSL_VARS_SUBSCRIPTION_H */
