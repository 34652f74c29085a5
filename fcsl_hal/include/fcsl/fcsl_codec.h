/* SPDX-License-Identifier: Apache-2.0
 *
 * Channel frames: how sensor and actuator channels travel between a controller and whatever surrounds it
 * (simulator process, ROS 2 node, board). A frame carries ids, never names, and one tick's channels of one direction:
 *
 *   offset size
 *   0      4   magic "FCSF"
 *   4      2   version (1)
 *   6      1   direction (fcsl_direction_t)
 *   7      1   zero
 *   8      8   tick
 *   16     4   channel-table hash: frames of another table are refused
 *   20     2   entries
 *   22     2   zero
 *   24         entries: id u16, payload bytes u16, payload (row-major scalars)
 *   end    4   CRC-32 (IEEE) of all that stands before
 *
 * Everything is little-endian. Entries stand in the order of the machine's channel table, so a frame has one encoding.
 * Sensor frames hold only the channels sampled for this tick; actuator frames hold all. NaNs are canonical.
 * Every function is allocation-free; what does not fit or does not check out is refused and changes nothing.
 */
#ifndef FCSL_CODEC_H
#define FCSL_CODEC_H

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    FCSL_FRAME_OK = 0,
    FCSL_FRAME_SHORT = 1,       /* truncated, or longer than its entries */
    FCSL_FRAME_MAGIC = 2,       /* not a frame, or another version */
    FCSL_FRAME_CRC = 3,
    FCSL_FRAME_TABLE = 4,       /* made for another channel table */
    FCSL_FRAME_DIRECTION = 5,
    FCSL_FRAME_CHANNEL = 6,     /* unknown, repeated or misplaced id, or a size that is not its field's */
    FCSL_FRAME_VALUE = 7        /* a bool that is neither 0 nor 1, an enumerator that does not exist */
} fcsl_frame_status_t;

/* CRC-32 (IEEE 802.3, as zlib's) of `size` bytes, continuing from `crc` (0 to begin). */
uint32_t fcsl_crc32(uint32_t crc, const void *bytes, size_t size);

/* The channels of a machine, and the hash by which frames name them. Made once, when a host opens the machine. */
typedef struct {
    const fcsl_machine_t *machine;
    uint32_t hash; /* CRC-32 over (id u16, direction u8, type u8, count u32) of every channel in table order */
} fcsl_channel_table_t;

fcsl_channel_table_t fcsl_channel_table(const fcsl_machine_t *machine);

/* A frame that fits its channel table: fcsl_frame_check and fcsl_frame_encode alone make one. Bytes from elsewhere are checked
 * once, where they come in; from there on the frame is handed on as this. */
typedef struct {
    const uint8_t *bytes;
    size_t size;
    uint64_t tick;
    fcsl_direction_t direction;
} fcsl_frame_t;

/* Bytes of the largest frame of this direction. */
size_t fcsl_frame_capacity(const fcsl_machine_t *machine, fcsl_direction_t direction);

/* Writes the frame of `tick` to `bytes`. `select` (may be null: all) holds one byte per channel of the machine, non-zero to
 * include. Sets *frame on FCSL_FRAME_OK; else FCSL_FRAME_SHORT when `capacity` is too small, or FCSL_FRAME_VALUE. */
fcsl_frame_status_t fcsl_frame_encode(const fcsl_channel_table_t *table, const void *data, fcsl_direction_t direction,
                                      uint64_t tick, const uint8_t *select, uint8_t *bytes, size_t capacity,
                                      fcsl_frame_t *frame);

/* Checks all of it; sets *frame on FCSL_FRAME_OK. `bytes` must stay as they are while the frame is used. */
fcsl_frame_status_t fcsl_frame_check(const fcsl_channel_table_t *table, fcsl_direction_t direction,
                                     const uint8_t *bytes, size_t size, fcsl_frame_t *frame);

/* Copies the frame's payloads into `data` and, for sensor frames, sets each channel's `fresh` byte. */
void fcsl_frame_apply(const fcsl_machine_t *machine, void *data, const fcsl_frame_t *frame);

/* An entry of a frame, all zero before the first one. */
typedef struct {
    uint32_t number;  /* 1 for the first entry */
    uint32_t channel; /* index in the machine's channel table */
    uint32_t size;    /* bytes of the payload */
    const uint8_t *payload;
} fcsl_frame_entry_t;

/* Moves *entry to the next entry of the frame. Returns 1, or 0 when there is none. */
int fcsl_frame_next(const fcsl_machine_t *machine, const fcsl_frame_t *frame, fcsl_frame_entry_t *entry);

/* A short description for messages, never null. */
const char *fcsl_frame_status_text(fcsl_frame_status_t status);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_CODEC_H */
