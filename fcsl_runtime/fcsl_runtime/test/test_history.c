/* SPDX-License-Identifier: Apache-2.0
 *
 * The history between a thread that publishes and threads that read: what is read is one publication, whole. The source is
 * compiled in, so that a publisher with a seeded defect can be shown to be found.
 */
#include "history/history.c"

#include <pthread.h>

#include "fcsl/fcsl_check.h"

enum { WORDS = 61, SLOTS = 4, PUBLICATIONS = 50000, READERS = 2, TRIES_MAX = 100000000 };

/* What is published, in two parts, the second one not of whole words: every byte is a function of the number. */
typedef struct {
    uint64_t words[WORDS];
    uint8_t tail[13];
    fcsl_history_t history;
    atomic_int over;
} shared_t;

static uint64_t word_of(uint64_t number, uint64_t i)
{
    return (number + i) * 0x9e3779b97f4a7c15u;
}

static void fill(shared_t *shared, uint64_t number)
{
    for (uint64_t i = 0; i < WORDS; i++) {
        shared->words[i] = word_of(number, i);
    }
    memset(shared->tail, (int)(number & 0xff), sizeof shared->tail);
}

static void open_shared(shared_t *shared)
{
    memset(shared, 0, sizeof *shared);
    const fcsl_part_t parts[] = {{shared->words, sizeof shared->words}, {shared->tail, sizeof shared->tail}};
    CHECK(fcsl_history_open(&shared->history, parts, 2, SLOTS) == 0);
    CHECK(fcsl_history_bytes(&shared->history) == WORDS * 8 + 16);
    CHECK(fcsl_history_part(&shared->history, 0) == 0 && fcsl_history_part(&shared->history, 1) == WORDS * 8);
}

/* Whether what was read is what was published under its own number. */
static int is_whole(const fcsl_moment_t *moment, const uint8_t *bytes)
{
    uint64_t words[WORDS];
    memcpy(words, bytes, sizeof words);
    int whole = moment->time_ns == word_of(moment->tick, 1000) && moment->paused == (moment->tick & 1u);
    for (uint64_t i = 0; i < WORDS; i++) {
        whole = whole && words[i] == word_of(moment->tick, i);
    }
    for (size_t i = 0; i < 13; i++) {
        whole = whole && bytes[sizeof words + i] == (uint8_t)moment->tick;
    }
    return whole;
}

static fcsl_moment_t moment_of(uint64_t number)
{
    return (fcsl_moment_t){.tick = number, .time_ns = word_of(number, 1000), .paused = number & 1u};
}

static void *read_latest(void *argument)
{
    const shared_t *shared = argument;
    uint8_t bytes[WORDS * 8 + 16];
    fcsl_moment_t moment;
    uint64_t last = 0;
    uint64_t different = 0;
    /* A busy machine may let a reader run only once all is over: it looks once more then. */
    for (int over = 0; !over;) {
        over = atomic_load(&shared->over);
        const fcsl_history_status_t status = fcsl_history_latest(&shared->history, &moment, bytes);
        if (status == FCSL_HISTORY_OK) {
            CHECK(is_whole(&moment, bytes));
            CHECK(moment.tick >= last);
            different += moment.tick > last;
            last = moment.tick;
        }
    }
    CHECK(different > 0);
    return NULL;
}

/* Asks for every publication in turn: each is whole, or gone. */
static void *read_all(void *argument)
{
    const shared_t *shared = argument;
    uint8_t bytes[WORDS * 8 + 16];
    fcsl_moment_t moment;
    uint64_t got = 0;
    for (uint64_t number = 0; number < PUBLICATIONS;) {
        const fcsl_history_status_t status = fcsl_history_read(&shared->history, number, &moment, bytes);
        if (status == FCSL_HISTORY_OK) {
            CHECK(moment.tick == number && is_whole(&moment, bytes));
            got++;
        }
        number += status != FCSL_HISTORY_COMING;
    }
    CHECK(got > 0); /* the last ones stay */
    return NULL;
}

