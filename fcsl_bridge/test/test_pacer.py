# SPDX-License-Identifier: Apache-2.0
"""Due times of a machine in real time, on a clock of the test's own."""

from __future__ import annotations

import random
import time
from fractions import Fraction

import pytest

from fcsl_bridge.loops.pacer import BINS_US, Pacer, sleep_until

NS = 10**9
#: An arbitrary value of CLOCK_MONOTONIC at activation.
START = 123_456_789_012_345


def exact(number: int, hz: int) -> int:
    return START + int(Fraction(number * NS, hz))


@pytest.mark.parametrize("hz", [1, 3, 7, 60, 1000, 333_333])
def test_ticks_on_time_serve_every_deadline(hz: int) -> None:
    pacer = Pacer(hz)
    pacer.start(START)
    for number in range(1000):
        assert pacer.deadline_ns == exact(number, hz)
        assert pacer.begin(pacer.deadline_ns) == exact(number, hz)
    assert (pacer.missed, pacer.worst_ns) == (0, 0)
    assert pacer.histogram[0] == 1000


@pytest.mark.parametrize("seed", range(20))
def test_every_deadline_is_served_once_or_missed(seed: int) -> None:
    """For any delays: deadlines rise, none is served twice, and the newest due one is served."""
    r = random.Random(seed)
    hz = r.choice([1, 3, 97, 100, 1000, 4096])
    pacer, now, served = Pacer(hz), START, []
    pacer.start(now)
    for _ in range(500):
        due = pacer.deadline_ns
        now = max(now, due) + r.choice([0, 0, 1, NS // hz // 3, NS // hz, 3 * NS // hz + 5, r.randrange(20 * NS // hz)])
        served.append(pacer.begin(now))
        assert served[-1] <= now < pacer.deadline_ns
    numbers = [round((deadline - START) * hz / NS) for deadline in served]
    assert [exact(number, hz) for number in numbers] == served
    assert numbers == sorted(set(numbers))
    assert pacer.missed == numbers[-1] + 1 - len(numbers)
    assert sum(pacer.histogram) == 500


def test_a_stall_makes_one_late_tick_and_no_burst() -> None:
    pacer = Pacer(100)
    pacer.start(START)
    pacer.begin(START)
    woken = START + 2 * NS + 3_000_000  # deadline 200, 3 ms ago; deadline 1 was due
    assert pacer.begin(woken) == exact(200, 100)
    assert pacer.deadline_ns == exact(201, 100)
    assert pacer.missed == 199
    assert pacer.worst_ns == woken - exact(1, 100)
    assert pacer.histogram[-1] == 1


def test_starting_anew_keeps_the_counts() -> None:
    pacer = Pacer(100)
    pacer.start(START)
    pacer.begin(START + NS)
    pacer.start(START + 5 * NS)
    assert pacer.begin(START + 5 * NS) == START + 5 * NS
    assert (pacer.missed, sum(pacer.histogram)) == (100, 2)


def test_figures_name_each_bin() -> None:
    pacer = Pacer(10)
    pacer.start(START)
    for number, edge in enumerate(BINS_US):
        pacer.begin(exact(number, 10) + edge * 1000 - 1)
    figures = pacer.figures()
    assert [figures[f"lateness <= {edge} us"] for edge in BINS_US] == [1] * len(BINS_US)
    assert figures["lateness > 100000 us"] == 0
    assert figures["lateness worst us"] == pytest.approx(99_999.999)


def test_sleeping_ends_at_the_deadline_and_not_before() -> None:
    for ahead in (0, -1_000_000_000, 2_000_000):
        deadline = time.monotonic_ns() + ahead
        sleep_until(deadline)
        assert time.monotonic_ns() >= deadline
