/* SPDX-License-Identifier: Apache-2.0
 *
 * Recording to MCAP, the container of ROS 2 bags. Link fcsl_hal::fcsl_io (a Rust library; it allocates and writes to
 * disk, so never call it from the thread that steps a machine).
 *
 * Messages are gathered into compressed chunks of about FCSL_MCAP_CHUNK_BYTES. A thread of the recording's own compresses a
 * complete chunk and hands it to the operating system while the next one is gathered, together with an end that the next chunk
 * writes over: the file is MCAP at any time, so that after kill -9 everything but the last, unfinished chunk, and one that was
 * being compressed, is readable by any reader that does without the summary. Call fcsl_mcap_flush from time to time where data
 * comes slowly; it waits for that thread. After a power failure what the operating system had not yet written is missing too;
 * fcsl_mcap_close waits for the disk.
 *
 * One thread at a time may use a recording; different recordings are independent. Strings are UTF-8 and copied. A null
 * pointer where there must be something is refused like any other wrong argument. After a failed write (full disk) every
 * further call on that recording fails with the same reason, from the next one on that ends a chunk; what was written before
 * stays readable, as after kill -9.
 */
#ifndef FCSL_MCAP_WRITER_H
#define FCSL_MCAP_WRITER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FCSL_MCAP_CHUNK_BYTES (256u * 1024u)

typedef struct fcsl_mcap fcsl_mcap_t;

/* Creates the file `path` (profile "ros2"); a file that exists is never overwritten. Returns 0 and sets *out, or -1, sets
 * *out to null and fills `error` with the reason (without the path; `error` may be null). */
int fcsl_mcap_open(const char *path, fcsl_mcap_t **out, char *error, size_t error_size);

/* Declares a message definition, e.g. ("std_msgs/msg/String", "ros2msg", text). Returns its id (1 to 65535), or -1.
 * The same definition again gives the same id. */
int64_t fcsl_mcap_add_schema(fcsl_mcap_t *mcap, const char *name, const char *encoding, const void *data, size_t size);

/* Declares a topic with `count` metadata entries keys[i] = values[i] (both may be null when count is 0).
 * Returns its id (0 to 65535), or -1. The same topic with the same properties again gives the same id. */
int64_t fcsl_mcap_add_channel(fcsl_mcap_t *mcap, const char *topic, uint16_t schema_id, const char *message_encoding,
                              const char *const *keys, const char *const *values, size_t count);

/* Appends one message. Times are nanoseconds. Returns 0, or -1. */
int fcsl_mcap_write(fcsl_mcap_t *mcap, uint16_t channel_id, uint32_t sequence, uint64_t log_time_ns,
                    uint64_t publish_time_ns, const void *data, size_t size);

/* Appends a metadata record: `count` entries keys[i] = values[i] under `name`. Ends the current chunk. Returns 0, or -1. */
int fcsl_mcap_add_metadata(fcsl_mcap_t *mcap, const char *name, const char *const *keys, const char *const *values,
                           size_t count);

/* Ends the current chunk and hands it to the operating system. Returns 0, or -1. */
int fcsl_mcap_flush(fcsl_mcap_t *mcap);

/* Why the last call on this recording failed; "" when none did. Valid until the next call on it. Never null. */
const char *fcsl_mcap_error(const fcsl_mcap_t *mcap);

/* Writes summary and footer, waits until the disk has all of it, and frees the recording in any case.
 * Returns 0, or -1 and fills `error` (may be null). Null is accepted and does nothing. */
int fcsl_mcap_close(fcsl_mcap_t *mcap, char *error, size_t error_size);
/* The same without waiting for the disk: the file outlives a killed process, but perhaps not a power failure. */
int fcsl_mcap_end(fcsl_mcap_t *mcap, char *error, size_t error_size);

/* The CRC-32 of fcsl_crc32 (fcsl_codec.h), at the speed of memory where the processor helps: for whole files. */
uint32_t fcsl_mcap_crc32(const void *data, size_t size);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_MCAP_WRITER_H */
