# SPDX-License-Identifier: Apache-2.0
"""Pictures: the plot and the rerun file of a run are written whole, and hold what the bag holds."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from simclient import AlgTwin, BagError
from simclient.bag import Bag, RecordedMachine
from simclient.view.picture import choose_panels, draw, plot
from simclient.view.signals import ALTITUDE, THROTTLE
from simclient.view.summary import RunSummary, Source, euler_deg, read_summary, thinned


@pytest.fixture
def bag(probe: Path, tmp_path: Path) -> Path:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run", "car")
        for k in range(50):
            twin.set("source.outputs.vec", [math.sin(k / 5), 0.0, 1.0])
            twin.set("source.outputs.quat", [math.cos(k / 100), 0.0, 0.0, math.sin(k / 100)])
            if k == 20:
                twin.set_state("ACTIVE")
            twin.tick()
    return tmp_path / "run"


def test_story_has_states_and_outputs(bag: Path) -> None:
    story = read_summary(Bag(bag))
    spans = [(s.state, round(s.start_s, 6), round(s.end_s, 6)) for s in story.spans]
    assert spans == [("IDLE", 0.0, 0.2), ("ACTIVE", 0.2, 0.49)]
    assert [s.name for s in story.sources] == ["source", "echo"] and story.states == ["IDLE", "ACTIVE"]
    assert [(s.name, n) for s, n in story.quaternions()] == [("source", "quat")]
    yaw = euler_deg(story.sources[0].fields["quat"])[:, 2]
    assert np.allclose(yaw, np.degrees(np.arange(50) / 50), atol=1e-12)


def test_plot_shows_attitudes_else_all_outputs(bag: Path, probe: Path, tmp_path: Path) -> None:
    titles = [panel.title for panel in choose_panels(read_summary(Bag(bag)))]
    assert titles == ["roll, deg", "pitch, deg", "yaw, deg"]
    figure = draw(read_summary(Bag(bag)), "a title")
    assert [text.get_text() for text in figure.axes[0].texts] == ["IDLE", "ACTIVE"]
    for suffix, magic in ((".png", b"\x89PNG"), (".svg", b"<?xml")):
        plot(bag, tmp_path / f"run{suffix}")
        assert (tmp_path / f"run{suffix}").read_bytes().startswith(magic)
    with pytest.raises(BagError, match="run.xyz"):
        plot(bag, tmp_path / "run.xyz")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "run.png", "run.svg"]


def source(name: str, truth: bool = False, **units: str | None) -> Source:
    """A source with one-valued fields of these units (None: not said)."""
    fields = {field: np.zeros(2) for field in units}
    said = {field: unit for field, unit in units.items() if unit is not None}
    return Source(name, f"/m/{name}", truth, np.zeros(2), fields, said)


@pytest.mark.parametrize(
    ("sources", "expected"),
    [
        ([source("a", pos_z="m"), source("p", truth=True, pos_z=None)], [("p", "pos_z"), ("a", "pos_z")]),
        ([source("a", pos_z=None), source("b", z="m")], [("b", "z")]),  # a unit says more than a better name
        ([source("a", pos_z="rad", z=None), source("b", altitude=None)], [("b", "altitude")]),
        ([source("a", z="m"), source("b", z="rad"), source("c", z=None)], [("a", "z"), ("c", "z")]),
        ([source("a", pos_z="m/s", height="m")], []),
    ],
)
def test_altitude_is_found_by_unit_and_name(sources: list[Source], expected: list[tuple[str, str]]) -> None:
    story = RunSummary(RecordedMachine("m", "/m", {}), tuple(sources), ())
    assert [(s.name, field) for s, field in story.named(ALTITUDE)] == expected


def test_throttle_may_be_in_any_unit() -> None:
    story = RunSummary(RecordedMachine("m", "/m", {}), (source("a", thrust="N"), source("b", throttle="%")), ())
    assert [(s.name, field) for s, field in story.named(THROTTLE)] == [("b", "throttle")]


@settings(deadline=None)
@given(values=arrays(np.float64, st.integers(1, 3000), elements=st.floats(-1e6, 1e6) | st.just(math.nan)))
def test_thinning_keeps_every_extreme(values: np.ndarray) -> None:
    t, thin = thinned(np.arange(len(values)) * 0.01, values, 200)
    assert len(t) == len(thin) <= 600 and (np.diff(t) >= 0).all()
    if np.isnan(values).all():
        assert np.isnan(thin).all()
    else:
        assert np.nanmin(thin) == np.nanmin(values) and np.nanmax(thin) == np.nanmax(values)


def test_rerun_file_holds_every_output_on_sim_time(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.rrd"
    command = [sys.executable, "-m", "simclient.to_rerun", str(bag), "-o", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    viewer = [sys.executable, "-m", "rerun", "rrd"]
    env = {**os.environ, "CI": "1"}  # otherwise rerun switches its usage statistics on, in the home directory
    verified = subprocess.run([*viewer, "verify", str(out)], capture_output=True, text=True, env=env)
    assert verified.returncode == 0, verified.stderr
    printed = subprocess.run([*viewer, "print", "-vv", str(out)], capture_output=True, text=True, env=env).stdout
    for entity in ("source/vec", "source/quat/yaw_deg", "echo/sum", "echo/health", "state", "transitions"):
        assert f"/car/probe/{entity}" in printed, entity
    assert "/world/source/quat" in printed and "sim_time" in printed
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "run.rrd"]


@pytest.mark.parametrize("tool", ["plot", "to_rerun"])
def test_bad_input_leaves_nothing_behind(tool: str, bag: Path, tmp_path: Path) -> None:
    suffix = {"plot": "png", "to_rerun": "rrd"}[tool]
    cases = [
        (["absent", "-o", f"x.{suffix}"], "no such bag"),
        (["run", "-o", f"no/where/x.{suffix}"], "no such directory"),
        (
            ["run", "-o", "there"],
            {"plot": "there: the name of a picture ends in .png", "to_rerun": "there: a dir"}[tool],
        ),
        (["run", "-o", f"there.{suffix}"], f"error: there.{suffix}: a directory"),
        (["run", "-o", f"x.{suffix}", "--machine", "other"], "no machine `other`"),
        (["run", "-o", f"x.{suffix}", "--truth", "/sim/lander"], "no topic `/sim/lander`"),
    ]
    (tmp_path / "there").mkdir()
    (tmp_path / f"there.{suffix}").mkdir()
    for arguments, reason in cases:
        command = [sys.executable, "-m", f"simclient.{tool}", *arguments]
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 2 and reason in done.stderr and "Traceback" not in done.stderr, done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "there", f"there.{suffix}"]


@pytest.mark.parametrize(("tool", "slow"), [("plot", "matplotlib"), ("to_rerun", "rerun")])
def test_ctrl_c_while_importing_is_no_traceback(tool: str, slow: str, tmp_path: Path) -> None:
    # A library of that name that is still being imported when the signal comes.
    (tmp_path / f"{slow}.py").write_text("import time\nprint('importing', flush=True)\ntime.sleep(60)\n")
    command = [sys.executable, "-m", f"simclient.{tool}", "absent", "-o", "x"]
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    with subprocess.Popen(
        command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        try:
            assert running.stdout is not None and running.stdout.readline() == "importing\n"
            running.send_signal(signal.SIGINT)
            assert running.communicate(timeout=60) == ("", "")
        finally:
            running.kill()
    assert running.returncode == 128 + signal.SIGINT
