# SPDX-License-Identifier: Apache-2.0
"""The probes of a coverage build: the C functions that an instrumented machine calls, and their counter words."""

from __future__ import annotations

from ..base.files import digest
from ..model.c_names import c_string
from ..model.ops import Op
from ..model.types import BOOL, I64, U64
from ..printers.spelling import Spelling
from .probe_map import CoverMap

LINE = "fcsl_cover_line"
LOOP = "fcsl_cover_loop"
CONDITION = Op("cover.condition", (U64, I64, BOOL), BOOL)
#: True if nothing has faulted yet. After a fault, C still evaluates expressions that Python would not reach.
SOUND = Op("cover.sound", (), BOOL, sees_fault=True)
#: Probe at the end of a decision, in functions that may fault and in others.
DECIDED = {
    faults: Op(f"cover.decided.{faults}", (U64, I64, I64, BOOL), BOOL, sees_fault=faults) for faults in (True, False)
}

#: Their C.
C_OPERATIONS = {
    CONDITION.id: Spelling("fcsl_cover_condition(&{0}, {1}, {2})"),
    SOUND.id: Spelling("(*{fault} == 0u)"),
    DECIDED[True].id: Spelling("fcsl_cover_decided(&{0}, {1}, {2}, {fault}, {3})"),
    DECIDED[False].id: Spelling("fcsl_cover_decided(&{0}, {1}, {2}, NULL, {3})"),
}

_PRELUDE = """\
#include <fcsl/fcsl_cover.h>

static const char fcsl_cover_map_[] =
@MAP@;
static uint64_t fcsl_cover_words_[2 * @COUNT@];
__attribute__((visibility("default"))) fcsl_cover_t fcsl_cover_@MACHINE@ = {
    FCSL_COVER_VERSION, 0u, "@ID@", fcsl_cover_map_, sizeof fcsl_cover_map_ - 1u, @COUNT@u, fcsl_cover_words_,
};

static inline uint64_t *fcsl_cover_word(int64_t word)
{
    return &__atomic_load_n(&fcsl_cover_@MACHINE@.words, __ATOMIC_RELAXED)[word];
}

/* Whether a word has its check, which stands behind all words. */
static inline bool fcsl_cover_is_set(int64_t word)
{
    return __atomic_load_n(fcsl_cover_word(word + @COUNT@), __ATOMIC_RELAXED) != 0u;
}

/* Stores the check of a word that has this value. */
static inline void fcsl_cover_check(int64_t word, uint64_t value)
{
    __atomic_store_n(fcsl_cover_word(word + @COUNT@), fcsl_cover_check_of((uint64_t)word, value), __ATOMIC_RELEASE);
}

/* Most words are already set. A store would invalidate the cache line in other threads. */
static inline void fcsl_cover_set(int64_t word)
{
    if (!fcsl_cover_is_set(word)) {
        __atomic_store_n(fcsl_cover_word(word), 1u, __ATOMIC_RELAXED);
        fcsl_cover_check(word, 1u);
    }
}

/* Records that a statement's line is reached. */
static inline void fcsl_cover_line(int64_t word, bool sound)
{
    if (sound) {
        fcsl_cover_set(word);
    }
}

/* Records at the start of a loop whether it runs an iteration. */
static inline void fcsl_cover_loop(int64_t word, bool enters, bool sound)
{
    fcsl_cover_line(enters ? word : word + 1, sound);
}

/* Records a condition's value in the combination of this evaluation. */
static inline bool fcsl_cover_condition(uint64_t *vector, int64_t condition, bool value)
{
    *vector |= UINT64_C(1) << (2 + condition) | (uint64_t)value << (33 + condition);
    return value;
}

/* Stores the combination, unless its statement has faulted before. */
static inline bool fcsl_cover_decided(uint64_t *vector, int64_t word, int64_t slots, const uint32_t *fault, bool outcome)
{
    const uint64_t found = *vector | (outcome ? 3u : 1u);
    *vector = 0u;
    if (fault != NULL && *fault != 0u) {
        return outcome;
    }
    fcsl_cover_set(outcome ? word + 1 : word);
    for (int64_t slot = 0; slot < slots; ++slot) {
        uint64_t seen = __atomic_load_n(fcsl_cover_word(word + 3 + slot), __ATOMIC_RELAXED);
        if (seen == 0u) {
            (void)__atomic_compare_exchange_n(fcsl_cover_word(word + 3 + slot), &seen, found, false, __ATOMIC_RELAXED,
                                              __ATOMIC_RELAXED);
        }
        if (seen == 0u || seen == found) {
            if (!fcsl_cover_is_set(word + 3 + slot)) {
                fcsl_cover_check(word + 3 + slot, found);
            }
            return outcome;
        }
    }
    if (slots > 0) {
        fcsl_cover_set(word + 2);
    }
    return outcome;
}
"""


def prelude(found: CoverMap) -> str:
    """C definitions that precede the functions of the machine."""
    text = found.to_json()
    parts = [text[n : n + 1000] for n in range(0, len(text), 1000)]
    values = {
        "MAP": "\n".join(f"    {c_string(part)}" for part in parts),
        "COUNT": str(max(1, found.word_count)),
        "MACHINE": found.machine,
        "ID": digest(text)[:32],
    }
    made = _PRELUDE
    for name, value in values.items():
        made = made.replace(f"@{name}@", value)
    return made
