# SPDX-License-Identifier: Apache-2.0
"""A machine on /clock: its ticks are those of the clock, at whatever speed it runs."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
import rig
from bridge_harness import Domain
from controller_client import figures
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from test_realtime_loop import HZ, NS, Robot

from fcsl_bridge.errors import Stopped
from fcsl_bridge.loops.clock_loop import ClockLoop
from fcsl_bridge.loops.clock_ticks import ClockTicks
from fcsl_bridge.topics import qos
from simclient.bag import Bag
from simclient.replay import replay


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.build(tmp_path_factory.mktemp("rig"), HZ)


class Clocked(Robot):
    """A controller that waits for this publisher of /clock."""

    def __init__(self, domain: Domain, library: Path):
        self._clock = domain.listener().node.create_publisher(Clock, "/clock", qos.STREAM)
        super().__init__(domain, library, mode="clock", max_ticks_per_clock=20)

    def wait_for_torque(self) -> None:
        """There is none before the first message of /clock."""

    def time(self, time_ns: int) -> None:
        self._clock.publish(Clock(clock=Time(nanoseconds=time_ns).to_msg()))

    def time_and_ticks(self, time_ns: int, ticks: int) -> None:
        """Tells the time, and waits until the machine has made so many ticks."""
        while self._clock.get_subscription_count() < 1:
            self.listener.until(lambda: True)
        self.time(time_ns)
        self.listener.until(lambda: self.memory("machine.tick") == [ticks])


def test_ticks_are_those_of_the_clock(domain: Domain, library: Path) -> None:
    robot = Clocked(domain, library)
    robot.process.wait_for("no message of /clock has come within 2 s: with mode clock there is no tick until")
    robot.time_and_ticks(NS, 1)
    robot.sense(3.0, NS)
    robot.time_and_ticks(NS + 5 * NS // HZ, 6)
    robot.listener.until(lambda: bool(robot.torques) and robot.torque() == 3.25)
    robot.time_and_ticks(NS + 5 * NS // HZ + NS // HZ - 1, 6)  # not due yet
    robot.time_and_ticks(NS + 6 * NS // HZ, 7)
    robot.time_and_ticks(NS + 106 * NS // HZ, 27)  # 20 of 100
    robot.time_and_ticks(NS // 2, 28)  # back, as when a bag begins again
    shown = figures(robot.client.diagnosed(2)[1]["rig"])
    assert (shown["ticks skipped"], shown["/clock set back"]) == ("80", "1")
    assert robot.end() == 0
    stamps = [log_ns for topic, log_ns, _ in Bag(robot.bag).messages() if topic == "/rig/pilot"]
    ticks = [*range(7), *range(87, 107)]
    assert stamps == [*(NS + tick * NS // HZ for tick in ticks), NS // 2]
    assert replay(robot.bag, library=str(robot.library)).identical


def test_a_message_that_diagnostics_take_makes_its_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever asks for the time takes what /clock said; a slow clock says nothing more for a second."""
    made: list[int] = []
    clock, turns = SimpleNamespace(received=0, wait=lambda _: None), iter(range(3))

    def ask_for_the_time(_: ClockLoop) -> None:
        clock.received = 1

    def serve() -> None:
        if made or next(turns, None) is None:
            raise Stopped

    loop = ClockLoop.__new__(ClockLoop)
    loop._time, loop._ticks, loop._received, loop._serve = clock, ClockTicks(HZ, 1), 0, serve  # type: ignore[assignment]
    monkeypatch.setattr(ClockLoop, "_diagnose", ask_for_the_time)
    monkeypatch.setattr(ClockLoop, "now_ns", lambda _: NS)
    monkeypatch.setattr(ClockLoop, "_tick", lambda _, due_ns, now_ns: made.append(due_ns))
    with pytest.raises(Stopped):
        loop.run()
    assert made == [NS]
