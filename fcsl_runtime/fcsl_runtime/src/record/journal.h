/* SPDX-License-Identifier: Apache-2.0
 *
 * The side of the thread that owns the run, of fcsl_journal.h.
 */
#ifndef FCSL_RECORD_JOURNAL_H
#define FCSL_RECORD_JOURNAL_H

#include "fcsl/fcsl_journal.h"
#include "messages/record_messages.h"
#include "ring.h"

struct fcsl_journal {
    const fcsl_machine_t *machine;
    size_t capacity; /* of the longest message */
    fcsl_ring_t ring;
    atomic_int wanted; /* by the thread that follows */

    /* The thread that owns the run. */
    int followed;  /* as it was wanted at the last publication */
    uint64_t next; /* write's number */
};

/* Null: out of memory. */
fcsl_journal_t *fcsl_journal_open(const fcsl_machine_t *machine);
/* What fcsl_run_next_write returns. */
uint64_t fcsl_journal_next_write(fcsl_journal_t *journal);

/* Accepts null. */
static inline int fcsl_journal_is_followed(const fcsl_journal_t *journal)
{
    return journal != NULL && journal->followed;
}

/* Copies a write that `tick` is the first to see. */
void fcsl_journal_note(fcsl_journal_t *journal, uint64_t tick, const fcsl_write_t *write);
/* Accepts null. */
void fcsl_journal_close(fcsl_journal_t *journal);

#endif /* FCSL_RECORD_JOURNAL_H */
