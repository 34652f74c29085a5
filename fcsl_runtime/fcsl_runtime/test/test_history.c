/* SPDX-License-Identifier: Apache-2.0
 *
 * The history between a thread that publishes and threads that read: what is read is one publication, whole. The source is
 * compiled in with hooks before each atomic access: a test tries every point at which a writer can overtake a reader, and
 * shows that a publisher with a seeded defect is found.
 */
#include <setjmp.h>
#include <stdatomic.h>
#include <stdint.h>

static void before_load(void);
static void before_store(void);

#ifdef __clang__
#define LOAD(from, order)       __c11_atomic_load((from), (order))
#define STORE(to, value, order) __c11_atomic_store((to), (value), (order))
#else
#define LOAD(from, order)       __atomic_load_n((from), (order))
#define STORE(to, value, order) __atomic_store_n((to), (value), (order))
#endif
#undef atomic_load_explicit
#undef atomic_store_explicit
#define atomic_load_explicit(from, order)       (before_load(), LOAD((from), (order)))
#define atomic_store_explicit(to, value, order) (before_store(), STORE((to), (value), (order)))

#include "history/history.c"

#include <pthread.h>

#include "fcsl_check.h"

enum { WORDS = 61, SLOTS = 4, PUBLICATIONS = 50000, READERS = 2 };

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

typedef void (*publisher_t)(shared_t *shared, uint64_t number);

/* One interleaving in one thread: before load `loads` of a reader, `publish` makes `stores` stores of its publication. */
static struct {
    shared_t *shared;
    publisher_t publish;
    int loads;  /* left before the writer runs; negative: it has run, or there is none */
    int stores; /* left before it stops; negative: no limit */
    jmp_buf stopped;
} overtaking = {.loads = -1, .stores = -1};

static void before_load(void)
{
    if (overtaking.loads < 0 || overtaking.loads-- > 0) {
        return;
    }
    if (setjmp(overtaking.stopped) == 0) {
        overtaking.publish(overtaking.shared, SLOTS);
    }
    overtaking.stores = -1;
}

static void before_store(void)
{
    if (overtaking.stores >= 0 && overtaking.stores-- == 0) {
        longjmp(overtaking.stopped, 1);
    }
}

static void publish(shared_t *shared, uint64_t number)
{
    const fcsl_moment_t moment = moment_of(number);
    fill(shared, number);
    fcsl_history_publish(&shared->history, &moment);
}

/* The seeded defect: the slot is not marked while it is written. */
static void publish_unmarked(shared_t *shared, uint64_t number)
{
    const fcsl_moment_t moment = moment_of(number);
    fcsl_history_t *history = &shared->history;
    _Atomic uint64_t *slot = slot_of(history, number);
    fill(shared, number);
    fcsl_seqlock_store(slot + 1, &moment, sizeof moment);
    fcsl_seqlock_store(slot + HEAD_WORDS, shared->words, sizeof shared->words);
    fcsl_seqlock_store(slot + HEAD_WORDS + WORDS, shared->tail, sizeof shared->tail);
    atomic_store_explicit(&slot[0], sequence_of(number), memory_order_release);
    atomic_store_explicit(&history->published, number + 1u, memory_order_release);
}

/* Reads publication 0 while the one that takes its slot overtakes it, at every load and every store. Returns how many
 * interleavings gave a mixture of both. */
static int count_torn(publisher_t publisher)
{
    enum { LOADS = WORDS + 10, STORES = WORDS + 10 }; /* more than either makes */
    static shared_t shared;
    uint8_t bytes[WORDS * 8 + 16];
    int torn = 0;
    int overtaken = 0;
    for (int loads = 0; loads < LOADS; loads++) {
        for (int stores = 0; stores < STORES; stores++) {
            fcsl_moment_t moment;
            open_shared(&shared);
            for (uint64_t number = 0; number < SLOTS; number++) {
                publish(&shared, number);
            }
            overtaking.shared = &shared;
            overtaking.publish = publisher;
            overtaking.stores = stores;
            overtaking.loads = loads;
            const fcsl_history_status_t status = fcsl_history_read(&shared.history, 0, &moment, bytes);
            overtaking.loads = -1;
            overtaking.stores = -1;
            overtaken += status == FCSL_HISTORY_OVERWRITTEN;
            torn += status == FCSL_HISTORY_OK && !(moment.tick == 0 && is_whole(&moment, bytes));
            fcsl_history_free(&shared.history);
        }
    }
    CHECK(overtaken > 0 && overtaken < LOADS * STORES); /* all ways were tried */
    return torn;
}

static void test_interleavings(void)
{
    CHECK(count_torn(publish) == 0);
    CHECK(count_torn(publish_unmarked) > 0);
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
        publish(&shared, number);
    }
    CHECK(pthread_join(all, NULL) == 0);
    atomic_store(&shared.over, 1);
    for (int i = 0; i < READERS; i++) {
        CHECK(pthread_join(latest[i], NULL) == 0);
    }
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
                  (kept ? FCSL_HISTORY_OK : FCSL_HISTORY_OVERWRITTEN));
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
    test_interleavings();
    test_threads();
    return 0;
}
