/* SPDX-License-Identifier: Apache-2.0
 *
 * Entries of the ring: number and write, then the data. Both ends are here.
 */
#include "journal.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_tick_time.h"

/* Of a message, besides data and names; and of the ring, of which an entry may take a half. */
enum { HEAD_BYTES = 512, RING_BYTES_MIN = 1 << 20, RING_MESSAGES = 4 };

typedef struct {
    uint64_t number;
    fcsl_write_t write; /* its `data` means nothing */
} entry_t;

/* ---- the thread that owns the run --------------------------------------------------------------------------------- */

/* That of a checkpoint or of a restore, or of a write with the longest name. */
static size_t longest_message(const fcsl_machine_t *machine)
{
    size_t longest = strlen(machine->name);
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const size_t length = strlen(machine->fields[i].path);
        longest = length > longest ? length : longest;
    }
    for (uint32_t i = 0; i < machine->state_count; i++) {
        const size_t length = strlen(machine->states[i].name);
        longest = length > longest ? length : longest;
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const size_t length = strlen(machine->channels[i].name);
        longest = length > longest ? length : longest;
    }
    return HEAD_BYTES + longest + machine->size;
}

fcsl_journal_t *fcsl_journal_open(const fcsl_machine_t *machine)
{
    fcsl_journal_t *journal = calloc(1, sizeof *journal);
    if (journal == NULL) {
        return NULL;
    }
    journal->machine = machine;
    journal->capacity = longest_message(machine);
    const size_t ring = RING_MESSAGES * journal->capacity;
    if (fcsl_ring_open(&journal->ring, ring > RING_BYTES_MIN ? ring : RING_BYTES_MIN) != 0) {
        free(journal);
        return NULL;
    }
    return journal;
}

void fcsl_journal_close(fcsl_journal_t *journal)
{
    if (journal != NULL) {
        fcsl_ring_free(&journal->ring);
        free(journal);
    }
}

uint64_t fcsl_journal_next_write(fcsl_journal_t *journal)
{
    const int wanted = atomic_load_explicit(&journal->wanted, memory_order_relaxed);
    journal->next += wanted && !journal->followed; /* who was here before finds the gap */
    journal->followed = wanted;
    return wanted ? journal->next : 0;
}

void fcsl_journal_note(fcsl_journal_t *journal, uint64_t tick, const fcsl_write_t *write)
{
    const entry_t entry = {.number = journal->next++, .write = *write};
    const fcsl_record_t record = {.tick = tick, .size = (uint32_t)sizeof entry + write->size};
    uint8_t *out = fcsl_ring_claim(&journal->ring, &record, FCSL_RING_DROP);
    if (out == NULL) {
        return; /* the numbers tell */
    }
    memcpy(out, &entry, sizeof entry);
    if (write->size > 0) {
        memcpy(out + sizeof entry, write->data, write->size);
    }
    fcsl_ring_publish(&journal->ring);
}

/* ---- the thread that follows -------------------------------------------------------------------------------------- */

void fcsl_journal_follow(fcsl_journal_t *journal, int follow)
{
    atomic_store_explicit(&journal->wanted, follow, memory_order_relaxed);
}

size_t fcsl_journal_capacity(const fcsl_journal_t *journal)
{
    return journal->capacity;
}

static fcsl_stamp_t stamp_of(const fcsl_journal_t *journal, uint64_t tick)
{
    return (fcsl_stamp_t){.tick = tick, .time_ns = fcsl_tick_time_ns(journal->machine->tick_hz, tick)};
}

size_t fcsl_journal_take(fcsl_journal_t *journal, uint64_t end, uint64_t *number, uint8_t *bytes, size_t capacity)
{
    fcsl_record_t record;
    const uint8_t *data = NULL;
    entry_t entry;
    if (fcsl_ring_front(&journal->ring, &record, &data) != FCSL_RING_RECORD) {
        return 0;
    }
    memcpy(&entry, data, sizeof entry);
    if (entry.number >= end) {
        return 0;
    }
    entry.write.data = data + sizeof entry;
    *number = entry.number;
    const size_t size = fcsl_write_message(&entry.write, stamp_of(journal, record.tick), bytes, capacity);
    fcsl_ring_pop(&journal->ring);
    return size;
}

void fcsl_journal_pass(fcsl_journal_t *journal)
{
    fcsl_record_t record;
    const uint8_t *data = NULL;
    size_t passed = 0;
    while (passed < journal->ring.capacity && fcsl_ring_front(&journal->ring, &record, &data) == FCSL_RING_RECORD) {
        passed += record.size + sizeof record;
        fcsl_ring_pop(&journal->ring);
    }
}

size_t fcsl_journal_checkpoint(const fcsl_journal_t *journal, const void *data, uint64_t tick, uint8_t *bytes,
                               size_t capacity)
{
    return fcsl_checkpoint_message(journal->machine, data, stamp_of(journal, tick), bytes, capacity);
}
