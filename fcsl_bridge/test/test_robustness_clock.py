# SPDX-License-Identifier: Apache-2.0
"""The system clock is set during a run: stamps and ages follow, ticks are unaffected. Simulated time is polled."""

from __future__ import annotations

import struct
import time
from types import SimpleNamespace
from typing import Any

import pytest

from fcsl_bridge.loops import ros_time
from fcsl_bridge.loops.ros_time import RosTime

MS = 10**6
DAY_NS = 86_400_000 * MS


class SystemClock:
    """A node whose clock can be set, and whose answers can be delayed."""

    def __init__(self) -> None:
        self.ahead_ns, self.delay_s = DAY_NS, 0.0

    def get_clock(self) -> Any:
        return self

    def now(self) -> Any:
        if self.delay_s:  # sleep(0) would give the processor away
            time.sleep(self.delay_s)
        return SimpleNamespace(nanoseconds=time.monotonic_ns() + self.ahead_ns)


def error_ns(ros: RosTime, clock: SystemClock) -> int:
    now = time.monotonic_ns()
    return abs(ros.at(now) - now - clock.ahead_ns)


@pytest.mark.parametrize("step_ns", [2 * MS, -2 * MS, 20_000 * DAY_NS, -DAY_NS // 2])
def test_a_clock_that_is_set_is_followed(step_ns: int) -> None:
    clock = SystemClock()
    ros = RosTime(clock, simulated=False)
    assert error_ns(ros, clock) < MS
    clock.ahead_ns += step_ns
    assert error_ns(ros, clock) > MS, "detected only by follow()"
    limit = time.monotonic() + 60
    while ros.sets == 0 and time.monotonic() < limit:  # a loaded computer may delay it once or twice
        ros.follow()
    assert ros.sets == 1 and error_ns(ros, clock) < MS
    ros.follow()
    assert ros.sets == 1


def test_a_process_that_was_held_up_does_not_take_that_for_a_set_clock() -> None:
    clock = SystemClock()
    ros = RosTime(clock, simulated=False)
    clock.delay_s = 0.05
    ros.follow()
    assert ros.sets == 0 and error_ns(ros, clock) < MS


def test_simulated_time_is_what_clock_said_last(monkeypatch: pytest.MonkeyPatch) -> None:
    waiting: list[bytes] = []
    monkeypatch.setattr(ros_time, "PolledSubscription", lambda *_: SimpleNamespace(take_all=lambda: waiting))
    ros = RosTime(SystemClock(), simulated=True)
    assert ros.at(time.monotonic_ns()) == 0
    waiting[:] = [struct.pack("<IiI", 0x100, 4, 0), struct.pack("<IiI", 0x100, 5, 7), b"cut"]
    ros.follow()
    assert ros.at(time.monotonic_ns()) == ros.at(0) == 5000 * MS + 7 and ros.sets == 0
    waiting[:] = [struct.pack("<IiI", 0x100, 0, 0)]
    assert ros.at(0) == 0, "a simulation restarts"
