/* SPDX-License-Identifier: Apache-2.0
 *
 * A ring of seqlocks (fcsl_seqlock.h). A slot is a sequence, the moment's words and the memory's words; its even sequence is the number
 * of its publication. The publishing thread is the step thread; readers are any number of others. A reader that is slower than the ring
 * is long finds another number in its slot.
 */
#include "fcsl/fcsl_history.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_seqlock.h"
#include "fcsl/fcsl_tick_time.h"

enum { MOMENT_WORDS = sizeof(fcsl_moment_t) / 8, HEAD_WORDS = 1 + MOMENT_WORDS, TRIES = 64 };
_Static_assert(sizeof(fcsl_moment_t) % 8 == 0, "a moment is whole words");

static uint64_t sequence_of(uint64_t number)
{
    return 2u * number + 2u;
}

int fcsl_history_open(fcsl_history_t *history, const fcsl_part_t *parts, uint32_t part_count, uint32_t slots)
{
    memset(history, 0, sizeof *history);
    history->slots = slots;
    history->part_count = part_count;
    history->slot_words = HEAD_WORDS;
    for (uint32_t i = 0; i < part_count; i++) {
        history->slot_words += fcsl_seqlock_words(parts[i].size);
    }
    history->parts = malloc((part_count + 1u) * sizeof *history->parts);
    history->words = calloc(history->slot_words * slots, sizeof *history->words);
    if (history->parts == NULL || history->words == NULL) {
        fcsl_history_free(history);
        return -1;
    }
    memcpy(history->parts, parts, part_count * sizeof *parts);
    /* Touch every page now: the publishing thread shall not fault them in. */
    memset((void *)history->words, 0, history->slot_words * slots * sizeof *history->words);
    return 0;
}

void fcsl_history_free(fcsl_history_t *history)
{
    free(history->parts);
    free((void *)history->words);
    history->parts = NULL;
    history->words = NULL;
}

size_t fcsl_history_bytes(const fcsl_history_t *history)
{
    return (history->slot_words - HEAD_WORDS) * 8u;
}

size_t fcsl_history_part(const fcsl_history_t *history, uint32_t part)
{
    size_t words = 0;
    for (uint32_t i = 0; i < part; i++) {
        words += fcsl_seqlock_words(history->parts[i].size);
    }
    return words * 8u;
}

static _Atomic uint64_t *slot_of(const fcsl_history_t *history, uint64_t number)
{
    return history->words + (size_t)(number & (history->slots - 1u)) * history->slot_words;
}

void fcsl_history_publish(fcsl_history_t *history, const fcsl_moment_t *moment)
{
    const uint64_t number = atomic_load_explicit(&history->published, memory_order_relaxed);
    _Atomic uint64_t *slot = slot_of(history, number);
    fcsl_seqlock_begin(slot, sequence_of(number) - 1u);
    fcsl_seqlock_store(slot + 1, moment, sizeof *moment);
    _Atomic uint64_t *words = slot + HEAD_WORDS;
    for (uint32_t i = 0; i < history->part_count; i++) {
        fcsl_seqlock_store(words, history->parts[i].data, history->parts[i].size);
        words += fcsl_seqlock_words(history->parts[i].size);
    }
    fcsl_seqlock_end(slot, sequence_of(number));
    atomic_store_explicit(&history->published, number + 1u, memory_order_release);
}

uint64_t fcsl_history_published(const fcsl_history_t *history)
{
    return atomic_load_explicit(&history->published, memory_order_acquire);
}

fcsl_history_status_t fcsl_history_read(const fcsl_history_t *history, uint64_t number, fcsl_moment_t *moment,
                                        uint8_t *bytes)
{
    if (number >= fcsl_history_published(history)) {
        return FCSL_HISTORY_COMING;
    }
    const _Atomic uint64_t *slot = slot_of(history, number);
    if (atomic_load_explicit(slot, memory_order_acquire) != sequence_of(number)) {
        return FCSL_HISTORY_OVERWRITTEN;
    }
    fcsl_seqlock_load(moment, slot + 1, sizeof *moment);
    fcsl_seqlock_load(bytes, slot + HEAD_WORDS, fcsl_history_bytes(history));
    return fcsl_seqlock_unchanged(slot, sequence_of(number)) ? FCSL_HISTORY_OK : FCSL_HISTORY_OVERWRITTEN;
}

uint64_t fcsl_history_catch_up(const fcsl_history_t *history, uint64_t number)
{
    const uint64_t published = fcsl_history_published(history);
    const uint64_t kept = history->slots / 2u;
    return published > number + kept ? published - kept : number + 1u;
}

uint64_t fcsl_history_poll_ns(const fcsl_history_t *history, uint64_t tick_hz)
{
    const uint64_t least_ns = 50000u;
    const uint64_t most_ns = 2000000u;
    const uint64_t poll_ns = FCSL_NS_PER_S / tick_hz * history->slots / 8u;
    return poll_ns < least_ns ? least_ns : poll_ns > most_ns ? most_ns : poll_ns;
}

fcsl_history_status_t fcsl_history_latest(const fcsl_history_t *history, fcsl_moment_t *moment, uint8_t *bytes)
{
    for (int i = 0; i < TRIES; i++) {
        const uint64_t published = fcsl_history_published(history);
        if (published == 0) {
            return FCSL_HISTORY_COMING;
        }
        if (fcsl_history_read(history, published - 1u, moment, bytes) == FCSL_HISTORY_OK) {
            return FCSL_HISTORY_OK;
        }
    }
    return FCSL_HISTORY_OVERWRITTEN;
}
