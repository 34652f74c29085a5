/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers `sbus` and `crsf`: receivers of remote controls on a serial device. The time of a sample is that at which the last byte
 * of its frame was read; what the radio and the receiver take before is not known.
 */
#include "fcsl/fcsl_driver.h"

#include <math.h>
#include <stdbool.h>
#include <unistd.h>

#include "rc.h"
#include "serial/serial.h"

static const serial_mode_t SBUS_MODE = {.baud = 100000, .even_parity = 1, .two_stop_bits = 1};
static const serial_mode_t CRSF_MODE = {.baud = 420000};

#define STICKS_DOC "pulses of the channels, 1000 to 2000 us; NaN: no such channel"

/* Channels that the receiver does not have keep their NaN. */
static void put_sticks(const rc_frame_t *frame, double sticks[RC_CHANNELS_MAX])
{
    for (uint32_t i = 0; i < frame->count; i++) {
        sticks[i] = (double)frame->pulse_us[i];
    }
}

static void clear_sticks(double sticks[RC_CHANNELS_MAX])
{
    for (uint32_t i = 0; i < RC_CHANNELS_MAX; i++) {
        sticks[i] = (double)NAN;
    }
}

/* ---- SBUS --------------------------------------------------------------------------------------------------------------- */

typedef struct {
    double sticks[RC_CHANNELS_MAX];
    bool failsafe;
    fcsl_driver_input_t input;
    int fd;
    rc_sbus_t sbus;
} sbus_t;

static const fcsl_driver_signal_t sbus_signals[] = {
    FCSL_DRIVER_SIGNAL(sbus_t, sticks, "us", STICKS_DOC),
    FCSL_DRIVER_SIGNAL(sbus_t, failsafe, "",
                       "the receiver has lost the transmitter: it says so, or all channels are 0"),
};

static fcsl_driver_status_t open_sbus(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)used;
    sbus_t *sbus = self;
    clear_sticks(sbus->sticks);
    return serial_open(device, &SBUS_MODE, &sbus->fd, why, size);
}

/* A frame that repeats the last one is no sample: its values are old. In failsafe a receiver may set both flags. */
static int take_sbus(void *self, const uint8_t *bytes, uint32_t count, uint64_t time_ns, uint64_t *sample_ns)
{
    sbus_t *sbus = self;
    int found = 0;
    for (uint32_t i = 0; i < count; i++) {
        rc_frame_t frame;
        if (rc_sbus_take(&sbus->sbus, bytes[i], &frame) == 0) {
            continue;
        }
        if (frame.frame_lost && !frame.failsafe) {
            byte_stream_note(&sbus->sbus.stream, FCSL_DRIVER_REPEATED);
        } else {
            put_sticks(&frame, sbus->sticks);
            sbus->failsafe = frame.failsafe != 0;
            *sample_ns = time_ns;
            found = 1;
        }
    }
    return found;
}

static fcsl_driver_status_t read_sbus(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    sbus_t *sbus = self;
    const fcsl_driver_status_t status = serial_sample(sbus->fd, take_sbus, sbus, &sbus->input, sample_ns, why, size);
    byte_stream_report(&sbus->sbus.stream, &sbus->input);
    return status;
}

static void close_sbus(void *self)
{
    (void)close(((sbus_t *)self)->fd);
}

const fcsl_driver_t fcsl_driver_sbus = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "sbus",
    .doc = "RC receiver with SBUS, sbus:DEVICE[:BAUD]; 100000 baud 8E2. SBUS is inverted: the UART or an inverter "
           "before it must invert it back",
    .direction = FCSL_SENSOR,
    .signals = sbus_signals,
    .signal_count = sizeof sbus_signals / sizeof sbus_signals[0],
    .state_size = sizeof(sbus_t),
    .state_align = _Alignof(sbus_t),
    .waits = 1,
    .input = offsetof(sbus_t, input),
    .probe = serial_probe,
    .open = open_sbus,
    .read = read_sbus,
    .close = close_sbus,
};

/* ---- CRSF --------------------------------------------------------------------------------------------------------------- */

typedef struct {
    double sticks[RC_CHANNELS_MAX];
    bool failsafe;
    double rssi;
    double link_quality;
    fcsl_driver_input_t input;
    int fd;
    rc_crsf_t crsf;
    rc_frame_t frame; /* the last ones; count is 0 before the first channels */
    rc_link_t link;
    int has_link;
} crsf_t;

static const fcsl_driver_signal_t crsf_signals[] = {
    FCSL_DRIVER_SIGNAL(crsf_t, sticks, "us", STICKS_DOC),
    FCSL_DRIVER_SIGNAL(crsf_t, failsafe, "",
                       "no packet of the transmitter arrives: the link quality is 0, or all channels are"),
    FCSL_DRIVER_SIGNAL(crsf_t, rssi, "dBm", "signal strength at the better antenna; NaN: not told yet"),
    FCSL_DRIVER_SIGNAL(crsf_t, link_quality, "", "packets that arrive, 0 to 1; NaN: not told yet"),
};

static fcsl_driver_status_t open_crsf(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)used;
    crsf_t *crsf = self;
    clear_sticks(crsf->sticks);
    crsf->rssi = (double)NAN;
    crsf->link_quality = (double)NAN;
    return serial_open(device, &CRSF_MODE, &crsf->fd, why, size);
}

/* CRSF has no failsafe flag. A receiver without a transmitter reports a link quality of 0; it stops sending channels, or repeats
 * values of its own. So such a report is a sample, too. */
static int take_crsf(void *self, const uint8_t *bytes, uint32_t count, uint64_t time_ns, uint64_t *sample_ns)
{
    crsf_t *crsf = self;
    int found = 0;
    for (uint32_t i = 0; i < count; i++) {
        const rc_crsf_kind_t kind = rc_crsf_take(&crsf->crsf, bytes[i], &crsf->frame, &crsf->link);
        crsf->has_link = crsf->has_link || kind == RC_CRSF_LINK;
        found = found || kind == RC_CRSF_CHANNELS || (kind == RC_CRSF_LINK && crsf->link.quality_percent == 0u);
    }
    if (!found) {
        return 0;
    }
    put_sticks(&crsf->frame, crsf->sticks);
    crsf->failsafe = crsf->frame.failsafe || (crsf->has_link && crsf->link.quality_percent == 0u);
    if (crsf->has_link) {
        crsf->rssi = crsf->link.rssi_dbm;
        crsf->link_quality = crsf->link.quality_percent / 100.0;
    }
    *sample_ns = time_ns;
    return 1;
}

static fcsl_driver_status_t read_crsf(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    crsf_t *crsf = self;
    const fcsl_driver_status_t status = serial_sample(crsf->fd, take_crsf, crsf, &crsf->input, sample_ns, why, size);
    byte_stream_report(&crsf->crsf.stream, &crsf->input);
    return status;
}

static void close_crsf(void *self)
{
    (void)close(((crsf_t *)self)->fd);
}

const fcsl_driver_t fcsl_driver_crsf = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "crsf",
    .doc = "RC receiver with CRSF (Crossfire, ExpressLRS), crsf:DEVICE[:BAUD]; 420000 baud",
    .direction = FCSL_SENSOR,
    .signals = crsf_signals,
    .signal_count = sizeof crsf_signals / sizeof crsf_signals[0],
    .state_size = sizeof(crsf_t),
    .state_align = _Alignof(crsf_t),
    .waits = 1,
    .input = offsetof(crsf_t, input),
    .probe = serial_probe,
    .open = open_crsf,
    .read = read_crsf,
    .close = close_crsf,
};
