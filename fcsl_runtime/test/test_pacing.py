# SPDX-License-Identifier: Apache-2.0
"""When ticks are due: fc/pacing.c, a function of clock readings, on clocks that do what they like; exact integers judge it."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import CFLAGS, ROOT
from hypothesis import given, settings
from hypothesis import strategies as st

CATCH_UP, SKIP, STOP = range(3)
SECOND_NS = 10**9
RUNTIME = ROOT / "fcsl_runtime"


class Pacing(ctypes.Structure):
    _fields_ = [
        ("overrun", ctypes.c_int),
        ("tick_hz", ctypes.c_uint64),
        ("anchor_ns", ctypes.c_uint64),
        ("next", ctypes.c_uint64),
    ]


class Beginning(ctypes.Structure):
    _fields_ = [
        ("lateness_ns", ctypes.c_uint64),
        ("skipped", ctypes.c_uint64),
        ("late", ctypes.c_int),
        ("stop", ctypes.c_int),
    ]


def build(folder: Path) -> ctypes.CDLL:
    """pacing.c as a library of its own."""
    library = folder / "libpacing.so"
    flags = [*CFLAGS, f"-I{RUNTIME / 'src'}"]
    subprocess.run(["cc", *flags, str(RUNTIME / "fc/pacing.c"), "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.pacing_start.argtypes = [ctypes.c_int, ctypes.c_uint64, ctypes.c_uint64]
    loaded.pacing_start.restype = Pacing
    loaded.pacing_deadline.argtypes = [ctypes.POINTER(Pacing)]
    loaded.pacing_deadline.restype = ctypes.c_uint64
    loaded.pacing_begin_tick.argtypes = [ctypes.POINTER(Pacing), ctypes.c_uint64]
    loaded.pacing_begin_tick.restype = Beginning
    return loaded


@pytest.fixture(scope="module")
def pacing_c(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return build(tmp_path_factory.mktemp("pacing"))


@dataclass(frozen=True)
class Tick:
    """What happened at one tick; times are ns on the clock that the test moves."""

    number: int  # of its deadline
    begun: int
    found: Beginning


def fly(code: ctypes.CDLL, overrun: int, hz: int, anchor: int, delays: list[tuple[int, int]]) -> list[Tick]:
    """Ticks as the loop makes them: it sleeps until the deadline and wakes up `wake` ns late; the tick's work takes `work`."""
    pacing = code.pacing_start(overrun, hz, anchor)
    now, ticks = anchor, []
    for wake, work in delays:
        deadline = code.pacing_deadline(pacing)
        now = max(now, deadline + wake) if now < deadline else now
        ticks.append(Tick(pacing.next, now, code.pacing_begin_tick(pacing, now)))
        if ticks[-1].found.stop:
            break
        now += work
    return ticks


def deadline_of(hz: int, anchor: int, number: int) -> int:
    return anchor + number * SECOND_NS // hz


def passed(hz: int, anchor: int, now: int) -> int:
    """The number of the first deadline behind `now`."""
    return ((now - anchor + 1) * hz + SECOND_NS - 1) // SECOND_NS


rates = st.one_of(st.sampled_from([1, 3, 50, 100, 300, 1000, 8000, 999_999_937, SECOND_NS]), st.integers(1, SECOND_NS))
#: Most delays are of the size of a period of the common rates, some are long.
durations = st.one_of(st.integers(0, 3_000_000), st.integers(0, 400_000_000), st.integers(0, 30 * SECOND_NS))
flights = st.lists(st.tuples(durations, durations), min_size=1, max_size=40)
anchors = st.integers(1, 2**60)


def check_grid(ticks: list[Tick], overrun: int, hz: int, anchor: int) -> None:
    """Every tick has a deadline of its own, exactly floor(k * 1e9 / hz) ns after the anchor, and does not begin before it."""
    for tick, following in zip(ticks, ticks[1:], strict=False):
        assert following.number == tick.number + 1 + tick.found.skipped
    for tick in ticks:
        due = deadline_of(hz, anchor, tick.number)
        assert tick.begun >= due and tick.found.lateness_ns == tick.begun - due
        assert tick.found.late == (tick.begun >= deadline_of(hz, anchor, tick.number + 1))
        assert tick.found.stop == (overrun == STOP and tick.found.late == 1)


