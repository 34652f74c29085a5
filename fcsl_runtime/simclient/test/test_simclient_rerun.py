# SPDX-License-Identifier: Apache-2.0
"""What rerun shows of a run is what the run did: lines, states, health, pose, thrust; in whatever batches it comes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st
from rrd import Rows, read_rrd, values

from simclient import AlgTwin
from simclient.bag.states import StateSample
from simclient.view.blueprint import Plan
from simclient.view.rrd import to_rerun
from simclient.view.scene import Cast, Scene
from simclient.view.signals import Signals

SCALARS, STATE, TEXT = "Scalars:scalars", "StateChange:state", "TextLog:text"
STEP_S = 0.01
VEHICLE = [
    Signals("nav", "/m/nav", False, {"position": 3, "orientation": 4, "health": 0}, {"position": "m"}),
    Signals("engine", "/m/engine", False, {"force": 3, "health": 0}, {"force": "N"}),
    Signals("body", "/sim/body", True, {"pos_z": 0}, {"pos_z": "m"}),
]


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


def play(path: Path, signals: Sequence[Signals], batches: Sequence[int]) -> Rows:
    """A vehicle that climbs, pitches and pushes, told in batches of these sizes."""
    stream = rr.RecordingStream("test")
    stream.save(path)
    stage = Scene(stream, Cast("/m", signals, ["UP", "DOWN"]))
    at = 0
    for size in batches:
        k = np.arange(at, at + size)
        t_s = k * STEP_S
        health = np.where(k % 17 == 0, 2, 0).astype(np.uint8)
        columns = {
            "position": np.stack([0.0 * k, 0.1 * k, 1.0 * k], axis=1),
            "orientation": np.stack([np.cos(k / 50), 0 * k, np.sin(k / 50), 0 * k], axis=1),
            "force": np.stack([0.0 * k, 0.0 * k, 100.0 + 0 * k], axis=1),
            "pos_z": 1.0 * k,
            "health": health,
        }
        for described in signals:
            if size:
                stage.outputs(described.topic, t_s, {name: columns[name] for name in described.sizes})
        states = [("UP", 0), ("DOWN", 30)]
        stage.states([StateSample(n, int(n * STEP_S * 1e9), s, s) for s, n in states if at <= n < at + size])
        at += size
    stream.send_blueprint(Plan(stage.cast, stage.world, None).blueprint())
    stream.disconnect()
    return read_rrd(path)


def test_health_is_lanes_of_changes_and_a_log_of_the_bad_ones(tmp_path: Path) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE[:2], [10, 20])
    changes = [(0.0, "failed"), (0.01, "nominal"), (0.17, "failed"), (0.18, "nominal")]
    assert values(rows, "/m/nav/health", STATE) == changes
    log = [(t, text) for t, text in values(rows, "/m/health", TEXT) if text.startswith("nav")]
    assert log == [(t, f"nav: {health}") for t, health in changes]


def test_pose_and_thrust_follow_the_signals(tmp_path: Path) -> None:
    rows = play(tmp_path / "x.rrd", VEHICLE[:2], [60])
    poses = values(rows, "/world/nav", "Transform3D:translation")
    assert [list(p) for _, p in poses][59] == pytest.approx([0.0, 5.9, 59.0])
    turned = values(rows, "/world/nav/body", "Transform3D:quaternion")[25][1]
    assert list(turned) == pytest.approx([0.0, math.sin(0.5), 0.0, math.cos(0.5)], abs=1e-6)  # x, y, z, w
    arrows = values(rows, "/world/nav/body/engine/force", "Arrows3D:vectors")
    assert {tuple(vector) for _, vector in arrows} == {(0.0, 0.0, 4.0)}
    marker = values(rows, "/world/transitions/1", "Points3D:positions")
    assert [(time, list(point)) for time, point in marker] == [(0.3, pytest.approx([0.0, 3.0, 30.0]))]


def test_the_plants_position_goes_before_an_estimate_of_the_same_kind(tmp_path: Path) -> None:
    estimate = Signals("filter", "/m/filter", False, {"pos_z": 0}, {"pos_z": "m"})
    rows = play(tmp_path / "x.rrd", [estimate, VEHICLE[2]], [10])
    assert "/world/body" in rows and "/world/filter" not in rows


def test_attitudes_without_a_position_stand_by_themselves(tmp_path: Path) -> None:
    two = [Signals(n, f"/m/{n}", False, {"orientation": 4}, {}) for n in ("a", "b")]
    rows = play(tmp_path / "x.rrd", two, [10])
    places = [values(rows, f"/world/{n}/orientation", "Transform3D:translation")[0][1] for n in ("a", "b")]
    assert list(places[0]) != list(places[1])


@settings(deadline=None, max_examples=10)
@given(cuts=st.lists(st.integers(0, 60), max_size=6))
def test_batches_do_not_show(cuts: list[int], tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("batches")
    edges = [0, *sorted(cuts), 60]
    sizes = [b - a for a, b in zip(edges, edges[1:], strict=False)]
    assert play(folder / "many.rrd", VEHICLE[:2], sizes) == play(folder / "one.rrd", VEHICLE[:2], [60])
