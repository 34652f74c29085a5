/* SPDX-License-Identifier: Apache-2.0
 *
 * Finished ROS 2 messages (CDR) on their way from the thread that steps to one that publishes them. A bounded queue between two
 * threads: one puts, the other takes. Putting allocates nothing and takes no lock.
 */
#ifndef FCSL_OUTBOX_H
#define FCSL_OUTBOX_H

#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_outbox fcsl_outbox_t;

/* Most bytes that fcsl_outbox_take writes. */
#define FCSL_OUTBOX_TAKE_MAX (4u << 20)

/* `lossless`: who puts waits until there is room; otherwise what finds none is dropped and counted. */
fcsl_outbox_t *fcsl_outbox_new(int lossless, fcsl_error_t *error);
void fcsl_outbox_free(fcsl_outbox_t *outbox);

typedef enum {
    FCSL_OUTBOX_STREAM = 0, /* the next one comes soon: dropped while there is still room for changes */
    FCSL_OUTBOX_CHANGE = 1
} fcsl_outbox_kind_t;

/* Where the `size` bytes of a message go; null where it is dropped. fcsl_outbox_put follows before the next claim. `topic`: any
 * number, by which who takes knows it. */
uint8_t *fcsl_outbox_claim(fcsl_outbox_t *outbox, uint32_t topic, uint32_t size, fcsl_outbox_kind_t kind);
void fcsl_outbox_put(fcsl_outbox_t *outbox);
/* Ends the moment that fcsl_outbox_take waits. */
void fcsl_outbox_wake(fcsl_outbox_t *outbox);

/* Takes messages, oldest first, up to about 64 KiB, or one; with `wait` it waits a moment where there is none. Writes for each:
 * topic (u32), size (u32), the message, and zeros up to a multiple of 8 bytes. `bytes` has room for FCSL_OUTBOX_TAKE_MAX. Returns
 * the bytes. */
size_t fcsl_outbox_take(fcsl_outbox_t *outbox, int wait, uint8_t *bytes);

/* Messages that were dropped. May be called from any thread. */
uint64_t fcsl_outbox_dropped(const fcsl_outbox_t *outbox);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_OUTBOX_H */
