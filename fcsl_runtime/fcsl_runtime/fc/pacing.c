/* SPDX-License-Identifier: Apache-2.0
 *
 * When ticks are due, from clock readings alone.
 */
#include "pacing.h"

#include "fcsl/fcsl_tick_time.h"

static const uint64_t SECOND_NS = 1000000000u;
/* A burst of ticks that are older than this helps nobody. */
static const uint64_t CATCH_UP_NS = 100000000u;

pacing_t pacing_start(missed_deadline_t missed_deadline, uint64_t tick_hz, uint64_t now_ns)
{
    return (pacing_t){.missed_deadline = missed_deadline, .tick_hz = tick_hz, .anchor_ns = now_ns};
}

uint64_t pacing_deadline(const pacing_t *pacing)
{
    return pacing->anchor_ns + fcsl_tick_time_ns(pacing->tick_hz, pacing->next);
}

/* How many deadlines lie at or before `now_ns`, which is not before the anchor: the inverse of fcsl_tick_time_ns. Number k does
 * when k * 1e9 < (elapsed + 1) * tick_hz. */
static uint64_t deadlines_until(const pacing_t *pacing, uint64_t now_ns)
{
    const uint64_t elapsed = now_ns - pacing->anchor_ns;
    const uint64_t rest = elapsed % SECOND_NS + 1u; /* the product of two numbers up to 1e9 fits */
    return elapsed / SECOND_NS * pacing->tick_hz + (rest * pacing->tick_hz + SECOND_NS - 1u) / SECOND_NS;
}

static uint64_t smaller(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

/* How many ticks are made up for at most. */
static uint64_t catch_up_max(const pacing_t *pacing)
{
    const uint64_t ticks = pacing->tick_hz / (SECOND_NS / CATCH_UP_NS);
    return ticks > 0 ? ticks : 1u;
}

arrival_t pacing_arrive(pacing_t *pacing, uint64_t now_ns)
{
    arrival_t found = {.verdict = PACING_TICK, .lateness_ns = now_ns - pacing_deadline(pacing)};
    const uint64_t passed = deadlines_until(pacing, now_ns) - pacing->next; /* this one and those since */
    if (passed <= 1u) {
        pacing->next++;
        return found;
    }
    switch (pacing->missed_deadline) {
    case MISSED_STOP:
        found.verdict = PACING_STOP;
        found.missed = 1;
        break;
    case MISSED_SKIP:
        found.skipped = passed - 1u;
        found.missed = found.skipped;
        pacing->next += passed;
        break;
    case MISSED_CATCH_UP:
        found.skipped = passed - smaller(passed, catch_up_max(pacing));
        found.missed = found.skipped + (passed - found.skipped > 1u ? 1u : 0u); /* unless the newest is served */
        pacing->next += found.skipped + 1u;
        break;
    }
    return found;
}
