/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages of channels: how samples, commands and simulated time travel between a controller and whatever surrounds it
 * (simulator process, ROS 2 node, board). docs/reference/transports.md defines every byte.
 *
 * A message is a sequence of little-endian entries: id u16, type u8, payload. Reserved ids carry the tick, the hash of the
 * channel table, the arm flag, the time and the CRC-32; the others are ids of channels, never names. What is encoded here has
 * one form: channels in table order. What is checked here may have them in any order; table order is checked fastest.
 * Every function is allocation-free; what does not fit or does not check out is refused and changes nothing.
 */
#ifndef FCSL_CODEC_H
#define FCSL_CODEC_H

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FCSL_RESERVED_ID_FIRST = 0xff00, /* ids from here on are no channels */
    FCSL_UNKNOWN_BYTES = 256         /* entries that the channel table does not have, for which buffers have room */
};

typedef enum {
    FCSL_SENSOR_MESSAGE = 0,   /* the channels that were sampled for a tick */
    FCSL_ACTUATOR_MESSAGE = 1, /* all actuator channels, and whether the actuators are armed */
    FCSL_TIME_MESSAGE = 2      /* the simulated time at which a tick happens */
} fcsl_message_kind_t;

typedef enum {
    FCSL_MESSAGE_OK = 0,
    FCSL_MESSAGE_SHORT = 1, /* truncated, longer than its entries, or longer than the buffer */
    FCSL_MESSAGE_KIND = 2,  /* does not begin as a message of this kind */
    FCSL_MESSAGE_CRC = 3,
    FCSL_MESSAGE_TABLE = 4, /* made for another channel table */
    FCSL_MESSAGE_ENTRY = 5, /* an entry is missing, repeated or misplaced */
    FCSL_MESSAGE_TYPE = 6,  /* an unknown type, or another one than the channel's */
    FCSL_MESSAGE_VALUE = 7  /* a bool that is neither 0 nor 1, an enumerator that does not exist */
} fcsl_message_status_t;

/* CRC-32 (IEEE 802.3, as zlib's) of `size` bytes, continuing from `crc` (0 to begin). */
uint32_t fcsl_crc32(uint32_t crc, const void *bytes, size_t size);

/* The channels of a machine, and the hash by which messages name them. Made once, when a host opens the machine. */
typedef struct {
    const fcsl_machine_t *machine;
    /* CRC-32 over (id u16, direction u8, type of its entry u8, count u32) of every channel in table order; the count of a blob
     * is that of its bytes at most. */
    uint32_t hash;
} fcsl_channel_table_t;

fcsl_channel_table_t fcsl_channel_table(const fcsl_machine_t *machine);

/* A message that fits its channel table: fcsl_message_check and the encoders alone make one. Bytes from elsewhere are checked
 * once, where they come in; from there on the message is handed on as this. */
typedef struct {
    const uint8_t *bytes;
    size_t size;
    uint64_t tick;
    uint64_t time_ns; /* time message; else 0 */
    fcsl_message_kind_t kind;
    uint32_t skipped; /* entries of ids that the table does not have, and quaternions of length zero from sensors */
    uint8_t armed; /* actuator message: 0 or 1; else 0 */
} fcsl_message_t;

/* Bytes that hold every message of this kind with all its channels, and FCSL_UNKNOWN_BYTES of unknown entries. */
size_t fcsl_message_capacity(const fcsl_machine_t *machine, fcsl_message_kind_t kind);

/* Each writes the message of `tick` to `bytes`. Sets *message on FCSL_MESSAGE_OK; else FCSL_MESSAGE_SHORT when `capacity` is
 * too small, or FCSL_MESSAGE_VALUE. `data` is a struct of the machine. */
/* `select` (may be null: all) holds one byte per channel of the machine, non-zero to include a sensor. */
fcsl_message_status_t fcsl_message_encode_sensors(const fcsl_channel_table_t *table, const void *data, uint64_t tick,
                                                  const uint8_t *select, uint8_t *bytes, size_t capacity,
                                                  fcsl_message_t *message);
/* `armed`: 0, or not 0. */
fcsl_message_status_t fcsl_message_encode_actuators(const fcsl_channel_table_t *table, const void *data, uint64_t tick,
                                                    int armed, uint8_t *bytes, size_t capacity,
                                                    fcsl_message_t *message);
fcsl_message_status_t fcsl_message_encode_time(const fcsl_channel_table_t *table, uint64_t tick, uint64_t time_ns,
                                               uint8_t *bytes, size_t capacity, fcsl_message_t *message);

/* Checks all of it; sets *message on FCSL_MESSAGE_OK. `bytes` must stay as they are while the message is used. */
fcsl_message_status_t fcsl_message_check(const fcsl_channel_table_t *table, fcsl_message_kind_t kind,
                                         const uint8_t *bytes, size_t size, fcsl_message_t *message);

/* Copies the values of the message's channels into `data` and, for sensors, sets each channel's `fresh` byte. */
void fcsl_message_apply(const fcsl_machine_t *machine, void *data, const fcsl_message_t *message);

/* An entry of a channel, all zero before the first one. */
typedef struct {
    size_t end; /* offset behind it in the message */
    uint32_t channel; /* index in the machine's channel table */
    uint32_t size; /* of the values, in bytes */
    const uint8_t *values; /* little-endian */
} fcsl_message_entry_t;

/* Moves *entry to the next entry of a channel. Returns 1, or 0 when there is none. */
int fcsl_message_next(const fcsl_machine_t *machine, const fcsl_message_t *message, fcsl_message_entry_t *entry);

/* A short description for people, never null. */
const char *fcsl_message_status_text(fcsl_message_status_t status);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_CODEC_H */
