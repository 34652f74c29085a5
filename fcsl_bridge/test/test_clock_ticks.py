# SPDX-License-Identifier: Apache-2.0
"""Which ticks are due, for any course of a clock."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fcsl_bridge.loops.clock_ticks import ClockTicks

NS = 10**9


@given(
    st.sampled_from([1, 3, 50, 100, 333, 1000]),
    st.integers(0, 2**60),
    st.lists(st.integers(1, 3 * NS), min_size=1, max_size=30),
)
def test_ticks_do_not_depend_on_how_often_the_clock_is_told(hz: int, begin_ns: int, steps: list[int]) -> None:
    """Every tick once, at its due time, by the end of a course in steps as in one leap."""
    stepped, leaping = ClockTicks(hz, 10**9), ClockTicks(hz, 10**9)
    now_ns, made = begin_ns, stepped.until(begin_ns)
    for step in steps:
        now_ns += step
        made += stepped.until(now_ns)
    assert made == leaping.until(begin_ns) + leaping.until(now_ns)
    assert made == [begin_ns + number * NS // hz for number in range(len(made))]
    assert made[-1] <= now_ns < begin_ns + len(made) * NS // hz
    assert stepped.skipped == stepped.set_back == 0


@given(st.integers(1, 20), st.lists(st.integers(1, NS), min_size=1, max_size=30))
def test_what_is_too_much_for_one_message_is_skipped_and_counted(most: int, steps: list[int]) -> None:
    """The newest ticks are made."""
    few, every = ClockTicks(100, most), ClockTicks(100, 10**9)
    now_ns, made, due = 0, few.until(0), every.until(0)
    for step in steps:
        now_ns += step
        now, all_now = few.until(now_ns), every.until(now_ns)
        assert now == all_now[-most:]
        made, due = made + now, due + all_now
    assert few.skipped == len(due) - len(made)


def test_a_clock_that_goes_back_begins_again() -> None:
    ticks = ClockTicks(100, 10)
    assert ticks.until(5 * NS) == [5 * NS]
    assert ticks.until(2 * NS) == [2 * NS] and ticks.set_back == 1
    assert ticks.until(2 * NS + NS // 50) == [2 * NS + NS // 100, 2 * NS + NS // 50]
    ticks.start()
    assert ticks.until(NS) == [NS] and ticks.set_back == 1, "a new beginning is no clock that goes back"
