/* SPDX-License-Identifier: Apache-2.0
 *
 * CRSF: an address, the length of the rest, a type, its payload, and a CRC-8 of type and payload (polynomial 0xD5).
 */
#include "rc.h"

enum {
    LENGTH = 1, /* their places */
    TYPE = 2,
    PAYLOAD = 3,
    LENGTH_MIN = 2, /* type and CRC */
    LENGTH_MAX = 62,
    TYPE_LINK = 0x14,
    TYPE_CHANNELS = 0x16,
    LINK_BYTES = 10,
    POLYNOMIAL = 0xD5
};

static int is_address(uint8_t byte)
{
    /* Broadcast, flight controller, handset, receiver, transmitter. */
    return byte == 0x00u || byte == 0xC8u || byte == 0xEAu || byte == 0xECu || byte == 0xEEu;
}

static uint8_t crc_of(const uint8_t *bytes, uint32_t size)
{
    uint32_t crc = 0;
    //@ loop unroll LENGTH_MAX;
    for (uint32_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = crc & 0x80u ? (crc << 1) ^ POLYNOMIAL : crc << 1;
        }
        crc &= 0xFFu;
    }
    return (uint8_t)crc;
}

static int32_t judge(const uint8_t *bytes, uint32_t size)
{
    if (!is_address(bytes[0])) {
        return -FCSL_DRIVER_NO_FRAMES;
    }
    if (size <= LENGTH) {
        return 0;
    }
    const uint32_t length = bytes[LENGTH];
    if (length < LENGTH_MIN || length > LENGTH_MAX) {
        return -FCSL_DRIVER_NO_FRAMES;
    }
    if (size < length + TYPE) {
        return 0;
    }
    const uint32_t covered = length - 1u;
    return crc_of(bytes + TYPE, covered) == bytes[TYPE + covered] ? (int32_t)length + TYPE : -FCSL_DRIVER_NO_FRAMES;
}

/* Signal strengths are sent as -dBm; that of the second antenna is 0 where there is none. */
static void read_link(const uint8_t *payload, rc_link_t *link)
{
    const uint8_t first = payload[0];
    const uint8_t second = payload[1];
    link->rssi_dbm = second != 0u && second < first ? -(int)second : -(int)first;
    link->quality_percent = payload[2];
    link->snr_db = (int8_t)payload[3];
}

rc_crsf_kind_t rc_crsf_take(rc_crsf_t *crsf, uint8_t byte, rc_frame_t *frame, rc_link_t *link)
{
    const uint8_t *bytes = crsf->stream.bytes;
    const uint32_t size = byte_stream_take(&crsf->stream, byte, judge);
    if (size == 0u) {
        return RC_CRSF_NOTHING;
    }
    const uint32_t payload_size = size - PAYLOAD - 1u;
    if (bytes[TYPE] == TYPE_CHANNELS && payload_size == RC_PACKED_BYTES) {
        rc_unpack(bytes + PAYLOAD, frame->pulse_us);
        frame->count = RC_PACKED_CHANNELS;
        frame->frame_lost = 0;
        frame->failsafe = rc_is_empty(bytes + PAYLOAD);
        return RC_CRSF_CHANNELS;
    }
    byte_stream_note(&crsf->stream, FCSL_DRIVER_OTHER_FRAMES);
    if (bytes[TYPE] == TYPE_LINK && payload_size == LINK_BYTES) {
        read_link(bytes + PAYLOAD, link);
        return RC_CRSF_LINK;
    }
    return RC_CRSF_NOTHING;
}
