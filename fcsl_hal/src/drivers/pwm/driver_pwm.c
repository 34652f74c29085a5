/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `pwm`: pulses of a PWM chip of the kernel (Documentation/ABI/testing/sysfs-class-pwm of the kernel). Its device is
 * `CHIP[@HZ]`: the chip's folder by its name or path, or the device that it belongs to, as `1-0040`; and the frequency of the pulses.
 *
 * The files of pulses stay open: those of a chip that has gone refuse everything, whatever chip has got its name. They are locked:
 * a second program on a channel would write over the safe pulses of the first.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_driver.h"
#include "sysfs/sysfs.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

enum { CHANNELS = 16, TEXT_BYTES = 32, WHY_BYTES = 256, EXPORT_TRIES = 50 };
static const double HZ = 50.0; /* of most servos */
static const double HZ_MAX = 100000.0;
static const uint64_t EXPORT_WAIT_NS = 10000000u; /* udev gives the files of a new channel to their group */
static const uint64_t RECHECK_NS = 100000000u; /* for a chip that has gone */
static const uint64_t REWRITE_NS = 1000000000u; /* of what has not changed */

typedef struct {
    int duty_file; /* -1: not open */
    uint8_t is_set_up; /* its period and polarity are ours */
    uint8_t is_enabled; /* by us */
    uint8_t is_written; /* duty_ns is what it has */
    uint64_t duty_ns;
} channel_t;

typedef struct {
    double pulses[CHANNELS];
    uint8_t used[CHANNELS];
    const char *device;
    char chip[SYSFS_PATH_BYTES];
    uint64_t period_ns;
    channel_t channels[CHANNELS];
    uint8_t is_open;
    uint64_t poll_ns; /* when a chip that has gone is looked for */
    uint64_t rewrite_ns;
    uint8_t writes_all; /* this write, what has not changed, too */
} pwm_t;

#define PULSE(index_)                                                                                                  \
    {.name = "pulse" #index_,                                                                                          \
     .type = FCSL_F64,                                                                                                 \
     .count = 1,                                                                                                       \
     .offset = offsetof(pwm_t, pulses) + (index_) * sizeof(double),                                                    \
     .unit = "us",                                                                                                     \
     .doc = "length of the pulses of channel " #index_}

static const fcsl_driver_signal_t signals[CHANNELS] = {
    PULSE(0), PULSE(1), PULSE(2),  PULSE(3),  PULSE(4),  PULSE(5),  PULSE(6),  PULSE(7),
    PULSE(8), PULSE(9), PULSE(10), PULSE(11), PULSE(12), PULSE(13), PULSE(14), PULSE(15),
};

static const char *const names[] = {"device/name", "device/modalias", NULL};
static const sysfs_class_t chips = {
    .noun = "PWM chip", .folder = "class/pwm", .prefix = "pwmchip", .names = names, .owner = "device"};

/* ---- the chip ----------------------------------------------------------------------------------------------------------- */

/* Cuts CHIP[@HZ] into the name of the chip and the period. */
static fcsl_driver_status_t parse(const char *device, char name[SYSFS_PATH_BYTES], uint64_t *period_ns, char *why,
                                  size_t size)
{
    const char *at = strrchr(device, '@');
    const size_t length = at != NULL ? (size_t)(at - device) : strlen(device);
    double hz = HZ;
    if (length == 0u || length >= SYSFS_PATH_BYTES) {
        (void)snprintf(why, size, "name the PWM chip: pwm:CHIP, or pwm:CHIP@HZ for pulses that do not come at 50 Hz");
        return FCSL_DRIVER_ABSENT;
    }
    if (at != NULL && (sysfs_parse_number(at + 1, &hz) != 0 || hz < 1.0 || hz > HZ_MAX)) {
        (void)snprintf(why, size, "'%s': behind the @ stands a frequency, 1 to 100000 Hz", at);
        return FCSL_DRIVER_FAILED;
    }
    memcpy(name, device, length);
    name[length] = '\0';
    *period_ns = (uint64_t)llround(1e9 / hz);
    return FCSL_DRIVER_OK;
}

/* Finds the folder of a chip, and how many channels it has. */
static fcsl_driver_status_t find_chip(const char *name, char *path, double *count, char *why, size_t size)
{
    fcsl_driver_status_t status = sysfs_find(&chips, name, path, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = sysfs_get_number(path, "npwm", count, why, size);
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "'%s' is no PWM chip: it has no file npwm", path);
        return FCSL_DRIVER_FAILED;
    }
    return status;
}

static fcsl_driver_status_t probe_pwm(const char *device, char *why, size_t size)
{
    char name[SYSFS_PATH_BYTES];
    char path[SYSFS_PATH_BYTES];
    uint64_t period_ns = 0;
    double count = 0.0;
    const fcsl_driver_status_t status = parse(device, name, &period_ns, why, size);
    return status == FCSL_DRIVER_OK ? find_chip(name, path, &count, why, size) : status;
}

