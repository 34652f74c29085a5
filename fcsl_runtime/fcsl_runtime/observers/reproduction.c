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

int reproduction_open(reproduction_t *reproduction, fcsl_journal_t *journal)
{
    reproduction->journal = journal;
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
    return NUMBER_BYTES + fcsl_journal_capacity(reproduction->journal);
}

static int put_writes(reproduction_t *reproduction, fcsl_mirror_t *mirror, const fcsl_moment_t *moment)
{
    uint8_t *message = reproduction->message + NUMBER_BYTES;
    const size_t capacity = fcsl_journal_capacity(reproduction->journal);
    uint64_t number = 0;
    size_t size = 0;
    int failed = 0;
    while ((size = fcsl_journal_take(reproduction->journal, moment->next_write, &number, message, capacity)) > 0) {
        fcsl_put_u64(reproduction->message, number);
        failed = fcsl_mirror_post_write(mirror, reproduction->message, NUMBER_BYTES + size) != 0 || failed;
    }
    return fcsl_mirror_post_written(mirror, moment->tick, moment->next_write) != 0 || failed ? -1 : 0;
}

static void answer_checkpoint(reproduction_t *reproduction, fcsl_mirror_t *mirror, const fcsl_moment_t *moment,
                              const uint8_t *publication)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (now_ns - reproduction->answered_ns < CHECKPOINT_NS) {
        return;
    }
    reproduction->answered_ns = now_ns;
    fcsl_put_u64(reproduction->message, moment->next_write);
    const size_t size =
        fcsl_journal_checkpoint(reproduction->journal, publication, moment->tick, reproduction->message + NUMBER_BYTES,
                                fcsl_journal_capacity(reproduction->journal));
    /* Refused: it is longer than a message of the bus, and nobody gets one. */
    (void)fcsl_mirror_answer_checkpoint(mirror, reproduction->message, size > 0 ? NUMBER_BYTES + size : 0);
}

int reproduction_put(reproduction_t *reproduction, fcsl_mirror_t *mirror, const fcsl_moment_t *moment,
                     const uint8_t *publication)
{
    if (moment->next_write == 0) {
        return 0;
    }
    const int failed = put_writes(reproduction, mirror, moment);
    answer_checkpoint(reproduction, mirror, moment, publication);
    return failed;
}
