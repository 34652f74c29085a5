/* SPDX-License-Identifier: Apache-2.0
 *
 * What reproduces the run elsewhere: a checkpoint for who asks, and the host's writes for who subscribes to them.
 */
#ifndef FCSL_OBSERVERS_REPRODUCTION_H
#define FCSL_OBSERVERS_REPRODUCTION_H

#include "fcsl/fcsl_history.h"
#include "fcsl/fcsl_write_queue.h"
#include "fcsl/fcsl_tick_publisher.h"

typedef struct {
    fcsl_write_queue_t *writes;
    uint8_t *message;     /* a write or a checkpoint, with its number */
    uint64_t answered_ns; /* when the checkpoint was last replaced */
} reproduction_t;

/* Returns 0, or -1 without memory. */
int reproduction_open(reproduction_t *reproduction, fcsl_write_queue_t *writes);
/* Accepts one that was not opened. */
void reproduction_close(reproduction_t *reproduction);

/* Bytes of the longest message, with its number. */
size_t reproduction_write_bytes(const reproduction_t *reproduction);

/* Puts the writes before a publication, and that these were all; nothing unless they are followed. Makes the publication the
 * checkpoint, if the one before is older than 20 ms. Returns 0, or -1: there was no room for all of the writes. */
int reproduction_put(reproduction_t *reproduction, fcsl_tick_publisher_t *publisher, const fcsl_moment_t *moment,
                     const uint8_t *publication);

#endif /* FCSL_OBSERVERS_REPRODUCTION_H */
