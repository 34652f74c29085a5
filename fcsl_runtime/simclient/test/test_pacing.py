# SPDX-License-Identifier: Apache-2.0
"""When ticks are due: fc/pacing.c, a function of clock readings, on clocks that do what they like; exact integers judge it."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import CFLAGS, ROOT
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

CATCH_UP, SKIP, STOP = range(3)
SECOND_NS = 10**9
RUNTIME = ROOT / "fcsl_runtime/fcsl_runtime"


class Pacing(ctypes.Structure):
    _fields_ = [
        ("missed_deadline", ctypes.c_int),
        ("tick_hz", ctypes.c_uint64),
        ("anchor_ns", ctypes.c_uint64),
        ("next", ctypes.c_uint64),
    ]


TICK, END = range(2)


class Arrival(ctypes.Structure):
    _fields_ = [
        ("verdict", ctypes.c_int),
        ("lateness_ns", ctypes.c_uint64),
        ("missed", ctypes.c_uint64),
        ("skipped", ctypes.c_uint64),
    ]


def build(folder: Path) -> ctypes.CDLL:
    """pacing.c as a library of its own."""
    library = folder / "libpacing.so"
    flags = [*CFLAGS, f"-I{RUNTIME / 'src'}", f"-I{RUNTIME.parents[1] / 'fcsl_hal/include'}"]
    subprocess.run(["cc", *flags, str(RUNTIME / "fc/pacing.c"), "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.pacing_start.argtypes = [ctypes.c_int, ctypes.c_uint64, ctypes.c_uint64]
    loaded.pacing_start.restype = Pacing
    loaded.pacing_deadline.argtypes = [ctypes.POINTER(Pacing)]
    loaded.pacing_deadline.restype = ctypes.c_uint64
    loaded.pacing_arrive.argtypes = [ctypes.POINTER(Pacing), ctypes.c_uint64]
    loaded.pacing_arrive.restype = Arrival
    return loaded


@pytest.fixture(scope="module")
def pacing_c(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return build(tmp_path_factory.mktemp("pacing"))


@dataclass(frozen=True)
class Coming:
    """The loop comes to deadline `number`; times are ns on the clock that the test moves."""

    number: int
    now: int
    found: Arrival
    behind: int  # the deadline that the loop waits for then


def fly(code: ctypes.CDLL, missed_deadline: int, hz: int, anchor: int, delays: list[tuple[int, int]]) -> list[Coming]:
    """As the loop does: it sleeps until the deadline and wakes up `wake` ns late; a tick's work takes `work`."""
    pacing = code.pacing_start(missed_deadline, hz, anchor)
    now, coming = anchor, []
    for wake, work in delays:
        deadline = code.pacing_deadline(pacing)
        now = max(now, deadline + wake) if now < deadline else now
        number = pacing.next
        coming.append(Coming(number, now, code.pacing_arrive(pacing, now), pacing.next))
        if coming[-1].found.verdict == END:
            break
        now += work if coming[-1].found.verdict == TICK else 0
    return coming


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


def check_grid(coming: list[Coming], missed_deadline: int, hz: int, anchor: int) -> None:
    """Deadline k lies exactly floor(k * 1e9 / hz) ns after the anchor, nothing happens before it, and each gets a tick or is skipped."""
    for one, following in zip(coming, coming[1:], strict=False):
        assert following.number == one.behind
    for one in coming:
        due = deadline_of(hz, anchor, one.number)
        assert one.now >= due and one.found.lateness_ns == one.now - due
        late = one.now >= deadline_of(hz, anchor, one.number + 1)
        assert (one.found.missed > 0) == late and one.found.missed >= one.found.skipped
        assert one.found.verdict == (END if late and missed_deadline == STOP else TICK)
        assert one.behind == one.number + one.found.skipped + (one.found.verdict == TICK)


@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from([CATCH_UP, SKIP, STOP]), rates, anchors, flights)
def test_never_early_and_never_off_the_grid(
    pacing_c: ctypes.CDLL, missed_deadline: int, hz: int, anchor: int, delays: list[tuple[int, int]]
) -> None:
    check_grid(fly(pacing_c, missed_deadline, hz, anchor, delays), missed_deadline, hz, anchor)


@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
@given(rates, anchors, flights)
def test_skip_makes_no_tick_a_period_late(
    pacing_c: ctypes.CDLL, hz: int, anchor: int, delays: list[tuple[int, int]]
) -> None:
    """The tick is that of the newest deadline; all older ones are missed, and skipped."""
    for one in fly(pacing_c, SKIP, hz, anchor, delays):
        assert one.behind == passed(hz, anchor, one.now)
        assert deadline_of(hz, anchor, one.behind) > one.now >= deadline_of(hz, anchor, one.behind - 1)
        assert one.found.missed == one.found.skipped


