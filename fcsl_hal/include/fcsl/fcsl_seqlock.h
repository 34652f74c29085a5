/* SPDX-License-Identifier: Apache-2.0
 *
 * A seqlock: words that one thread or process writes, and others copy whole, in memory that they share. The writer never waits and
 * makes no system call; it may die at any place.
 *
 *   writer: begin(odd) store … end(even)        reader: even = sequence, load …, unchanged(even)?
 *
 * The sequence is odd while words are written; each even number belongs to one state of them. A reader that finds the same even number
 * before and behind its copy has one state whole; else it tries again, a bounded number of times. Words are stored with release and
 * loaded with acquire: a reader that has got one new word also sees the odd sequence, which was stored before it, so its second look
 * finds another number. On x86 all of these are plain moves.
 *
 * Two writers break it, and so does a reader that uses a copy before its second look.
 */
#ifndef FCSL_SEQLOCK_H
#define FCSL_SEQLOCK_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

_Static_assert(ATOMIC_LLONG_LOCK_FREE == 2, "processes share the words, so they need no lock");

enum { FCSL_SEQLOCK_WORD_BYTES = 8 };

/* Words that hold `size` bytes. */
static inline size_t fcsl_seqlock_words(size_t size)
{
    return (size + FCSL_SEQLOCK_WORD_BYTES - 1u) / FCSL_SEQLOCK_WORD_BYTES;
}

static inline void fcsl_seqlock_begin(_Atomic uint64_t *sequence, uint64_t odd)
{
    atomic_store_explicit(sequence, odd, memory_order_relaxed);
}

/* The last word is filled up with zeros. */
static inline void fcsl_seqlock_store(_Atomic uint64_t *words, const void *bytes, size_t size)
{
    const size_t whole = size / FCSL_SEQLOCK_WORD_BYTES;
    uint64_t word = 0;
    for (size_t i = 0; i < whole; i++) {
        memcpy(&word, (const uint8_t *)bytes + i * FCSL_SEQLOCK_WORD_BYTES, sizeof word);
        atomic_store_explicit(&words[i], word, memory_order_release);
    }
    if (size % FCSL_SEQLOCK_WORD_BYTES != 0) {
        word = 0;
        memcpy(&word, (const uint8_t *)bytes + whole * FCSL_SEQLOCK_WORD_BYTES, size % FCSL_SEQLOCK_WORD_BYTES);
        atomic_store_explicit(&words[whole], word, memory_order_release);
    }
}

static inline void fcsl_seqlock_end(_Atomic uint64_t *sequence, uint64_t even)
{
    atomic_store_explicit(sequence, even, memory_order_release);
}

static inline void fcsl_seqlock_load(void *bytes, const _Atomic uint64_t *words, size_t size)
{
    for (size_t at = 0; at < size; at += FCSL_SEQLOCK_WORD_BYTES) {
        const size_t left = size - at;
        const uint64_t word = atomic_load_explicit(&words[at / FCSL_SEQLOCK_WORD_BYTES], memory_order_acquire);
        memcpy((uint8_t *)bytes + at, &word, left < FCSL_SEQLOCK_WORD_BYTES ? left : FCSL_SEQLOCK_WORD_BYTES);
    }
}

/* Behind the copy: whether it is whole. */
static inline int fcsl_seqlock_unchanged(const _Atomic uint64_t *sequence, uint64_t even)
{
    return atomic_load_explicit(sequence, memory_order_relaxed) == even;
}

#endif /* FCSL_SEQLOCK_H */
