# SPDX-License-Identifier: Apache-2.0
"""What a stream sends of a run: all ticks as few points, with their extremes, their gaps and nothing that is old."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from telemetry_packets import Channel, Sender

from simclient.supervisor.http_error import HttpError
from simclient.supervisor.limits import STREAM_FIRST_POINTS, STREAM_POINTS, STREAM_VALUES
from simclient.supervisor.thinning import thin
from simclient.supervisor.value_feed import ValueFeed
from simclient.telemetry.receiver import Telemetry

CHANNELS = (
    Channel("machine.state", 9),
    Channel("nav.outputs.x", 6, (), "m"),
    Channel("nav.parameters.k", 6),
    Channel("nav.outputs.q", 6, (4,)),
    Channel("nav.outputs.health", 8),
)
IDLE, RUN, DONE = range(3)
NOMINAL, STALE = 0, 3


@dataclass(frozen=True)
class Flight(Sender):
    """Sequence s: x is s, but 1e6 at 777 and NaN at 50; stale from 60 to 69; IDLE, RUN from 30 on and DONE from 80 on."""

    channels: tuple[Channel, ...] = CHANNELS

    def values(self, sequence: int) -> list[list[float]]:  # type: ignore[override]
        x = {777: 1e6, 50: math.nan}.get(sequence, float(sequence))
        health = STALE if 60 <= sequence < 70 else NOMINAL
        turned = [math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8)]  # 45 degrees about z
        return [[RUN if 30 <= sequence < 80 else DONE if sequence >= 80 else IDLE], [x], [7.0], turned, [health]]


class Feed:
    """A feed of a run whose telemetry is given by hand."""

    def __init__(self, *paths: str, angles: tuple[str, ...] = (), sender: Sender | None = None):
        self.telemetry = Telemetry()
        self.sender = sender or Flight()
        run: Any = SimpleNamespace(name="1", telemetry=self.telemetry)
        self.feed = ValueFeed(run, paths, angles)

    def configure(self) -> None:
        for datagram in self.sender.configuration():
            self.telemetry.feed(datagram)

    def fly(self, *sequences: int) -> Any:
        """The update with these ticks; None if there is none."""
        for sequence in sequences:
            for datagram in self.sender.data(sequence):
                self.telemetry.feed(datagram)
        found = self.feed.update()
        return None if found is None else json.loads(found)


def configured(*paths: str, angles: tuple[str, ...] = (), sender: Sender | None = None) -> Feed:
    feed = Feed(*paths, angles=angles, sender=sender)
    feed.configure()
    return feed


def test_an_update_has_what_is_new() -> None:
    feed = Feed("nav.outputs.x")
    assert feed.fly() is None
    feed.configure()
    assert feed.fly() is None
    first, second = feed.fly(0, 1, 2), feed.fly(3)
    assert first["first"] and first["run"] == "1" and first["tick"] == 2
    assert first["time_s"] == [0.0, 0.001, 0.002] and first["values"] == {"nav.outputs.x": [0.0, 1.0, 2.0]}
    assert not second["first"] and second["time_s"] == [0.003] and second["values"] == {"nav.outputs.x": [3.0]}
    assert feed.fly() is None


def test_many_ticks_are_few_points_with_every_extreme_and_the_newest_value() -> None:
    feed = configured("nav.outputs.x")
    feed.fly(0)
    update = feed.fly(*range(100, 1000))
    found = update["values"]["nav.outputs.x"]
    assert len(found) == len(update["time_s"]) <= STREAM_POINTS
    assert max(found) == 1e6 and min(found) == 100.0 and found[-1] == 999.0
    assert update["time_s"][0] == 0.1 and update["time_s"][-1] == 0.999
    feed = configured("nav.outputs.x")
    assert STREAM_POINTS < len(feed.fly(*range(5000))["time_s"]) <= STREAM_FIRST_POINTS


def test_the_size_of_an_update_is_bounded() -> None:
    """However many ticks came, with numbers as long as they can be."""

    @dataclass(frozen=True)
    class Wide(Sender):
        def values(self, sequence: int) -> list[list[float]]:  # type: ignore[override]
            return [[-math.pi * 1e-300 * (1 + sequence % 97)] * STREAM_VALUES]

    feed = configured("wide.outputs.v", sender=Wide(channels=(Channel("wide.outputs.v", 6, (STREAM_VALUES,)),)))
    for sequences, most in ((range(3000), 2_500_000), (range(3000, 6000), 65_000)):
        size = len(json.dumps(feed.fly(*sequences), separators=(",", ":")))
        assert most / 3 < size < most


def test_ticks_that_are_missing_are_gaps() -> None:
    feed = configured("nav.outputs.x")
    assert feed.fly(0, 1, 4, 5)["breaks"] == [2]
    assert feed.fly(6)["breaks"] == [] and feed.fly(8)["breaks"] == [0]
    assert feed.fly(*range(9, 500), *range(600, 1000))["breaks"] != []  # also where ticks are thinned
    every = configured("nav.outputs.x", sender=Flight(every=3))
    assert every.fly(0, 1, 2, 4)["breaks"] == [3]


def test_old_and_unknown_values_are_left_out() -> None:
    feed = configured("nav.outputs.x", "nav.parameters.k", "nav.outputs.health")
    update = feed.fly(49, 50, 59, 60, 69, 70)
    assert update["values"]["nav.outputs.x"] == [49.0, None, 59.0, None, None, 70.0]
    assert update["values"]["nav.parameters.k"] == [7.0] * 6  # no execute sets it
    assert update["values"]["nav.outputs.health"] == [NOMINAL, NOMINAL, NOMINAL, STALE, STALE, NOMINAL]


def test_states_come_when_they_change() -> None:
    feed = configured()
    assert feed.fly(28, 29, 30, 31)["states"] == [[0.028, "IDLE"], [0.03, "RUN"]]
    assert feed.fly(32)["states"] == []
    assert feed.fly(79, 80)["states"] == [[0.08, "DONE"]]


def test_arrays_and_quaternions() -> None:
    values = configured("nav.outputs.q", "nav.outputs.x", angles=("nav.outputs.q",)).fly(1)["values"]
    assert list(values) == [
        *(f"nav.outputs.q[{i}]" for i in range(4)), "nav.outputs.x", *(f"nav.outputs.q.{a}" for a in ("roll", "pitch", "yaw"))
    ]  # fmt: skip
    assert values["nav.outputs.q.yaw"] == [pytest.approx(45.0)] and values["nav.outputs.q.roll"] == [0.0]
    assert configured("nav.outputs.q[3]").fly(1)["values"] == {
        "nav.outputs.q[3]": [pytest.approx(math.sin(math.pi / 8))]
    }


@pytest.mark.parametrize(
    ("paths", "angles", "status"),
    [(("nav.outputs.y",), (), 404), ((), ("nav.outputs.x",), 400), (("wide.outputs.v",), (), 413)],
)
def test_what_cannot_be_sent_is_refused(paths: tuple[str, ...], angles: tuple[str, ...], status: int) -> None:
    wide = Channel("wide.outputs.v", 6, (STREAM_VALUES + 1,))
    feed = Feed(*paths, angles=angles, sender=Sender(channels=(*CHANNELS, wide)))
    feed.feed.check()  # nothing is known yet
    feed.configure()
    for refuse in (feed.feed.check, feed.feed.update):
        with pytest.raises(HttpError) as refused:
            refuse()
        assert refused.value.status == status


def test_another_session_begins_anew() -> None:
    feed = configured("nav.outputs.x")
    before = feed.fly(0, 1)
    feed.telemetry = feed.feed._run.telemetry = Telemetry()
    feed.sender = Flight(session=2)
    feed.configure()
    after = feed.fly(0)
    assert after["first"] and after["session"] != before["session"] and after["states"] == [[0.0, "IDLE"]]


@given(
    st.lists(st.floats(allow_infinity=False, width=32), min_size=1, max_size=300),
    st.lists(st.integers(0, 5), min_size=300, max_size=300),
    st.integers(6, 50),
)
@example([*range(19), math.nan], [0] * 300, 6)  # the newest row is a point of its own
@example([math.nan, *range(19)], [0] * 300, 6)
def test_thinning(values: list[float], gaps: list[int], points: int) -> None:
    column, before = np.array(values), np.array(gaps[: len(values)])
    thinned = thin(before, points)
    found = thinned.of(column)
    assert len(found) == len(thinned.rows) <= points and thinned.rows[-1] == len(values) - 1
    assert np.all(np.diff(thinned.rows) > 0) and np.all(before[thinned.rows[thinned.breaks]] > 0)
    if not np.all(np.isnan(column)):
        assert np.nanmin(found) == np.nanmin(column) and np.nanmax(found) == np.nanmax(column)
    assert np.array_equal(found[-1], column[-1], equal_nan=True)
    if before[1:].any():  # the largest gap is seen
        assert before[thinned.rows[thinned.breaks]].max(initial=0) >= before[1:].max()
