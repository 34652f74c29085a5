/* SPDX-License-Identifier: Apache-2.0
 *
 * What reproduces a run, as fcsl_msgs messages: a checkpoint, and what the host did. Recorder and write queue make them.
 */
#ifndef FCSL_RECORD_MESSAGES_H
#define FCSL_RECORD_MESSAGES_H

#include "fcsl/fcsl_monitor.h"
#include "tick_messages.h"

/* One host write, as fcsl_msgs/HostWrite has it. */
typedef struct {
    fcsl_write_kind_t kind;
    const char *path; /* of the descriptor, or a literal: it is read later */
    uint32_t element;
    const uint8_t *data; /* little-endian */
    uint32_t size;
    uint32_t age_ticks; /* of a sample, which may have a stamp */
    int64_t stamp_ns;
} fcsl_write_t;

/* Both return the bytes of the message, or 0: it does not fit. */
size_t fcsl_write_message(const fcsl_write_t *write, fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity);
/* `data`: the machine struct; `remembered`: that of the monitor. Null monitor: nothing of requirements. */
size_t fcsl_checkpoint_message(const fcsl_machine_t *machine, const uint8_t *data, const fcsl_monitor_t *monitor,
                               const uint8_t *remembered, fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity);

#endif /* FCSL_RECORD_MESSAGES_H */
