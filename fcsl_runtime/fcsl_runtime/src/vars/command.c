/* SPDX-License-Identifier: Apache-2.0
 *
 * The one slot through which a command reaches the step thread.
 */
#define _GNU_SOURCE
#include "command.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_monotonic.h"

enum { SLOT_FREE, SLOT_POSTED, SLOT_DONE };

int fcsl_slot_open(slot_t *slot, size_t bytes)
{
    memset(slot, 0, sizeof *slot);
    slot->command.bytes = calloc(1, bytes);
    slot->command.writes = calloc(WRITES_MAX, sizeof *slot->command.writes);
    slot->command.hardware = calloc(1, sizeof *slot->command.hardware);
    if (slot->command.bytes == NULL || slot->command.writes == NULL || slot->command.hardware == NULL ||
        sem_init(&slot->arrived, 0, 0) != 0) {
        fcsl_slot_free(slot);
        return -1;
    }
    return 0;
}

void fcsl_slot_free(slot_t *slot)
{
    free(slot->command.bytes);
    free(slot->command.writes);
    free(slot->command.hardware);
    slot->command.bytes = NULL;
    slot->command.writes = NULL;
    slot->command.hardware = NULL;
}

int fcsl_slot_is_free(const slot_t *slot)
{
    return atomic_load_explicit(&slot->phase, memory_order_acquire) == SLOT_FREE;
}

void fcsl_slot_post(slot_t *slot)
{
    atomic_store_explicit(&slot->phase, SLOT_POSTED, memory_order_release);
    (void)sem_post(&slot->arrived);
}

int fcsl_slot_take_back(slot_t *slot)
{
    if (atomic_load_explicit(&slot->phase, memory_order_acquire) != SLOT_DONE) {
        return 0;
    }
    atomic_store_explicit(&slot->phase, SLOT_FREE, memory_order_release);
    return 1;
}

command_t *fcsl_slot_take(slot_t *slot)
{
    return atomic_load_explicit(&slot->phase, memory_order_acquire) == SLOT_POSTED ? &slot->command : NULL;
}

void fcsl_slot_finish(slot_t *slot)
{
    /* The token of this command may still be there when it was noticed by its phase: take it back. */
    (void)sem_trywait(&slot->arrived);
    atomic_store_explicit(&slot->phase, SLOT_DONE, memory_order_release);
}

void fcsl_slot_wait(slot_t *slot, uint64_t deadline_ns)
{
    const struct timespec until = fcsl_timespec_of(deadline_ns);
    (void)sem_clockwait(&slot->arrived, CLOCK_MONOTONIC, &until);
}

void fcsl_slot_wake(slot_t *slot)
{
    (void)sem_post(&slot->arrived);
}
