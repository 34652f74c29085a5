/* SPDX-License-Identifier: Apache-2.0
 *
 * Every message begins with a number: that of the write, or of the first one behind the checkpoint.
 */
#include "reproduction.h"

#include "fcsl/fcsl_scalar.h"

enum { NUMBER_BYTES = 8 };
/* A checkpoint is copied this often at most. */
static const uint64_t CHECKPOINT_NS = 20000000u;

size_t fcsl_observers_write_bytes(const fcsl_journal_t *journal)
{
    return NUMBER_BYTES + fcsl_journal_capacity(journal);
}

int fcsl_observers_post_writes(fcsl_observers_t *o, const fcsl_moment_t *moment)
{
    uint8_t *message = o->message + NUMBER_BYTES;
    const size_t capacity = fcsl_journal_capacity(o->journal);
    uint64_t number = 0;
    size_t size = 0;
    int failed = 0;
    if (moment->next_write == 0) {
        return 0;
    }
    while ((size = fcsl_journal_take(o->journal, moment->next_write, &number, message, capacity)) > 0) {
        fcsl_put_u64(o->message, number);
        failed = fcsl_mirror_post_write(o->mirror, o->message, NUMBER_BYTES + size) != 0 || failed;
    }
    return fcsl_mirror_post_written(o->mirror, moment->tick, moment->next_write) != 0 || failed ? -1 : 0;
}

void fcsl_observers_answer_checkpoint(fcsl_observers_t *o, const fcsl_moment_t *moment)
{
    const uint64_t now_ns = fcsl_run_monotonic_ns(NULL);
    if (moment->next_write == 0 || now_ns - o->answered_ns < CHECKPOINT_NS) {
        return;
    }
    o->answered_ns = now_ns;
    fcsl_put_u64(o->message, moment->next_write);
    const size_t size = fcsl_journal_checkpoint(o->journal, o->publication, moment->tick, o->message + NUMBER_BYTES,
                                                fcsl_journal_capacity(o->journal));
    /* Refused: it is longer than a message of the bus, and nobody gets one. */
    (void)fcsl_mirror_answer_checkpoint(o->mirror, o->message, size > 0 ? NUMBER_BYTES + size : 0);
}
