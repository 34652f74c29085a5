# SPDX-License-Identifier: Apache-2.0
"""What rerun shows of a run is what the run did: lines, states, health, pose, thrust; in whatever batches it comes."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st
from rerun.chunk import RrdReader
from rrd import Rows, read_rrd, time_series, values, views

from simclient import AlgTwin
from simclient.bag.states import StateSample
from simclient.view.blueprint import Plan
from simclient.view.mesh import extent_of
from simclient.view.rrd import to_rerun
from simclient.view.scene import Cast, Scene
from simclient.view.signals import STALE, Signals
from simclient.view.styles import styles
from simclient.view.views import Body, Views, parse_views

SCALARS, STATE, TEXT = "Scalars:scalars", "StateChange:state", "TextLog:text"
TRANSLATION, SCALE, TURN = (f"Transform3D:{name}" for name in ("translation", "scale", "quaternion"))
STEP_S = 0.01
VEHICLE = [
    Signals("nav", "/m/nav", False, {"place": 3, "turned": 4, "health": 0}, {"place": "m"}),
    Signals("engine", "/m/engine", False, {"push": 3, "health": 0}, {"push": "N"}),
    Signals("body", "/sim/body", True, {"z": 0}, {"z": "m"}),
]
INSIDE = [Signals("nav.inputs", "/m/nav/inputs", False, {"seen": 0})]
NAV = Body("rover", 2.0, ("nav.outputs.place",), "nav.outputs.turned", "engine.outputs.push", "+z", "")


@pytest.fixture
def shown(probe: Path, tmp_path: Path) -> Rows:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run", "car")
        for k in range(60):
            twin.set("source.outputs.vec", [math.sin(k / 5), 0.0, 1.0])
            if k in (20, 50):
                twin.set_state("ACTIVE" if k == 20 else "IDLE")
            twin.tick()
    to_rerun(tmp_path / "run", tmp_path / "run.rrd")
    return read_rrd(tmp_path / "run.rrd")


def test_lines_are_the_outputs(shown: Rows) -> None:
    vec = values(shown, "/car/probe/source/vec", SCALARS)
    assert [time for time, _ in vec] == pytest.approx([k * STEP_S for k in range(60)])
    assert [value[0] for _, value in vec] == [math.sin(k / 5) for k in range(60)]


def test_states_are_lanes_a_step_plot_markers_and_a_log(shown: Rows) -> None:
    assert values(shown, "/car/probe/state", STATE) == [(0.0, "IDLE"), (0.2, "ACTIVE"), (0.5, "IDLE")]
    assert values(shown, "/car/probe/state/step", SCALARS) == [(0.0, 0.0), (0.2, 1.0), (0.5, 0.0), (0.59, 0.0)]
    assert values(shown, "/car/probe/transitions/marker", SCALARS) == [(0.2, 1.0), (0.5, 0.0)]
    texts = [text for _, text in values(shown, "/car/probe/transitions", TEXT)]
    assert texts == ["starts in IDLE", "IDLE → ACTIVE", "ACTIVE → IDLE"]


def play(
    path: Path, signals: Sequence[Signals], batches: Sequence[int], body: Body | None = NAV, panels: str = ""
) -> Rows:
    """A vehicle that climbs, turns and pushes, shown in batches of these sizes. nav is stale in every 17th tick."""
    stream = rr.RecordingStream("test")
    stream.save(path)
    views = Views(parse_views(panels).panels if panels else (), body)
    stage = Scene(stream, Cast("/m", signals, ["UP", "DOWN"], INSIDE, views))
    at = 0
    for size in batches:
        k = np.arange(at, at + size)
        t_s = k * STEP_S
        columns = {
            "place": np.stack([0.0 * k, 0.1 * k, 1.0 * k], axis=1),
            "turned": np.stack([np.cos(k / 50), 0 * k, np.sin(k / 50), 0 * k], axis=1),
            "push": np.stack([0.0 * k, 0.0 * k, 100.0 + 0 * k], axis=1),
            "z": 2.0 * k,
            "level": 0.25 + 0.0 * k,
            "seen": 3.0 * k,
            "health": np.where(k % 17 == 16, STALE, np.where(k % 17 == 0, 2, 0)).astype(np.uint8),
        }
        everything = [*signals, *INSIDE] if size else []
        values = {its.topic: (t_s, {name: columns[name] for name in its.sizes}) for its in everything}
        states = [("UP", 0), ("DOWN", 30)]
        stage.show(values, [StateSample(n, int(n * STEP_S * 1e9), s, s) for s, n in states if at <= n < at + size])
        at += size
    stream.send_blueprint(Plan(stage.cast, stage.world, None).blueprint())
    stream.disconnect()
    return read_rrd(path)


def test_health_is_lanes_of_changes_and_a_log_of_the_bad_ones(tmp_path: Path) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE[:2], [10, 20])
    changes = [(0.0, "failed"), (0.01, "nominal"), (0.16, "stale"), (0.17, "failed"), (0.18, "nominal")]
    assert values(rows, "/m/nav/health", STATE) == changes
    log = [(t, text) for t, text in values(rows, "/m/health", TEXT) if text.startswith("nav")]
    assert log == [(t, f"nav: {health}") for t, health in changes if health != "stale"]


@pytest.mark.parametrize("entity", ["/m/nav/inputs/seen", "/m/nav/place"])
def test_what_a_stale_instance_keeps_is_not_drawn(tmp_path: Path, entity: str) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE, [10, 7, 33])
    gaps = [round(t / STEP_S) for t, value in values(rows, entity, SCALARS) if np.isnan(value).any()]
    assert gaps == [16, 33]


def test_pose_and_thrust_follow_the_body_of_the_views(tmp_path: Path) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE[:2], [60])
    poses = dict(values(rows, "/world/vehicle", TRANSLATION))
    assert list(poses[0.59]) == pytest.approx([0.0, 5.9, 59.0]) and 0.16 not in poses
    turned = dict(values(rows, "/world/vehicle/body", TURN))[0.25]
    assert list(turned) == pytest.approx([0.0, math.sin(0.5), 0.0, math.cos(0.5)], abs=1e-6)  # x, y, z, w
    arrows = values(rows, "/world/vehicle/body/thrust", "Arrows3D:vectors")
    assert {tuple(round(x, 5) for x in vector) for _, vector in arrows} == {(0.0, 0.0, 0.0), (0.0, 0.0, 2.6)}
    marker = values(rows, "/world/transitions/1", "Points3D:positions")
    assert [(time, list(point)) for time, point in marker] == [(0.3, pytest.approx([0.0, 3.0, 30.0]))]


def test_a_thrust_without_a_unit_is_a_share(tmp_path: Path) -> None:
    throttle = Signals("throttle", "/m/throttle", False, {"level": 0}, {})
    body = replace(NAV, thrust="throttle.outputs.level")
    rows = play(tmp_path / "x.rrd", [VEHICLE[0], throttle], [60], body)
    arrows = values(rows, "/world/vehicle/body/thrust", "Arrows3D:vectors")
    assert {tuple(round(x, 5) for x in vector) for _, vector in arrows} == {(0.0, 0.0, 0.25 * 2.6)}


@pytest.mark.parametrize("entity", ["/world/vehicle", "/world/vehicle/body"])
def test_a_vehicle_whose_place_or_attitude_is_not_known_vanishes(tmp_path: Path, entity: str) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE[:2], [16, 20])
    sizes = [(round(t / STEP_S), float(np.max(s))) for t, s in values(rows, entity, SCALE)]
    assert [t for t, size in sizes if 0.0 < size < 1e-6] == [16, 33] and len(sizes) == 36


def test_a_position_of_constants_and_of_another_topic(tmp_path: Path) -> None:
    body = Body("lander", 3.0, (1.5, "nav.inputs.seen", "body.outputs.z"), "", "", "-z", "")
    rows = play(tmp_path / "x.rrd", VEHICLE, [30, 30], body)
    poses = dict(values(rows, "/world/vehicle", TRANSLATION))
    assert list(poses[0.41]) == pytest.approx([1.5, 123.0, 82.0])


def test_a_position_of_a_topic_that_is_silent_keeps_its_newest_value(tmp_path: Path) -> None:
    """Through batches that have nothing of it; before its first value the vehicle is hidden."""
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "x.rrd")
    body = Body("lander", 3.0, ("nav.inputs.seen", "body.outputs.z", 1.5), "", "", "-z", "")
    stage = Scene(stream, Cast("/m", VEHICLE, [], INSIDE, Views((), body)))
    for k in range(6):
        told = {INSIDE[0].topic: (np.array([k * STEP_S]), {"seen": np.array([3.0 * k])})}
        if k in (1, 3):
            told[VEHICLE[2].topic] = (np.array([k * STEP_S]), {"z": np.array([2.0 * k])})
        stage.show(told, [])
    stream.disconnect()
    poses = values(read_rrd(tmp_path / "x.rrd"), "/world/vehicle", TRANSLATION)
    assert [list(position) for _, position in poses[-5:]] == [
        pytest.approx([3.0 * k, z, 1.5]) for k, z in enumerate((2.0, 2.0, 6.0, 6.0, 6.0), start=1)
    ]


def test_an_attitude_alone_stays_at_the_origin(tmp_path: Path) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE, [10], Body("satellite", 1.0, (), "nav.outputs.turned", "", "+z", ""))
    assert "/world/vehicle" not in rows and len(values(rows, "/world/vehicle/body", TURN)) == 10


def test_without_a_body_nothing_is_3d(tmp_path: Path) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE, [10], None)
    assert not any(entity.startswith("/world") for entity in rows)
    assert "3D" not in views(tmp_path / "x.rrd").values()


def test_a_body_that_is_not_recorded_is_told(tmp_path: Path) -> None:
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "x.rrd")
    body = Body("mesh", 1.0, ("gone.outputs.p",), "nav.outputs.turned", "nav.outputs.place", "+z", "/none/x.stl")
    scene = Scene(stream, Cast("/m", VEHICLE, [], (), Views((), replace(body, thrust="nav.outputs.turned"))))
    stream.disconnect()
    assert scene.left_out == [
        "gone.outputs.p (not recorded)",
        "nav.outputs.turned (of another shape)",
        "/none/x.stl (no such file; a box takes its place)",
    ]
    assert [c.entity_path for c in RrdReader(str(tmp_path / "x.rrd")).stream() if c.entity_path.endswith("/box")]


PANELS = """{"panels": [
    {"title": "height", "truth": ["body.outputs.z"], "measured": ["nav.inputs.seen"], "estimate": ["nav.outputs.place[2]"]},
    {"title": "attitude", "angles": true, "estimate": ["nav.outputs.turned"]}]}"""


def test_the_first_page_has_the_panels_of_the_views_in_order(tmp_path: Path) -> None:
    stage = Scene(rr.RecordingStream("test"), Cast("/m", VEHICLE, [], INSIDE, parse_views(PANELS)))
    shown = time_series(Plan(stage.cast, stage.world, (0.0, 1.0))._overview())
    assert [plot.name for plot in shown] == ["height, m", "roll, deg", "pitch, deg", "yaw, deg"]
    assert list(shown[0].contents) == ["/m/nav/inputs/seen", "/m/nav/place", "/sim/body/z"]  # back to front
    assert list(shown[3].contents) == ["/m/nav/turned/yaw_deg"]
    rows = play(tmp_path / "x.rrd", VEHICLE, [5, 55], panels=PANELS)
    pitch = values(rows, "/m/nav/turned/pitch_deg", SCALARS)
    assert [angle for _, angle in pitch][:16] == pytest.approx([math.degrees(k / 25) for k in range(16)])
    assert not any(entity.startswith("/m/nav/place/") for entity in rows)


@pytest.mark.parametrize(("span", "begin_s", "end_s"), [((2.0, 9.0), 2.0, 9.0), (None, -30.0, 0.0)])
def test_a_legend_has_three_tenths_of_its_plot_beside_the_data(
    span: tuple[float, float] | None, begin_s: float, end_s: float
) -> None:
    """Of a whole run, and of the last 30 s of a live one."""
    stage = Scene(rr.RecordingStream("test"), Cast("/m", VEHICLE, [], INSIDE, parse_views(PANELS)))
    plan = Plan(stage.cast, stage.world, span)
    (plot, *_), bands = time_series(plan._overview()), plan._states()
    sights = [view.properties["TimeAxis"].view_range.as_arrow_array().to_pylist() for view in (plot, bands)]
    with_legend, data = [(sight["start"] / 1e9, sight["end"] / 1e9) for (sight,) in sights]
    assert data == (begin_s, end_s)
    assert with_legend == (begin_s, pytest.approx(begin_s + (end_s - begin_s) / 0.7))


def test_styles_and_legends_are_those_of_pictures(tmp_path: Path) -> None:
    play(tmp_path / "x.rrd", VEHICLE, [20], panels=PANELS)
    reader = RrdReader(str(tmp_path / "x.rrd"))
    looks: dict[str, Any] = {}
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.startswith(("SeriesLines:", "SeriesPoints:")):
                entity = chunk.entity_path.partition("/ViewContents/overrides/")[2]
                looks.setdefault(entity, {})[name] = batch.column(name)[0].as_py()
    by_name = {tuple(look[name]): look for look in looks.values() for name in look if name.endswith(":names")}
    place = by_name["", "", "nav.place[2]"]
    assert place["SeriesLines:visible_series"] == [False, False, True]
    dots = by_name[("nav.inputs.seen (measured)",)]
    assert "SeriesPoints:marker_sizes" in dots and "SeriesLines:colors" not in dots
    (truth,), roles = by_name[("body.z (truth)",)]["SeriesLines:colors"], ["truth", "measured", "estimate"]
    colours = [truth >> 8, dots["SeriesPoints:colors"][0] >> 8, place["SeriesLines:colors"][2] >> 8]
    assert [f"#{colour:06X}" for colour in colours] == [style.rerun_colour for style in styles(roles)]


@settings(max_examples=10)
@given(cuts=st.lists(st.integers(0, 60), max_size=6))
def test_batches_do_not_show(cuts: list[int], tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("batches")
    edges = [0, *sorted(cuts), 60]
    sizes = [b - a for a, b in zip(edges, edges[1:], strict=False)]
    many, one = (play(folder / name, VEHICLE, some, panels=PANELS) for name, some in (("a", sizes), ("b", [60])))
    assert str(sorted(many.items())) == str(sorted(one.items()))  # as text: NaN is NaN


# ---- meshes ------------------------------------------------------------------------------------------------------------

STL_TEXT = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 0 2 0\nendloop\nendfacet\n"
_TRIANGLE = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 4, 0, 0, 0, 2, 0, 0)
_GLTF = b'{"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"accessors":[{"min":[0,0,-1],"max":[4,2,1]}]}'


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.stl", STL_TEXT),
        ("a.stl", bytes(80) + struct.pack("<I", 1) + _TRIANGLE),
        ("a.obj", b"# a\nv 0 0 0\nv 4 0 0 1\nv 0 2 0\nvn 9 9 9\nf 1 2 3\n"),
        ("a.glb", struct.pack("<4sIIII", b"glTF", 2, 0, len(_GLTF), 0x4E4F534A) + _GLTF),
    ],
)
def test_a_mesh_has_the_size_of_the_body(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    assert extent_of(tmp_path / name) == 4.0


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.stl", b"", "a mesh without corners"),
        ("a.stl", b"vertex 1 x 2\n", "not a mesh of this kind"),
        ("a.stl", b"vertex nan 0 0\n", "a mesh without corners"),
        ("a.obj", b"v 1 2 3\n", "a mesh without extent"),
        ("a.glb", b"glTF", "not a mesh of this kind"),
        ("a.glb", struct.pack("<4sIIII", b"glTF", 2, 0, 4, 0x4E4F534A) + b"[[[[", "not a mesh of this kind"),
        ("a.ply", b"", "not a mesh of this kind"),
    ],
)
def test_a_file_that_is_no_mesh_is_a_message(tmp_path: Path, name: str, content: bytes, reason: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=reason):
        extent_of(tmp_path / name)
