/* SPDX-License-Identifier: Apache-2.0
 *
 * Finished ROS 2 messages (CDR) on their way from the thread that steps to one that publishes them. A bounded queue between two
 * threads: one puts, the other takes. Putting allocates nothing and takes no lock.
 */
#ifndef FCSL_PUBLISH_QUEUE_H
#define FCSL_PUBLISH_QUEUE_H

#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_publish_queue fcsl_publish_queue_t;

/* Most bytes that fcsl_publish_queue_take writes. */
#define FCSL_PUBLISH_QUEUE_TAKE_MAX (4u << 20)

/* `lossless`: who puts waits until there is room; otherwise what finds none is dropped and counted. */
fcsl_publish_queue_t *fcsl_publish_queue_new(int lossless, fcsl_error_t *error);
void fcsl_publish_queue_free(fcsl_publish_queue_t *queue);

typedef enum {
    FCSL_PUBLISH_QUEUE_STREAM = 0, /* the next one comes soon: dropped while there is still room for changes */
    FCSL_PUBLISH_QUEUE_CHANGE = 1
} fcsl_publish_queue_kind_t;

/* Where the `size` bytes of a message go; null where it is dropped. fcsl_publish_queue_put follows before the next claim. `topic`: any
 * number, by which who takes knows it. */
uint8_t *fcsl_publish_queue_claim(fcsl_publish_queue_t *queue, uint32_t topic, uint32_t size,
                                  fcsl_publish_queue_kind_t kind);
void fcsl_publish_queue_put(fcsl_publish_queue_t *queue);
/* Ends the moment that fcsl_publish_queue_take waits. */
void fcsl_publish_queue_wake(fcsl_publish_queue_t *queue);

/* Takes messages, oldest first, up to about 64 KiB, or one; with `wait` it waits a moment where there is none. Writes for each:
 * topic (u32), size (u32), the message, and zeros up to a multiple of 8 bytes. `bytes` has room for FCSL_PUBLISH_QUEUE_TAKE_MAX. Returns
 * the bytes. */
size_t fcsl_publish_queue_take(fcsl_publish_queue_t *queue, int wait, uint8_t *bytes);

/* Messages that were dropped. May be called from any thread. */
uint64_t fcsl_publish_queue_dropped(const fcsl_publish_queue_t *queue);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_PUBLISH_QUEUE_H */
