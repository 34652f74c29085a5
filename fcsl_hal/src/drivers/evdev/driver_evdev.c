/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `evdev`: an RC transmitter or a joystick that is an input device of Linux. The kernel tells the time of each event.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_driver.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/input.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"
#include "evdev_find.h"
#include "evdev_sticks.h"

enum { EVENTS_MAX = 64, BITS_PER_BYTE = 8, NS_PER_US = 1000 };

typedef struct {
    uint8_t bits[KEY_MAX / BITS_PER_BYTE + 1]; /* by code; there are more keys than axes */
} codes_t;

typedef struct {
    double sticks[EVDEV_CHANNELS_MAX];
    bool failsafe;
    int fd;
    evdev_sticks_t state;
    struct input_event events[EVENTS_MAX]; /* read, and taken up to `next` */
    uint32_t count;
    uint32_t next;
    uint64_t last_ns; /* of the last sample */
} evdev_t;

static const fcsl_driver_signal_t signals[] = {
    FCSL_DRIVER_SIGNAL(evdev_t, sticks, "us", "axes by their code, then buttons, 1000 to 2000; NaN: no such channel"),
    FCSL_DRIVER_SIGNAL(evdev_t, failsafe, "", "always false: a joystick does not tell that it lost its radio"),
};

/* ABSENT for an unplugged device, else FAILED. */
static fcsl_driver_status_t judge_error(const char *action, char *why, size_t size)
{
    const int code = errno;
    (void)snprintf(why, size, "cannot %s the input device: %s", action, strerror(code));
    return code == ENODEV || code == ENOENT || code == ENXIO ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

static fcsl_driver_status_t probe_evdev(const char *device, char *why, size_t size)
{
    char path[EVDEV_PATH_BYTES];
    const fcsl_driver_status_t status = evdev_find(device, path, why, size);
    if (status != FCSL_DRIVER_OK || access(path, R_OK) == 0) {
        return status;
    }
    const int code = errno;
    const char *hint = code == EACCES ? "; may this user read it (group input)?" : "";
    (void)snprintf(why, size, "cannot read '%s': %s%s", path, strerror(code), hint);
    return code == EACCES ? FCSL_DRIVER_FAILED : FCSL_DRIVER_ABSENT;
}

/* ---- the state of the device -------------------------------------------------------------------------------------------- */

static int has_code(const codes_t *codes, uint32_t code)
{
    const uint32_t byte = codes->bits[code / BITS_PER_BYTE];
    return (byte >> code % BITS_PER_BYTE & 1u) != 0u;
}

static void add_buttons(evdev_sticks_t *state, const codes_t *keys, uint16_t first, uint16_t end)
{
    for (uint16_t code = first; code < end; code++) {
        if (has_code(keys, code)) {
            evdev_add(state, (evdev_channel_t){.type = EV_KEY, .code = code});
        }
    }
}

/* Axes up to those of touch pads, and the buttons of joysticks and gamepads. 0, or -1 with errno. */
static int find_channels(int fd, evdev_sticks_t *state)
{
    codes_t axes = {{0}};
    codes_t keys = {{0}};
    if (ioctl(fd, EVIOCGBIT(EV_ABS, sizeof axes.bits), axes.bits) < 0 ||
        ioctl(fd, EVIOCGBIT(EV_KEY, sizeof keys.bits), keys.bits) < 0) {
        return -1;
    }
    evdev_clear(state);
    for (uint16_t code = ABS_X; code < ABS_MT_SLOT; code++) {
        struct input_absinfo axis = {0};
        if (!has_code(&axes, code)) {
            continue;
        }
        if (ioctl(fd, EVIOCGABS((uint32_t)code), &axis) < 0) {
            return -1;
        }
        evdev_add(state, (evdev_channel_t){EV_ABS, code, axis.minimum, axis.maximum});
    }
    add_buttons(state, &keys, BTN_JOYSTICK, BTN_DIGI);
    add_buttons(state, &keys, BTN_TRIGGER_HAPPY, BTN_TRIGGER_HAPPY40 + 1);
    return 0;
}

/* Sets all channels from the device. 0, or -1 with errno. */
static int read_state(int fd, evdev_sticks_t *state)
{
    codes_t keys = {{0}};
    if (ioctl(fd, EVIOCGKEY(sizeof keys.bits), keys.bits) < 0) {
        return -1;
    }
    for (uint32_t i = 0; i < state->count; i++) {
        const evdev_channel_t *channel = &state->channels[i];
        struct input_absinfo axis = {.value = has_code(&keys, channel->code)};
        if (channel->type == EV_ABS && ioctl(fd, EVIOCGABS((uint32_t)channel->code), &axis) < 0) {
            return -1;
        }
        evdev_set(state, channel->type, channel->code, axis.value);
    }
    return 0;
}

static int set_up(evdev_t *evdev)
{
    int clock = CLOCK_MONOTONIC;
    if (ioctl(evdev->fd, EVIOCSCLOCKID, &clock) < 0 || find_channels(evdev->fd, &evdev->state) != 0) {
        return -1;
    }
    return read_state(evdev->fd, &evdev->state);
}

static fcsl_driver_status_t open_evdev(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)used;
    evdev_t *evdev = self;
    char path[EVDEV_PATH_BYTES];
    fcsl_driver_status_t status = evdev_find(device, path, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    evdev->fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (evdev->fd < 0) {
        return judge_error("open", why, size);
    }
    if (set_up(evdev) != 0) {
        status = judge_error("set up", why, size);
    } else if (evdev->state.count == 0u || evdev->state.channels[0].type != EV_ABS) {
        (void)snprintf(why, size, "'%s' has no axes: it is no joystick", path);
        status = FCSL_DRIVER_FAILED;
    }
    if (status != FCSL_DRIVER_OK) {
        (void)close(evdev->fd);
        return status;
    }
    memcpy(evdev->sticks, evdev->state.pulse_us, sizeof evdev->sticks);
    return FCSL_DRIVER_OK;
}

/* ---- read --------------------------------------------------------------------------------------------------------------- */

/* Waits for events and reads what there are, or NOTHING at the deadline. */
static fcsl_driver_status_t read_events(evdev_t *evdev, uint64_t deadline_ns, char *why, size_t size)
{
    while (fcsl_monotonic_ns() < deadline_ns) {
        struct pollfd wait = {.fd = evdev->fd, .events = POLLIN};
        const struct timespec left = fcsl_time_left(deadline_ns);
        const int ready = ppoll(&wait, 1, &left, NULL);
        const ssize_t got = ready > 0 ? read(evdev->fd, evdev->events, sizeof evdev->events) : ready;
        if (got > 0) {
            evdev->count = (uint32_t)((size_t)got / sizeof evdev->events[0]);
            evdev->next = 0;
            return FCSL_DRIVER_OK;
        }
        if (ready > 0 && got == 0) {
            errno = ENODEV;
        }
        if (ready != 0 && errno != EAGAIN && errno != EINTR) {
            return judge_error("read", why, size);
        }
    }
    return FCSL_DRIVER_NOTHING;
}

/* The channels are a sample, taken at `time_ns`. An event may have happened just before the driver found that there was none: its time
 * is moved, so that samples keep their order. */
static fcsl_driver_status_t give(evdev_t *evdev, uint64_t time_ns, uint64_t *sample_ns)
{
    memcpy(evdev->sticks, evdev->state.pulse_us, sizeof evdev->sticks);
    evdev->last_ns = time_ns > evdev->last_ns ? time_ns : evdev->last_ns + 1u;
    *sample_ns = evdev->last_ns;
    return FCSL_DRIVER_OK;
}

/* Takes events up to the end of a report. OK with a sample, NOTHING when they end before. */
static fcsl_driver_status_t take_events(evdev_t *evdev, uint64_t *sample_ns, char *why, size_t size)
{
    while (evdev->next < evdev->count) {
        const struct input_event *event = &evdev->events[evdev->next++];
        const evdev_kind_t kind = evdev_take(&evdev->state, event);
        if (kind == EVDEV_LOST && read_state(evdev->fd, &evdev->state) != 0) {
            return judge_error("read the state of", why, size);
        }
        if (kind != EVDEV_NOTHING) {
            const uint64_t seconds = (uint64_t)event->input_event_sec;
            const uint64_t microseconds = (uint64_t)event->input_event_usec;
            return give(evdev, seconds * FCSL_NS_PER_S + microseconds * NS_PER_US, sample_ns);
        }
    }
    return FCSL_DRIVER_NOTHING;
}

/* A stick that nobody moves sends no events, and its values are as good as new: without a sample the host would take the joystick for
 * silent. So where nothing came, the state of the device is a sample, if the device still gives it. */
static fcsl_driver_status_t take_state(evdev_t *evdev, uint64_t *sample_ns, char *why, size_t size)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (read_state(evdev->fd, &evdev->state) != 0) {
        return judge_error("read the state of", why, size);
    }
    return give(evdev, now_ns, sample_ns);
}