@settings(max_examples=100)
@given(st.sampled_from([CATCH_UP, SKIP, STOP]), rates, anchors, flights)
def test_never_early_and_never_off_the_grid(
    pacing_c: ctypes.CDLL, overrun: int, hz: int, anchor: int, delays: list[tuple[int, int]]
) -> None:
    check_grid(fly(pacing_c, overrun, hz, anchor, delays), overrun, hz, anchor)


@settings(max_examples=100)
@given(rates, anchors, flights)
def test_skip_waits_for_the_next_deadline(
    pacing_c: ctypes.CDLL, hz: int, anchor: int, delays: list[tuple[int, int]]
) -> None:
    for tick in fly(pacing_c, SKIP, hz, anchor, delays):
        behind = tick.number + 1 + tick.found.skipped
        assert deadline_of(hz, anchor, behind) > tick.begun
        assert tick.found.skipped == 0 or deadline_of(hz, anchor, behind - 1) <= tick.begun


@settings(max_examples=100)
@given(rates, anchors, flights)
def test_catch_up_makes_every_tick_of_the_last_tenth_of_a_second(
    pacing_c: ctypes.CDLL, hz: int, anchor: int, delays: list[tuple[int, int]]
) -> None:
    """No deadline is skipped that is younger than 0.1 s, and no more ticks than that (one at least) are owed at a time."""
    most = max(hz // 10, 1)
    for tick in fly(pacing_c, CATCH_UP, hz, anchor, delays):
        backlog = passed(hz, anchor, tick.begun) - tick.number - 1
        assert tick.found.skipped == max(backlog - most, 0)


def test_no_drift_in_a_year(pacing_c: ctypes.CDLL) -> None:
    """Deadlines of 300 Hz, whose period is no whole number of ns, after 10^10 ticks: exact."""
    pacing = Pacing(CATCH_UP, 300, 12345, 10**10)
    assert pacing_c.pacing_deadline(pacing) == 12345 + 10**10 * SECOND_NS // 300
    found = pacing_c.pacing_begin_tick(pacing, deadline_of(300, 12345, 10**10 + 1) - 1)
    assert (found.late, found.skipped, pacing.next) == (0, 0, 10**10 + 1)
    found = pacing_c.pacing_begin_tick(pacing, deadline_of(300, 12345, 10**10 + 2))
    assert (found.late, found.skipped, pacing.next) == (1, 0, 10**10 + 2)


def test_a_pause_of_the_computer_by_policy(pacing_c: ctypes.CDLL) -> None:
    """100 Hz; tick 5's work takes 1.004 s: 100 deadlines pass meanwhile."""
    delays = [(20_000, 1_000_000)] * 5 + [(20_000, 1_004_000_000)] + [(20_000, 1_000_000)] * 20
    numbers = {
        policy: [t.number for t in fly(pacing_c, policy, 100, 10**9, delays)] for policy in (CATCH_UP, SKIP, STOP)
    }
    assert numbers[STOP] == [0, 1, 2, 3, 4, 5, 6]  # and tick 6 was not made
    assert numbers[SKIP][5:9] == [5, 6, 106, 107]
    # Tick 6 comes 0.994 s late, ten more are owed; those between are given up.
    assert numbers[CATCH_UP][5:9] == [5, 6, 96, 97]
    ticks = fly(pacing_c, CATCH_UP, 100, 10**9, delays)
    assert [t.number for t in ticks if t.found.late] == [6, *range(96, 106)]
    assert ticks[-1].found.lateness_ns == 20_000


def test_control_a_relative_schedule_is_found(pacing_c: ctypes.CDLL) -> None:
    """A loop that sleeps a period from now drifts; the property must see it."""

    class Relative:
        def __init__(self) -> None:
            self.pacing_start = pacing_c.pacing_start

        def pacing_deadline(self, pacing: Pacing) -> int:
            return int(pacing.anchor_ns)

        def pacing_begin_tick(self, pacing: Pacing, now: int) -> Beginning:
            found = Beginning(now - pacing.anchor_ns, 0, 0, 0)
            pacing.anchor_ns = now + SECOND_NS // pacing.tick_hz
            pacing.next += 1
            return found

    ticks = fly(Relative(), CATCH_UP, 1000, 10**9, [(50_000, 0)] * 30)  # type: ignore[arg-type]
    with pytest.raises(AssertionError):
        check_grid(ticks, CATCH_UP, 1000, 10**9)
