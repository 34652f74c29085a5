/* SPDX-License-Identifier: Apache-2.0
 *
 * The channels of a joystick: what its input events make of them. Knows no device.
 */
#ifndef FCSL_EVDEV_STICKS_H
#define FCSL_EVDEV_STICKS_H

#include <linux/input.h>
#include <stdint.h>

enum { EVDEV_CHANNELS_MAX = 18 };

typedef struct {
    uint16_t type; /* EV_ABS or EV_KEY */
    uint16_t code;
    int32_t minimum; /* of an axis */
    int32_t maximum;
} evdev_channel_t;

typedef struct {
    evdev_channel_t channels[EVDEV_CHANNELS_MAX];
    uint32_t count;
    double pulse_us[EVDEV_CHANNELS_MAX]; /* 1000 to 2000; NaN: no such channel, or not told yet */
    int dropped; /* events were lost, and those up to the next report count for nothing */
} evdev_sticks_t;

typedef enum {
    EVDEV_NOTHING,
    EVDEV_REPORT, /* the channels belong to one moment now: that of this event */
    EVDEV_LOST /* the same, but events before were lost: set the channels from the state of the device */
} evdev_kind_t;

/* No channels. */
void evdev_clear(evdev_sticks_t *sticks);

/* The next channel. One for which there is no room is left out. */
void evdev_add(evdev_sticks_t *sticks, evdev_channel_t channel);

/* The channel of this type and code, if there is one, has a value now. */
void evdev_set(evdev_sticks_t *sticks, uint16_t type, uint16_t code, int32_t value);

evdev_kind_t evdev_take(evdev_sticks_t *sticks, const struct input_event *event);

#endif /* FCSL_EVDEV_STICKS_H */
