/* SPDX-License-Identifier: Apache-2.0
 *
 * What lies under a channel's key on the bus (docs/reference/transports.md): its values as they are, or a ROS 2 message of them. The machine says
 * which.
 */
#ifndef FCSL_PAYLOAD_H
#define FCSL_PAYLOAD_H

#include <stddef.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_machine.h"
#include "fcsl/fcsl_ros.h"

typedef struct {
    const fcsl_machine_t *machine;
    fcsl_ros_composer_t **composers; /* of each channel; null where the values lie there as they are */
    fcsl_ros_reader_t **readers;
    uint8_t *row; /* the values of a message that was read */
} payload_t;

/* Returns 0, or -1 with `error` filled. */
int payload_open(payload_t *payload, const fcsl_machine_t *machine, fcsl_error_t *error);
void payload_close(payload_t *payload);

/* Bytes under a channel's key: that are put at most, that others may put at most, and at least. */
uint32_t payload_bytes(const fcsl_machine_t *machine, uint32_t channel);
uint32_t payload_most(const fcsl_machine_t *machine, uint32_t channel);
uint32_t payload_least(const fcsl_machine_t *machine, uint32_t channel);

/* Writes a channel's values in `data`, a struct of the machine, as they are put in a tick of this time. Returns 0, or -1 where its
 * message cannot hold them. */
int payload_write(const payload_t *payload, uint32_t channel, const uint8_t *data, int64_t time_ns, uint8_t *bytes,
                  uint32_t *size);

/* Reads what lies there into the channel's field of `data`. Returns 0, or -1 where it is no value of the channel. */
int payload_read(payload_t *payload, uint32_t channel, const uint8_t *bytes, size_t size, uint8_t *data);

#endif /* FCSL_PAYLOAD_H */