/* ---- a channel ---------------------------------------------------------------------------------------------------------- */

static int channel_folder(const pwm_t *pwm, unsigned index, char *path)
{
    char name[TEXT_BYTES];
    (void)snprintf(name, sizeof name, "pwm%u", index);
    return sysfs_join(path, pwm->chip, name);
}

/* For a reason that has been put: what it is about stands before it. */
static fcsl_driver_status_t fail(unsigned index, char *why, size_t size)
{
    char reason[WHY_BYTES];
    (void)snprintf(reason, sizeof reason, "%s", why);
    (void)snprintf(why, size, "pulse%u: %s", index, reason);
    return FCSL_DRIVER_FAILED;
}

static fcsl_driver_status_t get_ns(const char *folder, const char *attribute, double *number, char *why, size_t size)
{
    const fcsl_driver_status_t status = sysfs_get_number(folder, attribute, number, why, size);
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "it has no file %s", attribute);
    }
    return status;
}

static fcsl_driver_status_t put(const char *folder, const char *attribute, const char *text, char *why, size_t size)
{
    const fcsl_driver_status_t status = sysfs_put_text(folder, attribute, text, why, size);
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "it has no file %s", attribute);
    }
    return status;
}

static fcsl_driver_status_t put_ns(const char *folder, const char *attribute, uint64_t ns, char *why, size_t size)
{
    char text[TEXT_BYTES];
    (void)snprintf(text, sizeof text, "%" PRIu64, ns);
    return put(folder, attribute, text, why, size);
}

/* Sets the period. A channel of another one is switched off before: a chip with one period for all channels takes another one only
 * while no other channel is on, and the kernel refuses one that is shorter than the pulse. */
static fcsl_driver_status_t set_period(const char *folder, uint64_t period_ns, char *why, size_t size)
{
    double period = 0.0;
    fcsl_driver_status_t status = get_ns(folder, "period", &period, why, size);
    if (status != FCSL_DRIVER_OK || period == (double)period_ns) {
        return status;
    }
    if (period > 0.0) { /* one without a period is off, and takes no pulse */
        status = put(folder, "enable", "0", why, size);
        status = status == FCSL_DRIVER_OK ? put(folder, "duty_cycle", "0", why, size) : status;
    }
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = put_ns(folder, "period", period_ns, why, size);
    if (status == FCSL_DRIVER_FAILED) {
        const size_t length = strnlen(why, size);
        (void)snprintf(why + length, size - length,
                       "; a chip with one period for all channels takes another one only while the others are off");
    }
    return status;
}

