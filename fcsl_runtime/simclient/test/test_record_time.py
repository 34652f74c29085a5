# SPDX-License-Identifier: Apache-2.0
"""A bag of a host with a clock of its own, such as ROS time: its messages carry that time, and its values are the same."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
import yaml
from rosbags.highlevel import AnyReader

from simclient.bag import Bag, columns
from simclient.bag.diff import diff
from simclient.bag.digest import digest
from simclient.replay import replay
from simclient.replay.cut import cut
from simclient.run import open_run
from simclient.view.picture import choose, draw, pyplot
from simclient.view.recorded import RecordedRun

TICKS = 60
#: 2026-11-24T08:00:00Z, and the period of the probe.
START_NS, PERIOD_NS = 1_795_507_200_000_000_000, 10_000_000
#: Ticks before which the host missed deadlines.
MISSED = {20: 3, 41: 1}


def times_ns() -> list[int]:
    """The time of each tick."""
    found, now = [], START_NS
    for tick in range(TICKS):
        now += PERIOD_NS * (1 + MISSED.get(tick, 0))
        found.append(now)
    return found


def fly(library: Path, bag: Path, ros_time: bool) -> Path:
    """Records TICKS ticks with a write before each of them, which takes place at the time of the tick before."""
    run = open_run(library, None)
    if ros_time:
        run.record_time(START_NS)
    run.record(bag, "car", lossless=True)
    vec = run.machine.fields["source.outputs.vec"].index
    for tick, time_ns in enumerate(times_ns()):
        run.set(vec, 0, struct.pack("<d", 0.5 * tick))
        if ros_time:
            run.record_time(time_ns)
        run.step(1)
    run.record_stop()
    run.close()
    return bag


@pytest.fixture
def bag(probe: Path, tmp_path: Path) -> Path:
    return fly(probe, tmp_path / "ros", True)


def test_log_times_and_stamps_are_those_of_the_host(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        for connection, log_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == log_ns
            if connection.topic.endswith(("/checkpoint", "/writes")):
                assert log_ns == (START_NS if message.tick == 0 else times_ns()[message.tick - 1])
            else:
                assert log_ns == times_ns()[message.tick], connection.topic
        assert reader.start_time == START_NS
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert metadata["starting_time"]["nanoseconds_since_epoch"] == START_NS


def test_the_values_are_those_of_any_other_host(bag: Path, probe: Path, tmp_path: Path) -> None:
    plain = fly(probe, tmp_path / "plain", False)
    with AnyReader([plain]) as reader:
        assert reader.start_time == 0
    assert digest(bag) == digest(plain)
    difference = diff(Bag(plain), Bag(bag))
    assert difference.same, str(difference)
    verdict = replay(bag, library=str(probe))
    assert verdict.identical and verdict.ticks == TICKS, str(verdict)


@pytest.mark.parametrize("first", [1, 20, 41, 59])
@pytest.mark.parametrize("early_ns", [0, 1, 15_000_000])
def test_a_cut_has_the_writes_of_its_first_tick(
    bag: Path, probe: Path, tmp_path: Path, first: int, early_ns: int
) -> None:
    """The cut begins at, or some time before, the first tick; the write that this tick sees is older."""
    begin_ns = times_ns()[first] - early_ns
    began = next(tick for tick, time_ns in enumerate(times_ns()) if time_ns >= begin_ns)
    whole, run = Bag(bag), open_run(probe, None)
    cut(whole, tmp_path / "part", begin_ns, times_ns()[-1], (whole.machine(), run))
    run.close()
    verdict = replay(tmp_path / "part", library=str(probe))
    assert verdict.identical and verdict.ticks == TICKS - began, str(verdict)
    t_s, values = columns(str(tmp_path / "part"), "source.outputs.vec")
    assert values[:, 0].tolist() == [0.5 * tick for tick in range(began, TICKS)]
    assert t_s[0] == pytest.approx(times_ns()[began] * 1e-9)


def test_a_plot_counts_seconds_from_the_first_tick(bag: Path) -> None:
    opened = Bag(bag)
    recorded = RecordedRun(opened, "", "", foreign=False)
    figure = draw(recorded, choose(recorded, ["source.outputs.vec"]), "probe")
    try:
        (axis,) = figure.axes
        assert axis.get_xlabel() == "time since 2026-11-24 08:00:00.010000 UTC, s"
        assert axis.lines[0].get_xdata()[0] == 0.0
        assert axis.get_xlim() == pytest.approx((0.0, (times_ns()[-1] - times_ns()[0]) * 1e-9), abs=0.011)
    finally:
        pyplot.close(figure)
