/* SPDX-License-Identifier: Apache-2.0
 *
 * The one slot through which a command meets the step thread.
 */
#define _GNU_SOURCE
#include "mailbox.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_monotonic.h"

enum { FREE, POSTED, ANSWERED };

int fcsl_mailbox_open(mailbox_t *mailbox, size_t bytes)
{
    memset(mailbox, 0, sizeof *mailbox);
    mailbox->command.bytes = calloc(1, bytes);
    mailbox->command.writes = calloc(WRITES_MAX, sizeof *mailbox->command.writes);
    mailbox->command.hardware = calloc(1, sizeof *mailbox->command.hardware);
    if (mailbox->command.bytes == NULL || mailbox->command.writes == NULL || mailbox->command.hardware == NULL ||
        sem_init(&mailbox->arrived, 0, 0) != 0) {
        fcsl_mailbox_free(mailbox);
        return -1;
    }
    return 0;
}

void fcsl_mailbox_free(mailbox_t *mailbox)
{
    free(mailbox->command.bytes);
    free(mailbox->command.writes);
    free(mailbox->command.hardware);
    mailbox->command.bytes = NULL;
    mailbox->command.writes = NULL;
    mailbox->command.hardware = NULL;
}

int fcsl_mailbox_is_free(const mailbox_t *mailbox)
{
    return atomic_load_explicit(&mailbox->phase, memory_order_acquire) == FREE;
}

void fcsl_mailbox_post(mailbox_t *mailbox)
{
    atomic_store_explicit(&mailbox->phase, POSTED, memory_order_release);
    (void)sem_post(&mailbox->arrived);
}

int fcsl_mailbox_done(mailbox_t *mailbox)
{
    if (atomic_load_explicit(&mailbox->phase, memory_order_acquire) != ANSWERED) {
        return 0;
    }
    atomic_store_explicit(&mailbox->phase, FREE, memory_order_release);
    return 1;
}

command_t *fcsl_mailbox_take(mailbox_t *mailbox)
{
    return atomic_load_explicit(&mailbox->phase, memory_order_acquire) == POSTED ? &mailbox->command : NULL;
}

void fcsl_mailbox_answer(mailbox_t *mailbox)
{
    /* The token of this command may still be there when it was noticed by its phase: take it back. */
    (void)sem_trywait(&mailbox->arrived);
    atomic_store_explicit(&mailbox->phase, ANSWERED, memory_order_release);
}

void fcsl_mailbox_wait(mailbox_t *mailbox, uint64_t deadline_ns)
{
    const struct timespec until = fcsl_timespec_of(deadline_ns);
    (void)sem_clockwait(&mailbox->arrived, CLOCK_MONOTONIC, &until);
}

void fcsl_mailbox_wake(mailbox_t *mailbox)
{
    (void)sem_post(&mailbox->arrived);
}