/* Sets period and polarity. Chips that cannot invert have no polarity, or refuse it. */
static fcsl_driver_status_t set_up(const char *folder, uint64_t period_ns, char *why, size_t size)
{
    char polarity[SYSFS_TEXT_BYTES];
    fcsl_driver_status_t status = set_period(folder, period_ns, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = sysfs_get_text(folder, "polarity", polarity, why, size);
    if (status == FCSL_DRIVER_OK && strcmp(polarity, "normal") != 0) {
        status = put(folder, "polarity", "normal", why, size);
    }
    return status == FCSL_DRIVER_NOTHING ? FCSL_DRIVER_OK : status;
}

static void release(channel_t *channel)
{
    if (channel->duty_file >= 0) {
        (void)close(channel->duty_file);
    }
    *channel = (channel_t){.duty_file = -1};
}

/* Opens and locks the file of the pulses. The lock ends with the program, however it ends; who may not write has none. */
static fcsl_driver_status_t take(channel_t *channel, const char *folder, char *why, size_t size)
{
    struct flock all = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
    char path[SYSFS_PATH_BYTES];
    channel->duty_file =
        sysfs_join(path, folder, "duty_cycle") == 0 ? open(path, O_WRONLY | O_NONBLOCK | O_CLOEXEC) : -1;
    if (channel->duty_file < 0) {
        (void)snprintf(why, size, "cannot open its duty_cycle: %s", strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    if (fcntl(channel->duty_file, F_OFD_SETLK, &all) != 0) {
        const int code = errno;
        release(channel);
        if (code == EAGAIN || code == EACCES) {
            (void)snprintf(why, size, "another device or program drives it");
        } else {
            (void)snprintf(why, size, "cannot lock its duty_cycle: %s", strerror(code));
        }
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

/* One that has pulses is left alone until the first write. The kernel calls all channels of some chips enabled, those without pulses,
 * too. */
static fcsl_driver_status_t open_channel(pwm_t *pwm, unsigned index, const char *folder, char *why, size_t size)
{
    channel_t *channel = &pwm->channels[index];
    double enabled = 0.0;
    double duty = 0.0;
    fcsl_driver_status_t status = get_ns(folder, "enable", &enabled, why, size);
    status = status == FCSL_DRIVER_OK ? get_ns(folder, "duty_cycle", &duty, why, size) : status;
    status = status == FCSL_DRIVER_OK ? take(channel, folder, why, size) : status;
    if (status == FCSL_DRIVER_OK && (enabled == 0.0 || duty == 0.0)) {
        status = set_up(folder, pwm->period_ns, why, size);
        channel->is_set_up = status == FCSL_DRIVER_OK;
    }
    if (status != FCSL_DRIVER_OK) {
        release(channel); /* export_and_open tries again */
    }
    return status;
}

/* The kernel shows the files of a channel when it is exported. */
static fcsl_driver_status_t export_and_open(pwm_t *pwm, unsigned index, char *why, size_t size)
{
    const struct timespec wait = fcsl_timespec_of(EXPORT_WAIT_NS);
    char folder[SYSFS_PATH_BYTES];
    char number[TEXT_BYTES];
    if (channel_folder(pwm, index, folder) != 0) {
        (void)snprintf(why, size, "its path is too long");
        return FCSL_DRIVER_FAILED;
    }
    unsigned tries = 1;
    if (access(folder, F_OK) != 0) {
        (void)snprintf(number, sizeof number, "%u", index);
        if (put(pwm->chip, "export", number, why, size) != FCSL_DRIVER_OK) {
            return FCSL_DRIVER_FAILED;
        }
        tries = EXPORT_TRIES;
    }
    fcsl_driver_status_t status = open_channel(pwm, index, folder, why, size);
    for (unsigned i = 1; i < tries && status != FCSL_DRIVER_OK; i++) {
        (void)nanosleep(&wait, NULL);
        status = open_channel(pwm, index, folder, why, size);
    }
    return status;
}

/* ---- all channels ------------------------------------------------------------------------------------------------------- */

static void close_pwm(void *self)
{
    pwm_t *pwm = self;
    for (unsigned i = 0; i < CHANNELS; i++) {
        release(&pwm->channels[i]);
    }
    pwm->is_open = 0;
}

static fcsl_driver_status_t open_channels(pwm_t *pwm, double count, char *why, size_t size)
{
    for (unsigned i = 0; i < CHANNELS; i++) {
        if (pwm->used[i] != 0u && (double)i >= count) {
            (void)snprintf(why, size, "pulse%u: the PWM chip has %g channels", i, count);
            return FCSL_DRIVER_FAILED;
        }
    }
    for (unsigned i = 0; i < CHANNELS; i++) {
        if (pwm->used[i] != 0u && export_and_open(pwm, i, why, size) != FCSL_DRIVER_OK) {
            return fail(i, why, size);
        }
    }
    return FCSL_DRIVER_OK;
}

/* Finds the chip and opens its channels, or none. */
static fcsl_driver_status_t open_chip(pwm_t *pwm, char *why, size_t size)
{
    char name[SYSFS_PATH_BYTES];
    double count = 0.0;
    fcsl_driver_status_t status = parse(pwm->device, name, &pwm->period_ns, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = find_chip(name, pwm->chip, &count, why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        status = open_channels(pwm, count, why, size);
    }
    if (status != FCSL_DRIVER_OK) {
        close_pwm(pwm);
        return status;
    }
    pwm->is_open = 1;
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t open_pwm(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    pwm_t *pwm = self;
    pwm->device = device;
    memcpy(pwm->used, used, sizeof pwm->used);
    for (unsigned i = 0; i < CHANNELS; i++) {
        pwm->channels[i].duty_file = -1;
    }
    return open_chip(pwm, why, size);
}

/* Writes the length of a pulse. ABSENT: the chip has gone. */
static fcsl_driver_status_t write_duty(channel_t *channel, uint64_t duty_ns, char *why, size_t size)
{
    char text[TEXT_BYTES];
    const int length = snprintf(text, sizeof text, "%" PRIu64 "\n", duty_ns);
    errno = EIO; /* for a write that is short */
    if (pwrite(channel->duty_file, text, (size_t)length, 0) == length) {
        channel->duty_ns = duty_ns;
        channel->is_written = 1;
        return FCSL_DRIVER_OK;
    }
    const int code = errno;
    (void)snprintf(why, size, "duty_cycle refuses %" PRIu64 ": %s", duty_ns, strerror(code));
    return code == ENODEV || code == ENOENT ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

/* What open has left to the first write. */
static fcsl_driver_status_t set_up_channel(pwm_t *pwm, unsigned index, char *why, size_t size)
{
    channel_t *channel = &pwm->channels[index];
    char folder[SYSFS_PATH_BYTES];
    fcsl_driver_status_t status = FCSL_DRIVER_OK;
    (void)channel_folder(pwm, index, folder); /* open_channel has used it */
    if (!channel->is_set_up) {
        status = set_up(folder, pwm->period_ns, why, size);
        channel->is_set_up = status == FCSL_DRIVER_OK;
    }
    return status == FCSL_DRIVER_NOTHING ? FCSL_DRIVER_ABSENT : status;
}

/* Brings a channel to its pulse: what has changed of it, or all. */
static fcsl_driver_status_t write_channel(pwm_t *pwm, unsigned index, char *why, size_t size)
{
    channel_t *channel = &pwm->channels[index];
    const double duty = pwm->pulses[index] * 1000.0;
    char folder[SYSFS_PATH_BYTES];
    fcsl_driver_status_t status = FCSL_DRIVER_OK;
    (void)channel_folder(pwm, index, folder); /* open_channel has used it */
    if (!channel->is_set_up) {
        return FCSL_DRIVER_OK; /* set_up_channel has failed, and said why */
    }
    if (!(duty >= 0.0 && duty <= (double)pwm->period_ns)) { /* NaN, too */
        (void)snprintf(why, size, "%g us is no pulse within the period of %g us", pwm->pulses[index],
                       (double)pwm->period_ns / 1000.0);
        return FCSL_DRIVER_FAILED;
    }
    const uint64_t duty_ns = (uint64_t)llround(duty);
    if (pwm->writes_all || !channel->is_written || duty_ns != channel->duty_ns) {
        status = write_duty(channel, duty_ns, why, size);
    }
    if (status == FCSL_DRIVER_OK && (pwm->writes_all || !channel->is_enabled)) {
        status = put(folder, "enable", "1", why, size);
        channel->is_enabled = status == FCSL_DRIVER_OK;
    }
    if (status != FCSL_DRIVER_OK) {
        channel->is_written = 0; /* nothing is known of it */
    }
    return status == FCSL_DRIVER_NOTHING ? FCSL_DRIVER_ABSENT : status;
}

typedef fcsl_driver_status_t (*act_t)(pwm_t *pwm, unsigned index, char *why, size_t size);

/* A channel that refuses keeps no other one from its own. */
static fcsl_driver_status_t act_on_all(pwm_t *pwm, act_t act, char *why, size_t size)
{
    fcsl_driver_status_t result = FCSL_DRIVER_OK;
    for (unsigned i = 0; i < CHANNELS; i++) {
        if (pwm->used[i] == 0u) {
            continue;
        }
        const fcsl_driver_status_t status = act(pwm, i, why, size);
        if (status != FCSL_DRIVER_OK) {
            result = fail(i, why, size);
        }
        if (status == FCSL_DRIVER_ABSENT) {
            close_pwm(pwm); /* it is looked for at once */
            pwm->poll_ns = 0;
            return result;
        }
    }
    return result;
}

/* All are set up before one gets its pulse: set_period says why. */
static fcsl_driver_status_t write_channels(pwm_t *pwm, char *why, size_t size)
{
    const fcsl_driver_status_t set_up_all = act_on_all(pwm, set_up_channel, why, size);
    if (!pwm->is_open) {
        return set_up_all;
    }
    const fcsl_driver_status_t written = act_on_all(pwm, write_channel, why, size);
    return written != FCSL_DRIVER_OK ? written : set_up_all;
}

static fcsl_driver_status_t write_pwm(void *self, char *why, size_t size)
{
    pwm_t *pwm = self;
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (!pwm->is_open) {
        if (now_ns < pwm->poll_ns) {
            (void)snprintf(why, size, "the PWM chip has gone");
            return FCSL_DRIVER_FAILED;
        }
        pwm->poll_ns = now_ns + RECHECK_NS;
        if (open_chip(pwm, why, size) != FCSL_DRIVER_OK) {
            return FCSL_DRIVER_FAILED;
        }
    }
    pwm->writes_all = now_ns >= pwm->rewrite_ns;
    pwm->rewrite_ns = pwm->writes_all ? now_ns + REWRITE_NS : pwm->rewrite_ns;
    return write_channels(pwm, why, size);
}

const fcsl_driver_t fcsl_driver_pwm = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "pwm",
    .doc = "pulses of a PWM chip; CHIP[@HZ]: pwmchip0, a path, or the chip's device as 1-0040, and a frequency (50)",
    .direction = FCSL_ACTUATOR,
    .signals = signals,
    .signal_count = CHANNELS,
    .state_size = sizeof(pwm_t),
    .state_align = _Alignof(pwm_t),
    .probe = probe_pwm,
    .open = open_pwm,
    .write = write_pwm,
    .close = close_pwm,
};
