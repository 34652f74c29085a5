/* SPDX-License-Identifier: Apache-2.0
 *
 * The bytes of a checkpoint, as docs/guide/recording.md specifies them.
 */
#ifndef FCSL_CHECKPOINT_H
#define FCSL_CHECKPOINT_H

#include <sys/types.h>

#include "fcsl/fcsl_run.h"

/* What a checkpoint that is right for a machine holds; both point into its bytes. */
typedef struct {
    uint64_t tick;
    const uint8_t *data;     /* the machine struct */
    const uint8_t *hardware; /* entries of the simulated hardware */
    uint32_t entries;
} fcsl_checkpoint_t;

/* Bytes of the largest checkpoint of this machine. */
size_t fcsl_checkpoint_capacity(const fcsl_machine_t *machine);
/* Writes the checkpoint of a machine struct and of what its hw_* builtins reach; returns its bytes, at most the capacity. */
size_t fcsl_checkpoint_encode(const fcsl_machine_t *machine, const uint8_t *data, const fcsl_hw_sim_t *hardware,
                              uint8_t *out);
/* The hardware that its entries tell of. */
void fcsl_checkpoint_hardware(const fcsl_checkpoint_t *checkpoint, fcsl_hw_sim_t *hardware);
/* Any bytes are a checkpoint of this machine or give a reason why not. `data` may still hold values that the machine cannot
 * have: fcsl_run_restore looks at those. */
int fcsl_checkpoint_decode(const fcsl_machine_t *machine, const uint8_t *bytes, size_t size, int ignore_source_hash,
                           fcsl_checkpoint_t *checkpoint, fcsl_error_t *error);
/* Reads a regular file (FIFOs and devices are refused) of at most `capacity` bytes; of a longer one that many. `links`: 0
 * refuses a symbolic link. Returns the bytes, or -1 with `error`. */
ssize_t fcsl_checkpoint_read(const char *path, int links, uint8_t *bytes, size_t capacity, fcsl_error_t *error);

#endif /* FCSL_CHECKPOINT_H */
