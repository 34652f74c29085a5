# SPDX-License-Identifier: Apache-2.0
"""A system clock that is set while a machine flies: stamps and ages follow, ticks do not care."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from fcsl_bridge.ros_time import RosTime

NS = 10**9
DAY_NS = 86_400 * NS


class SystemClock:
    """An rclpy clock that somebody can set, and that can take its time to answer."""

    def __init__(self) -> None:
        self.ahead_ns, self.simulated_ns, self.delay_s = DAY_NS, 0, 0.0

    @property
    def ros_time_is_active(self) -> bool:
        return self.simulated_ns > 0

    def now(self) -> Any:
        time.sleep(self.delay_s)
        return SimpleNamespace(nanoseconds=self.simulated_ns or time.monotonic_ns() + self.ahead_ns)


def error_ns(ros: RosTime, clock: SystemClock) -> int:
    now = time.monotonic_ns()
    return abs(ros.at(now) - now - clock.ahead_ns)


@pytest.mark.parametrize("step_ns", [NS // 50, 20_000 * DAY_NS, -NS // 50, -DAY_NS // 2])
def test_a_clock_that_is_set_is_followed(step_ns: int) -> None:
    clock = SystemClock()
    ros = RosTime(clock)
    assert error_ns(ros, clock) < NS // 100
    clock.ahead_ns += step_ns
    assert error_ns(ros, clock) > NS // 100, "found only when it looks"
    limit = time.monotonic() + 60
    while ros.sets == 0 and time.monotonic() < limit:  # a loaded machine may hold it up once or twice
        ros.follow()
    assert ros.sets == 1 and error_ns(ros, clock) < NS // 100
    ros.follow()
    assert ros.sets == 1


def test_a_process_that_was_held_up_does_not_take_that_for_a_set_clock() -> None:
    clock = SystemClock()
    ros = RosTime(clock)
    clock.delay_s = 0.05
    ros.follow()
    assert ros.sets == 0 and error_ns(ros, clock) < NS // 100


def test_simulated_time_is_what_was_said_last() -> None:
    clock = SystemClock()
    ros = RosTime(clock)
    clock.simulated_ns = 5 * NS
    ros.follow()
    assert ros.at(time.monotonic_ns()) == ros.at(0) == 5 * NS and ros.sets == 0
