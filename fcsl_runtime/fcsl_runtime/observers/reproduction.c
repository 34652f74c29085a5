/* SPDX-License-Identifier: Apache-2.0
 *
 * Every message begins with a number: that of the write, or of the first one behind the checkpoint.
 */
#define _GNU_SOURCE
#include "reproduction.h"

#include <stdlib.h>

#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_scalar.h"

enum { NUMBER_BYTES = 8 };
/* A checkpoint is copied this often at most. */
static const uint64_t CHECKPOINT_NS = 20000000u;

int reproduction_open(reproduction_t *reproduction, fcsl_write_queue_t *writes)
{
    reproduction->writes = writes;
    reproduction->message = malloc(reproduction_write_bytes(reproduction));
    return reproduction->message != NULL ? 0 : -1;
}

void reproduction_close(reproduction_t *reproduction)
{
    free(reproduction->message);
    reproduction->message = NULL;
}

size_t reproduction_write_bytes(const reproduction_t *reproduction)
{
    return NUMBER_BYTES + fcsl_write_queue_capacity(reproduction->writes);
}

static int put_writes(reproduction_t *reproduction, fcsl_tick_publisher_t *publisher, const fcsl_moment_t *moment)
{
    uint8_t *message = reproduction->message + NUMBER_BYTES;
    const size_t capacity = fcsl_write_queue_capacity(reproduction->writes);
    uint64_t number = 0;
    size_t size = 0;
    int failed = 0;
    while ((size = fcsl_write_queue_take(reproduction->writes, moment->next_write, &number, message, capacity)) > 0) {
        fcsl_put_u64(reproduction->message, number);
        failed = fcsl_tick_publisher_post_write(publisher, reproduction->message, NUMBER_BYTES + size) != 0 || failed;
    }
    return fcsl_tick_publisher_post_written(publisher, moment->tick, moment->next_write) != 0 || failed ? -1 : 0;
}

static void answer_checkpoint(reproduction_t *reproduction, fcsl_tick_publisher_t *publisher,
                              const fcsl_moment_t *moment, const uint8_t *publication)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (now_ns - reproduction->answered_ns < CHECKPOINT_NS) {
        return;
    }
    reproduction->answered_ns = now_ns;
    fcsl_put_u64(reproduction->message, moment->next_write);
    const size_t size = fcsl_write_queue_checkpoint(reproduction->writes, publication, moment->tick,
                                                    reproduction->message + NUMBER_BYTES,
                                                    fcsl_write_queue_capacity(reproduction->writes));
    /* Refused: it is longer than a message of the bus, and nobody gets one. */
    (void)fcsl_tick_publisher_answer_checkpoint(publisher, reproduction->message, size > 0 ? NUMBER_BYTES + size : 0);
}

int reproduction_put(reproduction_t *reproduction, fcsl_tick_publisher_t *publisher, const fcsl_moment_t *moment,
                     const uint8_t *publication)
{
    if (moment->next_write == 0) {
        return 0;
    }
    const int failed = put_writes(reproduction, publisher, moment);
    answer_checkpoint(reproduction, publisher, moment, publication);
    return failed;
}