static void test_threads(void)
{
    static shared_t shared;
    pthread_t latest[READERS];
    pthread_t all;
    open_shared(&shared);
    for (int i = 0; i < READERS; i++) {
        CHECK(pthread_create(&latest[i], NULL, read_latest, &shared) == 0);
    }
    CHECK(pthread_create(&all, NULL, read_all, &shared) == 0);
    for (uint64_t number = 0; number < PUBLICATIONS; number++) {
        const fcsl_moment_t moment = moment_of(number);
        fill(&shared, number);
        fcsl_history_publish(&shared.history, &moment);
    }
    CHECK(pthread_join(all, NULL) == 0);
    atomic_store(&shared.over, 1);
    for (int i = 0; i < READERS; i++) {
        CHECK(pthread_join(latest[i], NULL) == 0);
    }
    fcsl_history_free(&shared.history);
}

/* The seeded defect: the slot is not marked while it is written. */
static void *publish_unmarked(void *argument)
{
    shared_t *shared = argument;
    for (uint64_t number = 0; !atomic_load(&shared->over); number++) {
        const fcsl_moment_t moment = moment_of(number);
        fill(shared, number);
        fcsl_history_t *history = &shared->history;
        _Atomic uint64_t *slot = slot_of(history, number);
        atomic_store(&slot[0], sequence_of(number));
        atomic_store(&history->published, number + 1u);
        store_words(slot + 1, (const uint8_t *)&moment, sizeof moment);
        store_words(slot + HEAD_WORDS, (const uint8_t *)shared->words, sizeof shared->words);
        store_words(slot + HEAD_WORDS + WORDS, shared->tail, sizeof shared->tail);
    }
    return NULL;
}

static void test_control(void)
{
    static shared_t shared;
    uint8_t bytes[WORDS * 8 + 16];
    fcsl_moment_t moment;
    pthread_t writer;
    open_shared(&shared);
    CHECK(pthread_create(&writer, NULL, publish_unmarked, &shared) == 0);
    int torn = 0;
    for (uint64_t i = 0; i < TRIES_MAX && !torn; i++) {
        torn = fcsl_history_latest(&shared.history, &moment, bytes) == FCSL_HISTORY_OK && !is_whole(&moment, bytes);
    }
    atomic_store(&shared.over, 1);
    CHECK(pthread_join(writer, NULL) == 0);
    CHECK(torn);
    fcsl_history_free(&shared.history);
}

static void test_one_thread(void)
{
    static shared_t shared;
    uint8_t bytes[WORDS * 8 + 16];
    fcsl_moment_t moment;
    open_shared(&shared);
    CHECK(fcsl_history_latest(&shared.history, &moment, bytes) == FCSL_HISTORY_COMING);
    for (uint64_t number = 0; number < 3u * SLOTS; number++) {
        CHECK(fcsl_history_read(&shared.history, number, &moment, bytes) == FCSL_HISTORY_COMING);
        moment = moment_of(number);
        fill(&shared, number);
        fcsl_history_publish(&shared.history, &moment);
        CHECK(fcsl_history_published(&shared.history) == number + 1u);
        CHECK(fcsl_history_latest(&shared.history, &moment, bytes) == FCSL_HISTORY_OK && moment.tick == number);
        for (uint64_t past = 0; past <= number; past++) {
            const int kept = past + SLOTS > number;
            CHECK(fcsl_history_read(&shared.history, past, &moment, bytes) ==
                  (kept ? FCSL_HISTORY_OK : FCSL_HISTORY_GONE));
            CHECK(!kept || (moment.tick == past && is_whole(&moment, bytes)));
            const uint64_t next = fcsl_history_catch_up(&shared.history, past);
            CHECK(next == (kept && past + SLOTS / 2 > number ? past + 1u : number + 1u - SLOTS / 2));
        }
    }
    fcsl_history_free(&shared.history);
}

int main(void)
{
    test_one_thread();
    test_threads();
    test_control();
    return 0;
}
