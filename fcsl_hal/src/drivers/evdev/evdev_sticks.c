/* SPDX-License-Identifier: Apache-2.0
 *
 * Scales axes and keys to pulses.
 */
#include "evdev_sticks.h"

#include <math.h>

static const double LOW_US = 1000.0;
static const double RANGE_US = 1000.0;

void evdev_clear(evdev_sticks_t *sticks)
{
    *sticks = (evdev_sticks_t){.count = 0};
    for (uint32_t i = 0; i < EVDEV_CHANNELS_MAX; i++) {
        sticks->pulse_us[i] = (double)NAN;
    }
}

void evdev_add(evdev_sticks_t *sticks, evdev_channel_t channel)
{
    if (sticks->count < EVDEV_CHANNELS_MAX) {
        sticks->channels[sticks->count++] = channel;
    }
}

/* NaN for an axis without a range. Doubles, because the difference of two int32_t may be none. */
static double pulse_of(const evdev_channel_t *channel, int32_t value)
{
    if (channel->type == EV_KEY) {
        return value != 0 ? LOW_US + RANGE_US : LOW_US;
    }
    const double range = (double)channel->maximum - (double)channel->minimum;
    return range > 0.0 ? LOW_US + RANGE_US * ((double)value - (double)channel->minimum) / range : (double)NAN;
}

void evdev_set(evdev_sticks_t *sticks, uint16_t type, uint16_t code, int32_t value)
{
    for (uint32_t i = 0; i < sticks->count; i++) {
        const evdev_channel_t *channel = &sticks->channels[i];
        if (channel->type == type && channel->code == code) {
            sticks->pulse_us[i] = pulse_of(channel, value);
        }
    }
}

evdev_kind_t evdev_take(evdev_sticks_t *sticks, const struct input_event *event)
{
    if (event->type == EV_SYN && event->code == SYN_DROPPED) {
        sticks->dropped = 1;
    } else if (event->type == EV_SYN && event->code == SYN_REPORT) {
        const int lost = sticks->dropped;
        sticks->dropped = 0;
        return lost ? EVDEV_LOST : EVDEV_REPORT;
    } else if (!sticks->dropped) {
        evdev_set(sticks, event->type, event->code, event->value);
    }
    return EVDEV_NOTHING;
}
