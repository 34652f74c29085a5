/* SPDX-License-Identifier: Apache-2.0
 *
 * Lines from one thread to another that prints them: a ring of fixed size. Who writes never waits; a line that finds no room
 * is dropped, and who reads gets a line that says how many were.
 *
 * `written` and `read` count lines. Each has one thread that stores it, with release and behind the line's bytes; the other loads it with
 * acquire before it touches them. So a line is read when it is whole, and its place is used again when it has been read.
 */
#ifndef FCSL_LOG_H
#define FCSL_LOG_H

#include <stdatomic.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FCSL_LOG_LINES = 32, /* a power of two */
    FCSL_LOG_BYTES = 512 /* of a line, its zero included; a longer one is cut */
};

/* All zero: empty. */
typedef struct {
    _Atomic uint32_t written;
    _Atomic uint32_t read;
    _Atomic uint64_t dropped;
    uint64_t dropped_reported; /* of these, to who reads */
    char lines[FCSL_LOG_LINES][FCSL_LOG_BYTES];
} fcsl_log_t;

/* From the one thread that writes. */
void fcsl_log_write(fcsl_log_t *log, const char *text);
/* From the one thread that reads: the oldest line, or behind the last one how many were dropped since that was told; 1, or 0 when
 * there is nothing. */
int fcsl_log_read(fcsl_log_t *log, char text[FCSL_LOG_BYTES]);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_LOG_H */
