/* SPDX-License-Identifier: Apache-2.0
 *
 * What Benewake's range finders send by themselves: TFmini Plus, TFmini-S and TF-Luna, in their standard format of 9 bytes and
 * centimetres. Benewake, TFmini Plus Product Manual (SJ-PM-TFmini Plus-T-01), 5.3; TF-Luna Product Manual (SJ-PM-TF-Luna), appendix I.
 */
#ifndef FCSL_HAL_TFMINI_H
#define FCSL_HAL_TFMINI_H

#include "serial/byte_stream.h"

typedef struct {
    int is_reliable; /* else the distance means nothing */
    uint32_t distance_cm;
    uint32_t strength; /* of the echo, without a unit; 65535: overexposed */
    double temperature_degc; /* of the chip */
} tfmini_reading_t;

/* 115200 baud, 8N1. */
typedef struct {
    byte_stream_t stream;
} tfmini_t;

/* Takes a byte. Returns 1 with *reading when it completes a frame, else 0. */
int tfmini_take(tfmini_t *tfmini, uint8_t byte, tfmini_reading_t *reading);

#endif /* FCSL_HAL_TFMINI_H */
