/* SPDX-License-Identifier: Apache-2.0
 *
 * A sink gets each tick once and in order, or its loss is counted. The source is compiled in, so that the rounds of its thread are
 * made here, one by one.
 */
#include "../observers/history_reader.c"

#include "fcsl_check.h"

enum { SLOTS = 8, SEEN_MAX = 256 };

typedef struct {
    uint64_t seen[SEEN_MAX];
    uint32_t count;
    uint32_t room;
    uint32_t passed;
    int wanted;
} taker_t;

typedef struct {
    uint64_t word; /* what is published: the tick's number */
    fcsl_history_t history;
    taker_t taker;
    history_reader_t reader;
} test_t;

static int wants(void *ctx)
{
    return ((const taker_t *)ctx)->wanted;
}

static void passes(void *ctx)
{
    ((taker_t *)ctx)->passed++;
}

static int has_room(void *ctx)
{
    return ((const taker_t *)ctx)->room > 0u;
}

static int take(void *ctx, const published_tick_t *tick)
{
    taker_t *taker = ctx;
    uint64_t word = 0;
    memcpy(&word, tick->publication, sizeof word);
    CHECK(word == tick->number && tick->begun_ns == 1000u + word && taker->count < SEEN_MAX);
    taker->seen[taker->count++] = word;
    taker->room--;
    return 0;
}

static void begin(test_t *test)
{
    *test = (test_t){.taker = {.wanted = 1, .room = SEEN_MAX}};
    const fcsl_part_t part = {.data = &test->word, .size = sizeof test->word};
    const history_reader_sink_t sink = {
        .ctx = &test->taker, .wants = wants, .skip = passes, .ready = has_room, .put = take};
    CHECK(fcsl_history_open(&test->history, &part, 1, SLOTS) == 0);
    CHECK(history_reader_open(&test->reader, &test->history, 100, &sink) == 0);
}

static void end(test_t *test)
{
    history_reader_close(&test->reader);
    fcsl_history_free(&test->history);
}

/* The ticks from `first` on. */
static void publish(test_t *test, uint64_t first, uint64_t count)
{
    for (test->word = first; test->word < first + count; test->word++) {
        const fcsl_moment_t moment = {.tick = test->word + 1u, .time_ns = 1000u + test->word};
        fcsl_history_publish(&test->history, &moment);
    }
}

static void test_each_tick_once(void)
{
    test_t test;
    begin(&test);
    for (uint64_t tick = 0; tick < 20; tick += 5) {
        publish(&test, tick, 5);
        publish(&test, tick + 4u, 1); /* a command, after the last one */
        CHECK(read_history(&test.reader) == 1);
    }
    CHECK(test.taker.count == 20 && history_reader_ticks(&test.reader) == 20 &&
          history_reader_dropped(&test.reader) == 0);
    for (uint64_t i = 0; i < 20; i++) {
        CHECK(test.taker.seen[i] == i);
    }
    end(&test);
}

/* No room for 100 ticks, of which the history keeps 8. */
static void test_ticks_without_room_are_counted(void)
{
    test_t test;
    begin(&test);
    test.taker.room = 3;
    publish(&test, 0, 3);
    (void)read_history(&test.reader);
    publish(&test, 3, 100);
    (void)read_history(&test.reader);
    CHECK(test.taker.count == 3);
    test.taker.room = SEEN_MAX;
    finish(&test.reader);
    CHECK(test.taker.count > 3 && test.taker.seen[test.taker.count - 1u] == 102);
    for (uint32_t i = 1; i < test.taker.count; i++) {
        CHECK(test.taker.seen[i] > test.taker.seen[i - 1u]);
    }
    CHECK(history_reader_dropped(&test.reader) > 90);
    CHECK(history_reader_ticks(&test.reader) + history_reader_dropped(&test.reader) == 103);
    end(&test);
}

static void test_what_nobody_wants_is_not_lost(void)
{
    test_t test;
    begin(&test);
    test.taker.wanted = 0;
    publish(&test, 0, 50);
    (void)read_history(&test.reader);
    CHECK(test.taker.passed == 1 && test.taker.count == 0);
    test.taker.wanted = 1;
    publish(&test, 50, 2);
    (void)read_history(&test.reader);
    CHECK(test.taker.count == 2 && test.taker.seen[0] == 50 && history_reader_dropped(&test.reader) == 0);
    end(&test);
}

int main(void)
{
    test_each_tick_once();
    test_ticks_without_room_are_counted();
    test_what_nobody_wants_is_not_lost();
    return 0;
}
