/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "mailbox.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

int mailbox_open(mailbox_t *mailbox, const fcsl_machine_t *machine)
{
    memset(mailbox, 0, sizeof *mailbox);
    mailbox->command.bytes = calloc(1, machine->size);
    if (mailbox->command.bytes == NULL) {
        return -1;
    }
    if (sem_init(&mailbox->arrived, 0, 0) != 0) {
        free(mailbox->command.bytes);
        return -1;
    }
    if (sem_init(&mailbox->answered, 0, 0) != 0) {
        (void)sem_destroy(&mailbox->arrived);
        free(mailbox->command.bytes);
        return -1;
    }
    return 0;
}

void mailbox_free(mailbox_t *mailbox)
{
    (void)sem_destroy(&mailbox->arrived);
    (void)sem_destroy(&mailbox->answered);
    free(mailbox->command.bytes);
    mailbox->command.bytes = NULL;
}

void mailbox_call(mailbox_t *mailbox)
{
    atomic_store(&mailbox->pending, 1);
    (void)sem_post(&mailbox->arrived);
    while (sem_wait(&mailbox->answered) != 0 && errno == EINTR) {
    }
}

command_t *mailbox_take(mailbox_t *mailbox)
{
    return atomic_load(&mailbox->pending) ? &mailbox->command : NULL;
}

void mailbox_answer(mailbox_t *mailbox)
{
    /* The token of this command may still be there when it was noticed by its flag: take it back. */
    (void)sem_trywait(&mailbox->arrived);
    atomic_store(&mailbox->pending, 0);
    (void)sem_post(&mailbox->answered);
}

void mailbox_wait(mailbox_t *mailbox, uint64_t deadline_ns)
{
    const struct timespec until = {.tv_sec = (time_t)(deadline_ns / 1000000000u),
                                   .tv_nsec = (long)(deadline_ns % 1000000000u)};
    (void)sem_clockwait(&mailbox->arrived, CLOCK_MONOTONIC, &until);
}
