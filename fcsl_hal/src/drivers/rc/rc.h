/* SPDX-License-Identifier: Apache-2.0
 *
 * What receivers of remote controls send: SBUS and CRSF.
 */
#ifndef FCSL_HAL_RC_H
#define FCSL_HAL_RC_H

#include "serial/byte_stream.h"

enum { RC_CHANNELS_MAX = 18 };

/* The sticks and switches, as pulses of a servo: 1500 us is the middle, 1000 to 2000 us the usual range. */
typedef struct {
    float pulse_us[RC_CHANNELS_MAX];
    uint32_t count; /* of channels */
    int frame_lost; /* the receiver missed a frame, and repeats the last one */
    int failsafe; /* it has lost the transmitter: it says so, or all channels are zero, which no transmitter sends */
} rc_frame_t;

/* How well a receiver hears the transmitter. */
typedef struct {
    int rssi_dbm; /* of the better antenna */
    uint32_t quality_percent; /* packets that arrived */
    int snr_db;
} rc_link_t;

/* Futaba's SBUS: 100000 baud, 8 data bits, even parity, 2 stop bits, inverted. 16 channels and two switches, which are channels 17 and 18
 * with 1000 or 2000 us. */
typedef struct {
    int in_sync; /* it is known where frames begin */
    byte_stream_t stream;
} rc_sbus_t;

/* Takes a byte. Returns 1 with *frame when it completes a frame, else 0. At first, and after bytes that belong to no frame, it takes
 * the second of two. */
int rc_sbus_take(rc_sbus_t *sbus, uint8_t byte, rc_frame_t *frame);

/* TBS's Crossfire, and ExpressLRS: 420000 baud, 8N1, 16 channels. It has no failsafe flag: a receiver that hears nothing is silent. */
typedef struct {
    byte_stream_t stream;
} rc_crsf_t;

typedef enum { RC_CRSF_NOTHING, RC_CRSF_CHANNELS, RC_CRSF_LINK } rc_crsf_kind_t;

/* Takes a byte. Returns what is complete now: *frame, *link, or nothing. */
rc_crsf_kind_t rc_crsf_take(rc_crsf_t *crsf, uint8_t byte, rc_frame_t *frame, rc_link_t *link);

/* 16 channels of 11 bits, the lowest bit first: what both have in common. */
enum { RC_PACKED_CHANNELS = 16, RC_PACKED_BYTES = 22 };
void rc_unpack(const uint8_t packed[RC_PACKED_BYTES], float pulse_us[RC_PACKED_CHANNELS]);
/* Whether all of them are zero. FrSky's receivers send that without a failsafe flag when they have lost the transmitter. */
int rc_is_empty(const uint8_t packed[RC_PACKED_BYTES]);

#endif /* FCSL_HAL_RC_H */