static fcsl_driver_status_t read_evdev(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    evdev_t *evdev = self;
    const uint64_t deadline_ns = fcsl_monotonic_ns() + (uint64_t)FCSL_DRIVER_WAIT_MS * FCSL_NS_PER_MS;
    fcsl_driver_status_t status = take_events(evdev, sample_ns, why, size);
    while (status == FCSL_DRIVER_NOTHING) { /* read_events ends it at the deadline */
        status = read_events(evdev, deadline_ns, why, size);
        if (status == FCSL_DRIVER_NOTHING) {
            return take_state(evdev, sample_ns, why, size);
        }
        if (status == FCSL_DRIVER_OK) {
            status = take_events(evdev, sample_ns, why, size);
        }
    }
    return status;
}

static void close_evdev(void *self)
{
    (void)close(((evdev_t *)self)->fd);
}

const fcsl_driver_t fcsl_driver_evdev = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "evdev",
    .doc = "RC transmitter as a joystick, joystick: evdev:/dev/input/eventN, or its name, serial number (uniq) or phys",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = sizeof signals / sizeof signals[0],
    .state_size = sizeof(evdev_t),
    .state_align = _Alignof(evdev_t),
    .waits = 1,
    .probe = probe_evdev,
    .open = open_evdev,
    .read = read_evdev,
    .close = close_evdev,
};
