/* SPDX-License-Identifier: Apache-2.0 */
#ifndef BENCH_WIRE_CORRUPTED_H
#define BENCH_WIRE_CORRUPTED_H

/* How many corrupted frames are accepted. */
typedef struct {
    long link;    /* by the CRC-16 of a link frame */
    long message; /* by the CRC-32 of a message that nothing below it protects */
    long both;    /* link frames by their CRC-16, and the message in them by its CRC-32 */
    long mavlink; /* by a MAVLink parser */
} corrupted_t;

/* In each frame 64 neighbouring bits become random: more than any of the CRCs is long, so that each misses its share of them.
 * They are never what they were. */
corrupted_t under_corruption(long frames);

#endif /* BENCH_WIRE_CORRUPTED_H */
