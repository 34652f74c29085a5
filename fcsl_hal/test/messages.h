/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages as bytes, for tests that send, damage and compare them.
 */
#ifndef TEST_MESSAGES_H
#define TEST_MESSAGES_H

#include "fcsl/fcsl_codec.h"

/* The bytes of the message, or 0 when `capacity` is too small. Actuators are armed and all there; the time is the tick's. */
static inline size_t encode_message(const fcsl_machine_t *machine, const void *data, fcsl_message_kind_t kind,
                                    uint64_t tick, const uint8_t *select, uint8_t *bytes, size_t capacity)
{
    const fcsl_channel_table_t table = fcsl_channel_table(machine);
    fcsl_message_t message = {0};
    fcsl_message_status_t status = FCSL_MESSAGE_KIND;
    if (kind == FCSL_SENSOR_MESSAGE) {
        status = fcsl_message_encode_sensors(&table, data, tick, select, bytes, capacity, &message);
    } else if (kind == FCSL_ACTUATOR_MESSAGE) {
        status = fcsl_message_encode_actuators(&table, data, tick, 1, bytes, capacity, &message);
    } else {
        status = fcsl_message_encode_time(&table, tick, 1000u * tick, bytes, capacity, &message);
    }
    return status == FCSL_MESSAGE_OK ? message.size : 0;
}

/* Checks the bytes, and puts what they say into `data`. */
static inline fcsl_message_status_t decode_message(const fcsl_machine_t *machine, void *data, fcsl_message_kind_t kind,
                                                   const uint8_t *bytes, size_t size, uint64_t *tick)
{
    const fcsl_channel_table_t table = fcsl_channel_table(machine);
    fcsl_message_t message;
    const fcsl_message_status_t status = fcsl_message_check(&table, kind, bytes, size, &message);
    if (status == FCSL_MESSAGE_OK) {
        fcsl_message_apply(machine, data, &message);
        *tick = message.tick;
    }
    return status;
}

#endif /* TEST_MESSAGES_H */
