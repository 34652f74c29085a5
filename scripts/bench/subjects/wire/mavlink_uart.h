/* SPDX-License-Identifier: Apache-2.0
 *
 * What MAVLink's generated headers want of a program that sends with them: a system id, and a UART. This one is a buffer.
 * Included before them.
 */
#ifndef BENCH_MAVLINK_UART_H
#define BENCH_MAVLINK_UART_H

#include "wire.h"

#include <string.h>

#define MAVLINK_USE_CONVENIENCE_FUNCTIONS
#define MAVLINK_SEND_UART_BYTES(channel, bytes, size) uart_write((bytes), (size))

#include "mavlink_types.h"

static uint8_t *uart_bytes;
static size_t uart_count;
static mavlink_system_t mavlink_system = {1, 1};

static inline void uart_begin(uint8_t bytes[MESSAGE_MAX])
{
    uart_bytes = bytes;
    uart_count = 0;
}

static inline size_t uart_size(void)
{
    return uart_count;
}

static inline void uart_write(const uint8_t *bytes, size_t size)
{
    memcpy(uart_bytes + uart_count, bytes, size);
    uart_count += size;
}

#endif /* BENCH_MAVLINK_UART_H */
