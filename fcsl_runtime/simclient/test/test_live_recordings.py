# SPDX-License-Identifier: Apache-2.0
"""Where the live view begins another recording, and where it begins none any more."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from rrd import read_rrd, values
from telemetry_packets import Channel, Sender
from test_live_view import CHANNELS, SCALARS, SENDER, TEXT, feed, lines, show, told

from simclient.live import live_view
from simclient.live.live_view import LiveView
from simclient.live.viewer import NO_VIEWER, Viewer
from simclient.telemetry import receiver
from simclient.telemetry.receiver import Telemetry


@dataclass(frozen=True, unsafe_hash=True)
class Restored(Sender):
    """From packet 10 on its ticks begin again at 3."""

    def body(self, sequence: int, overwritten: int = 0) -> bytes:
        tick = sequence if sequence < 10 else sequence - 7
        return struct.pack("<Qq", tick, tick * 10**6) + super().body(sequence, overwritten)[16:]


def test_time_that_jumps_back_is_another_recording(tmp_path: Path) -> None:
    view = show(tmp_path / "x.rrd", Restored(channels=CHANNELS), list(range(20)))
    first, second = read_rrd(tmp_path / "x.rrd"), read_rrd(tmp_path / "x_2.rrd")
    assert [t for t, _ in values(first, "/probe/nav/angle", SCALARS)] == [k / 1000 for k in range(10)]
    assert [t for t, _ in values(second, "/probe/nav/angle", SCALARS)] == [k / 1000 for k in range(3, 13)]
    why = "the sender went back from tick 9 to 3"
    assert values(first, "/probe/telemetry", TEXT)[-1][1] == f"{why}: goes on in the next recording"
    assert values(second, "/probe/telemetry", TEXT)[0][1].startswith(f"{why}; session 0000000000000001")
    assert view.recordings == 2


class Falling(Sender):
    """Its ticks fall, from 100; those of packets from 20 on are beyond."""

    def body(self, sequence: int, overwritten: int = 0) -> bytes:
        tick = 100 - sequence if sequence < 20 else 100 + sequence
        return struct.pack("<Qq", tick, tick * 10**6) + super().body(sequence, overwritten)[16:]


def test_so_many_recordings_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sender whose time falls with each packet has not as many files; the last of them goes on."""
    monkeypatch.setattr(live_view, "RECORDINGS_MAX", 3)
    sender, said = Falling(channels=CHANNELS), list[str]()
    telemetry = Telemetry()
    view = LiveView(telemetry, Viewer(NO_VIEWER, str(tmp_path / "x.rrd")), said.append)
    for batch in range(10), range(10, 20), range(20, 25):
        feed(telemetry, sender, list(batch))
        view.show(rest=True)
    view.end()
    assert {path.name for path in tmp_path.iterdir()} == {"x.rrd", "x_2.rrd", "x_3.rrd"}
    assert (view.recordings, view.ticks, view.missing) == (3, 8, 17 + 21)  # left out, and from 99 to 119
    assert len(said) == 4 and said[-1].startswith("a view has at most 3 recordings")
    last = read_rrd(tmp_path / "x_3.rrd")
    notes = [text for _, text in values(last, "/probe/telemetry", TEXT)]
    assert sum(text.startswith("a view has at most 3 recordings") for text in notes) == 1
    assert notes[-1] == "21 ticks missing, from 99 to 119 in 1 gaps: 21 not sent"
    assert [time for time, value in values(last, "/probe/nav/angle", SCALARS)] == pytest.approx(
        [0.098, 0.099, 0.120, 0.121, 0.122, 0.123, 0.124]
    )


def test_a_restart_is_another_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 0.0
    monkeypatch.setattr(receiver, "time", SimpleNamespace(monotonic=lambda: now_s))
    telemetry = Telemetry()
    said: list[str] = []
    view = LiveView(telemetry, Viewer(NO_VIEWER, str(tmp_path / "x.rrd")), said.append)
    other = Sender(session=2, channels=(*CHANNELS[:4], Channel("nav.outputs.new", 6)), name="newer")
    for sender, first in (SENDER, 0), (other, 100):
        now_s += 5.0
        feed(telemetry, sender, list(range(first, first + 10)))
        view.show(rest=True)
    view.end()
    rows = read_rrd(tmp_path / "x_2.rrd")
    assert str(lines(rows, "/newer/nav/new")[1]) == str(told(other, list(range(100, 110)), "nav.outputs.new"))
    assert [text.split("; ")[0] for text in said] == [
        "session 0000000000000001 of probe at 1000 Hz, from tick 0",
        "the sender was restarted",
    ]
    assert values(read_rrd(tmp_path / "x.rrd"), "/probe/telemetry", TEXT)[-1][1].startswith("the sender was restarted")
