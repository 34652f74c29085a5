/* SPDX-License-Identifier: Apache-2.0 */
#include "pacing.h"

#include "tick_time.h"

static const uint64_t SECOND_NS = 1000000000u;
/* A burst of ticks that are older than this helps nobody. */
static const uint64_t CATCH_UP_NS = 100000000u;

pacing_t pacing_start(overrun_t overrun, uint64_t tick_hz, uint64_t now_ns)
{
    return (pacing_t){.overrun = overrun, .tick_hz = tick_hz, .anchor_ns = now_ns};
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

beginning_t pacing_begin_tick(pacing_t *pacing, uint64_t now_ns)
{
    beginning_t found = {.lateness_ns = now_ns - pacing_deadline(pacing)};
    pacing->next++;
    const uint64_t passed = deadlines_until(pacing, now_ns);
    if (passed <= pacing->next) {
        return found;
    }
    const uint64_t backlog = passed - pacing->next;
    found.late = 1;
    if (pacing->overrun == OVERRUN_STOP) {
        found.stop = 1;
    } else if (pacing->overrun == OVERRUN_SKIP) {
        found.skipped = backlog;
    } else {
        const uint64_t made_up = pacing->tick_hz * (CATCH_UP_NS / 1000u) / (SECOND_NS / 1000u);
        found.skipped = backlog - smaller(backlog, made_up > 0 ? made_up : 1u);
    }
    pacing->next += found.skipped;
    return found;
}
