/* SPDX-License-Identifier: Apache-2.0
 *
 * The ways on which the values of one tick travel in wire.c, each behind the same two functions.
 */
#ifndef BENCH_WIRE_H
#define BENCH_WIRE_H

#include <stddef.h>
#include <stdint.h>

/* IMU, attitude and motors of a quadcopter: what a sensor message and an actuator message carry. */
typedef struct {
    uint64_t tick;
    float accelerometer[3]; /* m/s^2 */
    float gyroscope[3];     /* rad/s */
    float attitude[4];      /* unit quaternion */
    float motors[4];        /* of full thrust */
    uint8_t armed;
} values_t;

typedef enum { SENSORS = 0, ACTUATORS = 1, DIRECTIONS = 2 } direction_t;

enum { MESSAGE_MAX = 512 }; /* bytes on the wire of one tick's message, in any format */

typedef struct {
    const char *name;
    int is_stream; /* its bytes may be cut anywhere; else they are whole messages */
    /* Writes one tick's values of a direction to `bytes`; returns their size. */
    size_t (*encode)(direction_t direction, const values_t *values, uint8_t bytes[MESSAGE_MAX]);
    /* Takes bytes up to the end of the first message that is accepted, and its values into *values. Returns how many bytes it
     * took; *accepted says whether there was a message. */
    size_t (*decode)(direction_t direction, const uint8_t *bytes, size_t size, values_t *values, int *accepted);
    /* Forgets what it has of a message. */
    void (*reset)(void);
} format_t;

extern const format_t FCSL_MESSAGE;     /* a message alone, as in a datagram */
extern const format_t FCSL_SERIAL;      /* in a frame of a `latest` port, COBS encoded */
extern const format_t MAVLINK_OWN;      /* MAVLink 2, one message of a dialect that has these fields */
extern const format_t MAVLINK_STANDARD; /* MAVLink 2, the messages of common.xml that hold these values */

#endif /* BENCH_WIRE_H */