@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
@given(rates, anchors, flights)
def test_catch_up_makes_the_ticks_of_the_last_tenth_of_a_second(
    pacing_c: ctypes.CDLL, hz: int, anchor: int, delays: list[tuple[int, int]]
) -> None:
    """At most as many ticks as 0.1 s has (one at least) are owed; older deadlines are skipped, and no others."""
    for one in fly(pacing_c, CATCH_UP, hz, anchor, delays):
        owed = passed(hz, anchor, one.now) - one.number
        assert one.found.skipped == max(owed - max(hz // 10, 1), 0)


@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from([CATCH_UP, SKIP]), rates, anchors, flights)
@example(CATCH_UP, 1, 1, [(0, 2_000_000_000), (0, 0)])  # at 1 Hz one tick is made up for, and it is the newest
def test_every_deadline_is_counted_once(
    pacing_c: ctypes.CDLL, policy: int, hz: int, anchor: int, delays: list[tuple[int, int]]
) -> None:
    """`missed`: the next deadline came before its tick began, or it got none; whatever the policy, each one counts once."""
    coming = fly(pacing_c, policy, hz, anchor, delays)
    late = [one for one in coming if one.now >= deadline_of(hz, anchor, one.behind)]  # behind the tick's own deadline
    assert sum(one.found.missed for one in coming) == coming[-1].behind - len(coming) + len(late)
    assert sum(one.found.skipped for one in coming) == coming[-1].behind - len(coming)


def test_no_drift_in_a_year(pacing_c: ctypes.CDLL) -> None:
    """Deadlines of 300 Hz, whose period is no whole number of ns, after 10^10 ticks: exact."""
    pacing = Pacing(CATCH_UP, 300, 12345, 10**10)
    assert pacing_c.pacing_deadline(pacing) == 12345 + 10**10 * SECOND_NS // 300
    found = pacing_c.pacing_arrive(pacing, deadline_of(300, 12345, 10**10 + 1) - 1)
    assert (found.missed, found.skipped, pacing.next) == (0, 0, 10**10 + 1)
    found = pacing_c.pacing_arrive(pacing, deadline_of(300, 12345, 10**10 + 2))
    assert (found.missed, found.skipped, pacing.next) == (1, 0, 10**10 + 2)


def test_a_stall_of_a_second_by_policy(pacing_c: ctypes.CDLL) -> None:
    """100 Hz; tick 5's work takes 1.004 s: deadlines 6 to 105 pass meanwhile."""
    delays = [(20_000, 1_000_000)] * 5 + [(20_000, 1_004_000_000)] + [(20_000, 1_000_000)] * 20
    coming = {policy: fly(pacing_c, policy, 100, 10**9, delays) for policy in (CATCH_UP, SKIP, STOP)}
    assert [c.number for c in coming[STOP]] == [0, 1, 2, 3, 4, 5, 6] and coming[STOP][-1].found.verdict == END
    # Skip: comes to 6, finds 99 deadlines missed, and makes the tick of 105, which is 4 ms late.
    assert [c.behind - 1 for c in coming[SKIP]][5:9] == [5, 105, 106, 107] and coming[SKIP][6].found.skipped == 99
    # Catch up: 90 are given up, 96 to 105 get their ticks at once, and 106 is on time.
    made = coming[CATCH_UP]
    assert [c.behind - 1 for c in made][5:18] == [5, *range(96, 108)] and made[6].found.skipped == 90
    assert [c.found.missed for c in made][5:18] == [0, 91, *[1] * 9, 0, 0]
    assert made[-1].found.lateness_ns == 20_000


def test_control_a_relative_schedule_is_found(pacing_c: ctypes.CDLL) -> None:
    """A loop that sleeps a period from now drifts; the property must see it."""

    class Relative:
        def __init__(self) -> None:
            self.pacing_start = pacing_c.pacing_start

        def pacing_deadline(self, pacing: Pacing) -> int:
            return int(pacing.anchor_ns)

        def pacing_arrive(self, pacing: Pacing, now: int) -> Arrival:
            found = Arrival(TICK, now - pacing.anchor_ns, 0, 0)
            pacing.anchor_ns = now + SECOND_NS // pacing.tick_hz
            pacing.next += 1
            return found

    ticks = fly(Relative(), CATCH_UP, 1000, 10**9, [(50_000, 0)] * 30)  # type: ignore[arg-type]
    with pytest.raises(AssertionError):
        check_grid(ticks, CATCH_UP, 1000, 10**9)
