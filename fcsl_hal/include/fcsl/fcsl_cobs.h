/* SPDX-License-Identifier: Apache-2.0
 *
 * Frames of the link layer on a stream of bytes: Consistent Overhead Byte Stuffing (Cheshire and Baker, IEEE/ACM Transactions
 * on Networking 7 (2), 1999), with a zero behind each frame.
 */
#ifndef FCSL_COBS_H
#define FCSL_COBS_H

#include "fcsl/fcsl_link.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    /* The longest encoded frame, its zero included. */
    FCSL_COBS_BYTES_MAX = FCSL_LINK_FRAME_MAX + FCSL_LINK_FRAME_MAX / 254 + 2
};

/* Encodes a frame of at most FCSL_LINK_FRAME_MAX bytes, with a zero behind it; returns the number of bytes. */
size_t fcsl_cobs_encode(const uint8_t *frame, size_t size, uint8_t bytes[FCSL_COBS_BYTES_MAX]);

/* What came of a frame so far. All zero: nothing. */
typedef struct {
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    uint32_t size;
    uint8_t left;     /* bytes of the present block that are still to come */
    uint8_t zero;     /* a zero follows the present block if another one comes */
    uint8_t refused;  /* it is no frame: nothing counts up to the next zero */
    uint64_t garbage; /* what stood between two zeros and was no frame */
} fcsl_cobs_decoder_t;

/* Takes bytes of the stream up to the end of the next frame, or all; returns how many. *size is the size of the frame that they
 * complete, which lies in decoder->frame until the next call; otherwise 0. */
size_t fcsl_cobs_decode(fcsl_cobs_decoder_t *decoder, const uint8_t *bytes, size_t count, size_t *size);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_COBS_H */
