/* SPDX-License-Identifier: Apache-2.0
 *
 * The bytes of a checkpoint, as docs/guide/recording.md specifies them.
 */
#ifndef FCSL_CHECKPOINT_H
#define FCSL_CHECKPOINT_H

#include <sys/types.h>

#include "fcsl/fcsl_monitor.h"
#include "fcsl/fcsl_run.h"

/* What a checkpoint that is right for a machine holds; both point into its bytes. */
typedef struct {
    uint64_t tick;
    const uint8_t *data;     /* as fcsl_run_restore takes it: the machine struct, the memory of its requirements */
    uint32_t size;           /* of `data` */
    const uint8_t *hardware; /* entries of the simulated hardware */
    uint32_t entries;
} fcsl_checkpoint_t;

/* Room for the memory of other requirements in a checkpoint that is read. */
enum { FCSL_OTHER_MEMORY_BYTES = 1 << 18 };

/* Bytes of the largest checkpoint of this machine. Here and below, `monitor` is null without requirements. */
size_t fcsl_checkpoint_capacity(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor);
/* Writes the checkpoint of a machine struct, of the monitor's struct, and of what the machine's hw_* builtins reach; returns its
 * bytes, at most the capacity. */
size_t fcsl_checkpoint_encode(const fcsl_machine_t *machine, const uint8_t *data, const fcsl_monitor_t *monitor,
                              const uint8_t *remembered, const fcsl_hw_sim_t *hardware, uint8_t *out);
/* The hardware that its entries tell of. */
void fcsl_checkpoint_hardware(const fcsl_checkpoint_t *checkpoint, fcsl_hw_sim_t *hardware);
/* Any bytes are a checkpoint of this machine or give a reason why not. The machine struct may still hold values that the machine
 * cannot have: fcsl_run_restore checks those. Memory of other requirements is left out. */
int fcsl_checkpoint_decode(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor, const uint8_t *bytes,
                           size_t size, int ignore_source_hash, fcsl_checkpoint_t *checkpoint, fcsl_error_t *error);
/* Reads a regular file (FIFOs and devices are refused) of at most `capacity` bytes; of a longer one that many. `links`: 0
 * refuses a symbolic link. Returns the bytes, or -1 with `error`. */
ssize_t fcsl_checkpoint_read(const char *path, int links, uint8_t *bytes, size_t capacity, fcsl_error_t *error);

#endif /* FCSL_CHECKPOINT_H */
