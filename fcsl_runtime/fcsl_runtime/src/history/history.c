/* SPDX-License-Identifier: Apache-2.0
 *
 * A slot is a sequence word, the moment's words and the memory's words. The writer makes the sequence odd, writes, and
 * makes it the even number of its publication; a reader that finds the same even number before and behind its copy has one
 * publication whole. Words are stored with release and loaded with acquire, so a reader that has seen one new word also
 * sees the odd sequence; on x86 both are plain moves.
 */
#include "fcsl/fcsl_history.h"

#include <stdlib.h>
#include <string.h>

enum { MOMENT_WORDS = sizeof(fcsl_moment_t) / 8, HEAD_WORDS = 1 + MOMENT_WORDS, TRIES = 64 };
_Static_assert(sizeof(fcsl_moment_t) % 8 == 0, "a moment is whole words");

static size_t words_of(uint32_t bytes)
{
    return ((size_t)bytes + 7u) / 8u;
}

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
        history->slot_words += words_of(parts[i].size);
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
        words += words_of(history->parts[i].size);
    }
    return words * 8u;
}

static _Atomic uint64_t *slot_of(const fcsl_history_t *history, uint64_t number)
{
    return history->words + (size_t)(number & (history->slots - 1u)) * history->slot_words;
}

static void store_words(_Atomic uint64_t *words, const uint8_t *bytes, uint32_t size)
{
    const uint32_t whole = size / 8u;
    uint64_t word = 0;
    for (uint32_t i = 0; i < whole; i++) {
        memcpy(&word, bytes + (size_t)i * 8u, 8);
        atomic_store_explicit(&words[i], word, memory_order_release);
    }
    if (size % 8u != 0) {
        word = 0;
        memcpy(&word, bytes + (size_t)whole * 8u, size % 8u);
        atomic_store_explicit(&words[whole], word, memory_order_release);
    }
}

static void load_words(uint8_t *bytes, const _Atomic uint64_t *words, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const uint64_t word = atomic_load_explicit(&words[i], memory_order_acquire);
        memcpy(bytes + i * 8u, &word, 8);
    }
}

void fcsl_history_publish(fcsl_history_t *history, const fcsl_moment_t *moment)
{
    const uint64_t number = atomic_load_explicit(&history->published, memory_order_relaxed);
    _Atomic uint64_t *slot = slot_of(history, number);
    atomic_store_explicit(&slot[0], sequence_of(number) - 1u, memory_order_relaxed);
    store_words(slot + 1, (const uint8_t *)moment, sizeof *moment);
    _Atomic uint64_t *words = slot + HEAD_WORDS;
    for (uint32_t i = 0; i < history->part_count; i++) {
        store_words(words, history->parts[i].data, history->parts[i].size);
        words += words_of(history->parts[i].size);
    }
    atomic_store_explicit(&slot[0], sequence_of(number), memory_order_release);
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
    if (atomic_load_explicit(&slot[0], memory_order_acquire) != sequence_of(number)) {
        return FCSL_HISTORY_GONE;
    }
    load_words((uint8_t *)moment, slot + 1, MOMENT_WORDS);
    load_words(bytes, slot + HEAD_WORDS, history->slot_words - HEAD_WORDS);
    return atomic_load_explicit(&slot[0], memory_order_relaxed) == sequence_of(number) ? FCSL_HISTORY_OK
                                                                                       : FCSL_HISTORY_GONE;
}

uint64_t fcsl_history_catch_up(const fcsl_history_t *history, uint64_t number)
{
    const uint64_t published = fcsl_history_published(history);
    const uint64_t kept = history->slots / 2u;
    return published > number + kept ? published - kept : number + 1u;
}

uint64_t fcsl_history_nap_ns(const fcsl_history_t *history, uint64_t tick_hz)
{
    const uint64_t least_ns = 50000u;
    const uint64_t most_ns = 2000000u;
    const uint64_t nap_ns = UINT64_C(1000000000) / tick_hz * history->slots / 8u;
    return nap_ns < least_ns ? least_ns : nap_ns > most_ns ? most_ns : nap_ns;
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
    return FCSL_HISTORY_GONE;
}
