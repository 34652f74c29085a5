# SPDX-License-Identifier: Apache-2.0
"""What the live view shows is what telemetry said: every value, gaps as gaps, each session in a recording of its own."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import rerun.blueprint as rrb
from rrd import Rows, read_rrd, time_series, values, views
from telemetry_packets import LABELS, Channel, Sender

from simclient.errors import ViewError
from simclient.live.channels import ELEMENTS_MAX, channels_of
from simclient.live.live_view import LiveView
from simclient.live.viewer import NO_VIEWER, Viewer
from simclient.telemetry import configuration
from simclient.telemetry.receiver import Telemetry
from simclient.view.blueprint import Plan
from simclient.view.world import World

SCALARS, STATE, TEXT = "Scalars:scalars", "StateChange:state", "TextLog:text"
CHANNELS = (
    Channel("machine.state", 9),
    Channel("nav.outputs.angle", 6, (), "rad"),
    Channel("nav.outputs.P", 5, (2, 3), "m"),
    Channel("nav.outputs.health", 8),
    Channel("nav.outputs.on", 0, (3,)),
    Channel("nav.inputs.gyro", 6, (3,), "rad/s"),
    Channel("nav.counters.faults", 4),
    Channel("channels.imu.gyro.valid", 0),
    Channel("body.outputs.position", 6, (3,), "m"),
)
#: Where each channel is shown; body has no health, so it is the plant.
ENTITIES = {
    "nav.outputs.angle": "/probe/nav/angle",
    "nav.outputs.P": "/probe/nav/P",
    "nav.outputs.on": "/probe/nav/on",
    "nav.inputs.gyro": "/probe/nav/inputs/gyro",
    "nav.counters.faults": "/probe/nav/counters/faults",
    "channels.imu.gyro.valid": "/probe/record/channels/imu.gyro.valid",
    "body.outputs.position": "/sim/body/position",
}
SENDER = Sender(channels=CHANNELS)
STALE = LABELS[8].index("stale")


def show(path: Path, sender: Sender, *batches: list[int]) -> LiveView:
    """Shows these packets, a batch at a time, in a file."""
    telemetry = Telemetry()
    view = LiveView(telemetry, Viewer(NO_VIEWER, str(path)))
    for batch in batches:
        feed(telemetry, sender, batch)
        view.show(rest=True)
    view.end()
    return view


def feed(telemetry: Telemetry, sender: Sender, sequences: list[int]) -> None:
    for datagram in [*sender.configuration(sequences[0]), *(d for s in sequences for d in sender.data(s))]:
        telemetry.feed(datagram)


def told(sender: Sender, sequences: list[int], path: str) -> list[list[float]]:
    """What the sender said of a channel; of outputs and inputs of a stale instance NaN."""
    at = [channel.path for channel in sender.channels].index(path)
    health = [channel.path for channel in sender.channels].index("nav.outputs.health")
    rows = []
    for sequence in sequences:
        row = sender.values(sequence)
        stale = path.startswith(("nav.outputs", "nav.inputs")) and row[health][0] == STALE
        rows.append([math.nan] * len(row[at]) if stale else row[at])
    return rows


def lines(rows: Rows, entity: str) -> tuple[list[float], list[list[float]]]:
    """Times and values."""
    found = values(rows, entity, SCALARS)
    return [time for time, _ in found], [value if isinstance(value, list) else [value] for _, value in found]


def assert_shown(rows: Rows, sender: Sender, sequences: list[int]) -> None:
    """Every value at its time; a line of NaN behind each row whose successor is missing."""
    times, gaps = [], []
    for sequence, after in zip(sequences, [*sequences[1:], sequences[-1] + 1], strict=True):
        times.append(sequence / sender.tick_hz)
        if after != sequence + 1:
            times.append((sequence + 1) / sender.tick_hz)
            gaps.append(len(times) - 1)
    for path, entity in ENTITIES.items():
        shown_times, shown = lines(rows, entity)
        expected = told(sender, sequences, path)
        for gap in gaps:
            expected.insert(gap, [math.nan] * len(expected[0]))
        assert shown_times == pytest.approx(times, abs=1e-9)
        assert str(shown) == str([[float(v) for v in row] for row in expected]), path  # as text: NaN is NaN


def test_every_value_is_shown_at_its_time(tmp_path: Path) -> None:
    view = show(tmp_path / "x.rrd", SENDER, list(range(20)), list(range(20, 21)), list(range(21, 60)))
    rows = read_rrd(tmp_path / "x.rrd")
    assert_shown(rows, SENDER, list(range(60)))
    assert (view.ticks, view.missing, view.recordings) == (60, 0, 1)
    assert not any(e.endswith(("/tick", "/next_state")) or e.startswith("/world") for e in rows)


def test_a_wide_instance_is_shown_whole(tmp_path: Path) -> None:
    fields = tuple(Channel(f"wide.outputs.f{k}", 6) for k in range(200))
    sender = Sender(channels=fields)
    show(tmp_path / "x.rrd", sender, [0, 1, 2], [3])
    rows = read_rrd(tmp_path / "x.rrd")
    for k in range(200):
        assert lines(rows, f"/probe/wide/f{k}")[1] == [sender.values(s)[k] for s in range(4)]


def changes(numbers: list[int], labels: tuple[str, ...]) -> list[tuple[int, str]]:
    return [(k, labels[n]) for k, n in enumerate(numbers) if k == 0 or n != numbers[k - 1]]


def test_states_and_healths_are_lanes_of_changes(tmp_path: Path) -> None:
    show(tmp_path / "x.rrd", SENDER, list(range(30)), list(range(30, 60)))
    rows = read_rrd(tmp_path / "x.rrd")
    for at, labels, entity in ((0, LABELS[9], "/probe/state"), (3, LABELS[8], "/probe/nav/health")):
        numbers = [int(SENDER.values(s)[at][0]) for s in range(60)]
        expected = [(k / 1000, label) for k, label in changes(numbers, labels)]
        assert len(expected) > 10 and values(rows, entity, STATE) == expected
    starts, *moves = [text for _, text in values(rows, "/probe/transitions", TEXT)]
    names = [label for _, label in changes([int(SENDER.values(s)[0][0]) for s in range(60)], LABELS[9])]
    assert starts == f"starts in {names[0]}"
    assert moves == [f"{a} → {b}" for a, b in zip(names, names[1:], strict=False)]


@pytest.mark.parametrize("other", [Channel("nav.outputs.health", 6), Channel("nav.outputs.health", 8, (3,))])
def test_only_the_health_of_an_instance_is_a_lane(tmp_path: Path, other: Channel) -> None:
    """What else is called so is a line, and a health that no machine has, but anyone may send, is left out."""
    named = (
        Channel("nav.state.health", 6),
        Channel("nav.inputs.health", 8),
        Channel("nav.state.outputs.health", 6, (3,)),
    )
    right, wrong = (Sender(channels=(Channel("nav.outputs.angle", 6), h, *named)) for h in (CHANNELS[3], other))
    for sender, file in ((right, tmp_path / "right.rrd"), (wrong, tmp_path / "wrong.rrd")):
        show(file, sender, [0, 1, 3])
        rows = read_rrd(file)
        for at, channel in enumerate(named, start=2):
            shown = lines(rows, "/probe/" + channel.path.replace(".", "/", 2))[1]
            for row, s in zip(shown[:2] + shown[3:], (0, 1, 3), strict=True):
                stale = sender is right and sender.values(s)[1][0] == STALE
                assert str(row) == str([math.nan if stale else float(v) for v in sender.values(s)[at]])
            assert all(map(math.isnan, shown[2]))
    assert values(read_rrd(tmp_path / "right.rrd"), "/probe/nav/health", STATE)
    assert not values(rows, "/probe/nav/health", STATE) and lines(rows, "/probe/nav/angle")[1]


@pytest.mark.parametrize("kind", [4, 6])
def test_a_state_that_is_none_is_not_shown(tmp_path: Path, kind: int) -> None:
    """As no machine sends it, but anyone may."""
    sender = Sender(channels=(Channel("machine.state", kind), Channel("nav.outputs.angle", 6)))
    show(tmp_path / "x.rrd", sender, [0, 1, 3])
    rows = read_rrd(tmp_path / "x.rrd")
    assert not values(rows, "/probe/state", STATE) and len(lines(rows, "/probe/nav/angle")[1]) == 4


def test_gaps_are_gaps_and_told(tmp_path: Path) -> None:
    there = [*range(10), *range(13, 20), *range(30, 40)]
    view = show(tmp_path / "x.rrd", SENDER, there[:12], there[12:])
    rows = read_rrd(tmp_path / "x.rrd")
    assert_shown(rows, SENDER, there)
    for entity in ("/probe/state", "/probe/nav/health"):
        lane = values(rows, entity, STATE)
        assert [(time, name) for time, name in lane if name == ""] == [(0.010, ""), (0.020, "")]
        known = [time for time, _ in lane]
        assert 0.013 in known and 0.030 in known  # begins again, even as the same
    notes = [text for _, text in values(rows, "/probe/telemetry", TEXT)][1:]
    assert notes == [
        "3 ticks missing, from 10 to 12 in 1 gaps: 3 lost in transit",
        "10 ticks missing, from 20 to 29 in 1 gaps: 10 lost in transit",
    ]
    assert view.missing == 13


def test_who_joins_late_begins_there(tmp_path: Path) -> None:
    show(tmp_path / "x.rrd", SENDER, list(range(500, 520)))
    rows = read_rrd(tmp_path / "x.rrd")
    assert_shown(rows, SENDER, list(range(500, 520)))
    assert [text for _, text in values(rows, "/probe/telemetry", TEXT)] == [
        "session 0000000000000001 of probe at 1000 Hz, from tick 500"
    ]


def test_the_layout_has_a_plot_per_instance_and_unit(tmp_path: Path) -> None:
    show(tmp_path / "x.rrd", SENDER, [0, 1])
    plots = {name for name, kind in views(tmp_path / "x.rrd").items() if kind == "TimeSeries"}
    assert {"nav, rad", "nav, m", "nav", "nav.inputs, rad/s", "nav.counters", "channels", "body, m"} <= plots
    kinds = views(tmp_path / "x.rrd")
    assert kinds["state"] == kinds["health"] == "StateTimeline" and "3D" not in kinds.values()
    assert kinds["events"] == "TextLog"


VIEWS = (
    '{"panels": [{"title": "where", "truth": ["body.outputs.position"], "estimate": ["nav.outputs.P[1]"]}, '
    '{"title": "none", "values": ["nav.outputs.gone"]}], '
    '"body": {"shape": "rover", "position": "body.outputs.position"}}'
)


def test_the_sender_chooses_panels_and_body(tmp_path: Path) -> None:
    show(tmp_path / "x.rrd", Sender(channels=CHANNELS, views=VIEWS), [0, 1])
    rows, kinds = read_rrd(tmp_path / "x.rrd"), views(tmp_path / "x.rrd")
    assert kinds["where, m"] == "TimeSeries" and kinds["vehicle"] == "3D" and "none" not in kinds
    assert len(values(rows, "/world/vehicle", "Transform3D:translation")) == 2
    notes = [text for _, text in values(rows, "/probe/telemetry", TEXT)]
    assert notes[1:] == ["left out of the first page: nav.outputs.gone (not recorded)"]


def test_views_that_are_none_are_told_and_ignored(tmp_path: Path) -> None:
    show(tmp_path / "x.rrd", Sender(channels=CHANNELS, views='{"panels": 1}'), [0, 1], [2])
    notes = [text for _, text in values(read_rrd(tmp_path / "x.rrd"), "/probe/telemetry", TEXT)]
    assert notes[1:] == ["left out of the first page: the views of the run (views.panels: not a list)"]


class Deaf:
    """A stream that takes everything."""

    def __getattr__(self, name: str) -> object:
        return lambda *_, **__: None


@pytest.mark.parametrize(("instances", "fields"), [(300, 10), (1, 3000), (3000, 1)])
def test_thousands_of_channels_have_pages_that_can_be_drawn(instances: int, fields: int) -> None:
    channels = {
        f"i{i}.outputs.f{k}": configuration.Channel("f64", (), "m", ()) for i in range(instances) for k in range(fields)
    }
    channels |= {"i0.outputs.huge": configuration.Channel("f64", (ELEMENTS_MAX + 1,), "", ())}
    found = channels_of("large", channels)
    assert sum(map(len, found.paths.values())) == 3000 and found.too_large == ["i0.outputs.huge"]
    world = World(Deaf(), None, found.cast.catalogue)
    plan = Plan(found.cast, world, None)
    page = plan._part("outputs", found.cast.instances)
    pages = [time_series(child) for child in page.contents] if isinstance(page, rrb.Tabs) else [time_series(page)]
    assert len(pages) <= 16 and max(map(len, pages)) <= 48
    shown = [list(plot.contents) for plots_of_page in pages for plot in plots_of_page]
    assert max(map(len, shown)) <= 8
    entities = [entity for some in shown for entity in some]
    assert len(entities) == len(set(entities)) == {1: 3000, 300: 1920, 3000: 192}[instances]


def test_a_place_that_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "there.rrd").touch()
    (tmp_path / "later_2.rrd").touch()
    for connect, save, reason in (
        ("nowhere", "", "is not a viewer"),
        (NO_VIEWER, "", "name a file"),
        (NO_VIEWER, str(tmp_path / "none" / "x.rrd"), "no such directory"),
        (NO_VIEWER, str(tmp_path), "is a directory"),
        (NO_VIEWER, str(tmp_path / "there.rrd"), r"there\.rrd exists already"),
        (NO_VIEWER, str(tmp_path / "later.rrd"), r"later_2\.rrd exists already"),
    ):
        with pytest.raises(ViewError, match=reason):
            Viewer(connect, save)
