/* SPDX-License-Identifier: Apache-2.0
 *
 * A stream of MAVLink frames, for program parts that have included MAVLink's generated headers and defined take().
 */
#ifndef BENCH_MAVLINK_DECODE_H
#define BENCH_MAVLINK_DECODE_H

static size_t decode(direction_t direction, const uint8_t *bytes, size_t size, values_t *values, int *accepted)
{
    static mavlink_message_t message;
    mavlink_status_t status;
    for (size_t i = 0; i < size; i++) {
        if (mavlink_parse_char(MAVLINK_COMM_1, bytes[i], &message, &status) && take(direction, &message, values)) {
            *accepted = 1;
            return i + 1;
        }
    }
    *accepted = 0;
    return size;
}

static void reset(void)
{
    mavlink_reset_channel_status(MAVLINK_COMM_1);
}

#endif /* BENCH_MAVLINK_DECODE_H */
