# SPDX-License-Identifier: Apache-2.0
"""Pictures: what the run's views or the user's paths choose, with gaps, colours and legends that do not mislead."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import subprocess
from pathlib import Path
from typing import Any

import foreign_bags
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from two_estimators import STEP_S, TICKS, TRACK_FROM, TRACK_UNTIL, VIEWS, fly, height, turn, write_config

import simclient.plot
import simclient.to_rerun
from simclient import BagError
from simclient.bag import Bag
from simclient.errors import ViewError
from simclient.view.gate import beside, let_through
from simclient.view.panels import PANELS_MAX, choose_by_paths, choose_default
from simclient.view.picture import choose, draw, plot, pyplot
from simclient.view.recorded import RecordedRun, Rows
from simclient.view.rotation import euler_deg
from simclient.view.series import Gaps, newest, thinned
from simclient.view.signals import Catalogue, Signals, units_of
from simclient.view.styles import styles
from simclient.view.views import CURVES_MAX, ROLES, Views, parse_views


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `plain` and `viewed`: the same flight, without and with views."""
    folder = tmp_path_factory.mktemp("pair")
    fly(write_config(folder), folder / "plain")
    fly(write_config(folder, VIEWS), folder / "viewed")
    return folder


def drawn(bag: Path, *paths: str, views: Views | None = None, against: str = "") -> tuple[list[Any], list[str]]:
    """The axes of a picture, and what is left out of it."""
    run = RecordedRun(Bag(bag), foreign=any(path.startswith("/") for path in paths))
    chosen = choose(run, paths, views)
    figure = draw(run, chosen, "a title", against)
    figure.canvas.draw()
    pyplot.close(figure)
    return figure.axes, chosen.left_out


@pytest.fixture(scope="module")
def viewed(bags: Path) -> list[Any]:
    """The axes of the flight with views."""
    axes, left_out = drawn(bags / "viewed")
    assert left_out == []
    return axes


def labels(axis: Any) -> list[str]:
    return [text.get_text() for text in axis.get_legend().get_texts()]


def line(axis: Any, label: str) -> Any:
    (found,) = [line for line in axis.get_lines() if line.get_label() == label]
    return found


def known(axis: Any, label: str) -> list[int]:
    """The ticks in which a curve has a value."""
    curve = line(axis, label)
    return [round(t / STEP_S) for t, value in zip(*curve.get_data(), strict=True) if not math.isnan(value)]


def only(view: dict[str, Any]) -> Views:
    return parse_views(json.dumps({"panels": [view]}))


# ---- what is drawn -----------------------------------------------------------------------------------------------------


def test_a_run_is_drawn_as_its_views_say(viewed: list[Any]) -> None:
    axes = viewed
    assert [axis.get_ylabel() for axis in axes] == [
        "height, m",
        "roll, deg",
        "pitch, deg",
        "yaw, deg",
        "valid",
        "seen, m",
    ]
    assert labels(axes[0]) == [
        "reference.height (truth)", "coarse.pose.height", "fine.pose.height", "guide.height (command)"
    ]  # fmt: skip
    truth, estimate, command = (line(axes[0], labels(axes[0])[i]) for i in (0, 1, 3))
    assert np.allclose(truth.get_ydata(), [height(k) for k in range(TICKS)])
    assert np.allclose(estimate.get_ydata(), [height(k) + 0.5 for k in range(TICKS)])
    assert truth.get_zorder() > command.get_zorder() > estimate.get_zorder()
    assert truth.get_color() == "#000000" and truth.get_linewidth() < estimate.get_linewidth()
    assert (truth.get_linestyle(), command.get_linestyle()) == ("-", "--")
    measured = line(axes[5], "fine.inputs.height (measured)")
    assert (measured.get_linestyle(), measured.get_marker()) == ("None", ".")


def test_angles_are_in_degrees_and_not_joined_where_they_wrap(viewed: list[Any]) -> None:
    yaw = line(viewed[3], "reference.q (truth)").get_ydata()
    expected = np.degrees([math.remainder(turn(k), 2 * math.pi) for k in range(TICKS)])
    wrap = int(np.flatnonzero(np.abs(np.diff(expected)) > 180)[0]) + 1
    assert np.isnan(yaw[wrap]) and np.allclose(np.delete(yaw, wrap), np.delete(expected, wrap))


@given(st.floats(-179, 179), st.floats(-89, 89), st.floats(-179, 179))
def test_angles_are_those_that_turn_yaw_then_pitch_then_roll(roll: float, pitch: float, yaw: float) -> None:
    """q = q(yaw about z) q(pitch about y) q(roll about x); -q turns alike."""
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in ((3, yaw), (2, pitch), (1, roll)):
        half = math.radians(angle) / 2
        w, v = math.cos(half), math.sin(half) * np.eye(4)[axis][1:]
        q = np.concatenate([[q[0] * w - q[1:] @ v], q[0] * v + w * q[1:] + np.cross(q[1:], v)])
    given_angles = euler_deg(np.array([q, -q, np.zeros(4)]))
    assert given_angles[:2] == pytest.approx(np.array([[roll, pitch, yaw]] * 2), abs=1e-6)
    assert np.isnan(given_angles[2]).all()


@pytest.mark.parametrize("label", ["fine.pose.height", "fine.inputs.height (measured)", "fine.pose.valid"])
def test_an_instance_that_does_not_run_has_a_gap(viewed: list[Any], label: str) -> None:
    (axis,) = [axis for axis in viewed if label in labels(axis)]
    assert known(axis, label) == list(range(TRACK_FROM, TRACK_UNTIL))


def test_what_never_ran_is_no_line_at_zero(bags: Path) -> None:
    (axis,), _ = drawn(bags / "plain", "spare.outputs.pose.height,coarse.outputs.pose.height")
    assert labels(axis) == ["spare.pose.height: no values", "coarse.pose.height"]
    assert len(line(axis, "spare.pose.height: no values").get_xdata()) == 0


def test_bools_are_steps_and_numbers_are_not(viewed: list[Any]) -> None:
    assert line(viewed[4], "coarse.pose.valid").get_drawstyle() == "steps-post"
    assert line(viewed[0], "coarse.pose.height").get_drawstyle() == "default"


def test_healths_and_states_have_names(bags: Path) -> None:
    (health, state), _ = drawn(bags / "plain", "fine.outputs.health", "machine.state")
    assert [text.get_text() for text in health.get_yticklabels()] == ["nominal", "degraded", "failed", "stale"]
    assert line(health, "fine.health").get_ydata()[TRACK_FROM - 1 : TRACK_FROM + 1].tolist() == [3, 0]
    assert [text.get_text() for text in state.get_yticklabels()] == ["WAIT", "TRACK"]
    assert line(state, "machine.state").get_ydata().tolist() == [0, 0, 1, 1, 0, 0]


def test_what_is_not_recorded_is_told_in_legend_and_text(bags: Path) -> None:
    panel = {
        "title": "t",
        "truth": ["lander.outputs.z"],
        "angles": True,
        "estimate": ["coarse.outputs.pose.q", "coarse.outputs.noise"],
    }
    (axis, *_), left_out = drawn(bags / "plain", views=only(panel))
    assert left_out == ["lander.outputs.z (not recorded)", "coarse.outputs.noise (no quaternion)"]
    assert labels(axis) == [
        "coarse.pose.q", "lander.z (truth): not recorded", "coarse.noise: no quaternion"
    ]  # fmt: skip
    with pytest.raises(ViewError, match=r"nothing to draw: lander.outputs.z \(not recorded\)"):
        drawn(bags / "plain", views=only({"title": "t", "truth": ["lander.outputs.z"]}))


def test_invalid_views_are_told_once_and_left_out(bags: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Bag, "views", lambda *_: '{"panels": 7}')
    chosen = choose(RecordedRun(Bag(bags / "plain")))
    assert len(chosen.panels) > 1 and "the views of the run (views.panels: not a list)" in chosen.left_out


# ---- what a user chooses -----------------------------------------------------------------------------------------------


def test_each_path_is_a_panel(bags: Path) -> None:
    axes, left_out = drawn(
        bags / "viewed",
        "coarse.outputs.pose.height,reference.outputs.height",
        "fine.outputs.pose",
        "coarse.outputs.noise[2]",
        "*.inputs.height",
    )
    assert [labels(axis) for axis in axes] == [
        ["coarse.pose.height", "reference.height"],
        [*(f"fine.pose.q[{i}]" for i in range(4)), "fine.pose.height, m", "fine.pose.valid"],
        ["coarse.noise[2]"],
        ["coarse.inputs.height", "fine.inputs.height", "spare.inputs.height: no values"],
    ]
    assert axes[0].get_ylabel() == "height, m" and left_out == []


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("coarse.outputs.pose.heigth", "did you mean coarse.outputs.pose.height, "),
        ("fine.outputs.height", "did you mean fine.outputs.pose.height, "),
        ("coarse.outputs.noise[9]", r"has the elements \[0\] to \[8\]"),
        ("coarse.outputs.noise[0][1]", "a bag holds arrays flat"),
        ("guide.outputs.height[0]", "is no array"),
        ("x*", r"nothing of this path is recorded; `fcsl bag info`"),
        ("fine.height", r"is recorded; did you mean fine.(\S+, ){2}\S+\? `fcsl bag info` lists the topics"),
        ("", "an empty path"),
    ],
)
def test_a_wrong_path_is_a_message_that_helps(bags: Path, path: str, reason: str) -> None:
    with pytest.raises(ViewError, match=reason):
        drawn(bags / "plain", path)


def test_a_value_against_another(bags: Path) -> None:
    (axis,), _ = drawn(bags / "plain", "fine.outputs.pose.height", against="reference.outputs.height")
    curve = line(axis, "fine.pose.height")
    truth = np.array([height(k) for k in range(TICKS)])
    assert np.allclose(curve.get_xdata(), truth) and axis.get_xlabel() == "reference.height, m"
    shown = ~np.isnan(curve.get_ydata())
    assert np.allclose(curve.get_ydata()[shown], truth[TRACK_FROM:TRACK_UNTIL] + 0.1)
    assert list(axis.texts) == []  # no states: the axis is not time
    with pytest.raises(ViewError, match=r"--against: .* selects 9 numbers"):
        drawn(bags / "plain", "fine.outputs.stamp", against="coarse.outputs.noise")


def test_the_newest_value_is_taken_and_none_invented() -> None:
    at = newest(np.array([1.0, 2.0]), np.array([0.0, 1.0]), np.array([0.5, 1.0, 1.999, 2.0, 9.0]))
    assert math.isnan(at[0]) and at[1:].tolist() == [0.0, 0.0, 1.0, 1.0]


def test_without_views_same_names_are_compared(bags: Path) -> None:
    axes, left_out = drawn(bags / "plain")
    shown = {axis.get_ylabel(): labels(axis) for axis in axes}
    order = list(shown)
    assert order[0] == "height, m"  # which the plant has, too
    assert order.index("stamp") < order.index("q")  # several instances, then one
    assert shown["height, m"] == ["reference.height", "guide.height"]
    assert shown["pose.height, m"] == ["coarse.pose.height", "fine.pose.height", "spare.pose.height: no values"]
    wide = [name for name in shown if name.startswith("pose.q")]
    assert wide == ["pose.q (1\u00a0of\u00a02)", "pose.q (2\u00a0of\u00a02)"]
    assert all(len(names) <= CURVES_MAX for names in shown.values())
    still = ["coarse.noise", "coarse.pose.valid", "fine.pose.valid", "guide.force", "spare.pose.valid"]
    assert left_out == [f"what does not change ({', '.join(still)})"]
    assert not {"noise", "force, N"} & shown.keys()


OUTPUTS = {
    "sensors": ["height"],
    "law": ["many", "own"],
    "engine": ["many", "height", "throttle"],
    "plant": ["height", "mass"],
}


def titles(**chosen: Any) -> tuple[list[str], list[str]]:
    signals = [Signals(who, f"/{who}", who == "plant", dict.fromkeys(names, 0)) for who, names in OUTPUTS.items()]
    choice = choose_default(Catalogue(signals), **chosen)
    return [panel.title for panel in choice.panels], choice.left_out


def test_actuators_come_first_and_then_what_can_be_compared() -> None:
    """Where no actuator is known, what the last instance alone has is taken for one."""
    assert titles() == (["throttle", "height", "many", "own", "mass"], [])
    assert titles(commands={"law.outputs.own"}) == (["own", "height", "many", "throttle", "mass"], [])


def test_what_does_not_change_is_left_out_unless_all_is_so() -> None:
    paths = [f"{who}.outputs.{name}" for who, names in OUTPUTS.items() for name in names]
    some = {"law.outputs.own", "law.outputs.many", "plant.outputs.mass"}
    assert titles(constants=some) == (["throttle", "height", "many"], ["what does not change (law.own, plant.mass)"])
    assert titles(constants=set(paths)) == titles()


def test_a_comment_begins_with_the_unit_in_brackets() -> None:
    schema = (
        "std_msgs/Header header\nfloat64 a  # [rad/s^2/sqrt(Hz)] noise\nfloat64[3] b  # [m] \nfloat64 c  # w, x, y, z\n"
    )
    assert units_of(schema) == {"a": "rad/s^2/sqrt(Hz)", "b": "m"}


# ---- what passed the gate ----------------------------------------------------------------------------------------------


class GatedRun:
    """Two motors and a brake, of which the gate is open in the second half."""

    def __init__(self, **got: list[float]) -> None:
        outputs = {
            "motor": {"left": [1.0, 2.0, 3.0, 4.0], "right": [1.0, 2.0, 5.0, 6.0]},
            "copy": {"left": [1.0, 2.0, 3.0, 4.0]},
        }
        self.fields = {**outputs, "actuators": {"gate": [0.0, 2.0, 1.0, 1.0], **got}}
        self.signals = [
            Signals(
                name, name, name == "actuators", dict.fromkeys(fields, 0), dict.fromkeys(fields.keys() - {"gate"}, "V")
            )
            for name, fields in self.fields.items()
        ]
        self.catalogue = Catalogue(self.signals)

    def read(self, values: Any) -> dict[str, Rows]:
        return {
            name: Rows(np.arange(4.0), {field: np.array(numbers) for field, numbers in fields.items()})
            for name, fields in self.fields.items()
        }


@pytest.mark.parametrize(
    ("got", "channels", "commands"),
    [
        ({"right": [0.0, 0.0, 5.0, 6.0]}, None, {"motor.outputs.right": "right"}),
        ({"wheel": [0.0, 0.0, 5.0, 6.0]}, None, {"motor.outputs.right": "wheel"}),
        ({"wheel": [0.0, 0.0, 2.0, 5.0]}, None, {"motor.outputs.right": "wheel"}),  # a tick late
        ({"wheel": [0.0, 0.0, 3.0, 4.0]}, None, {}),  # of `motor` or of `copy`
        ({"wheel": [0.0, 0.0, 9.0, 9.0]}, None, {}),
        ({"wheel": [0.0, 0.0, 5.0, 5.0]}, None, {}),  # one value: anybody's
        ({"right": [0.0, 0.0, 5.0, 5.0]}, None, {"motor.outputs.right": "right"}),
        ({"wheel": [0.0, 0.0, 3.0, 4.0]}, {"wheel": "copy.outputs.left"}, {"copy.outputs.left": "wheel"}),
        ({"rear_wheel": [0.0] * 4}, {"rear.wheel": "motor.outputs.left"}, {"motor.outputs.left": "rear_wheel"}),
    ],
)
def test_what_passed_the_gate_is_known_by_its_values(
    got: dict[str, list[float]], channels: dict[str, str] | None, commands: dict[str, str]
) -> None:
    run: Any = GatedRun(**got)
    found = {path: value.field for path, value in let_through(run, channels).items()}
    assert found == commands


def test_a_command_has_what_its_actuator_got_behind_it() -> None:
    run: Any = GatedRun(right=[0.0, 0.0, 5.0, 6.0])
    found = let_through(run)
    for paths in (["motor.outputs.right"], ["motor.outputs.right,actuators.outputs.right"]):
        (panel,) = (beside(panel, found) for panel in choose_by_paths(paths, run.catalogue).panels)
        curves = {curve.label: (curve.role, curve.steps) for curve in panel.curves}
        band = ("after the gate", True)
        assert curves == {"motor.right (command)": ("command", False), "actuators.right (after the gate)": band}
    (panel,) = (beside(panel, found) for panel in choose_by_paths(["motor.outputs.left"], run.catalogue).panels)
    assert [curve.role for curve in panel.curves] == ["values"]
    band, command = styles(["after the gate", "command"])
    assert band.order < command.order and band.width > 3 * command.width and not band.dashed


def test_wide_panels_become_several_up_to_a_limit(bags: Path) -> None:
    axes, left_out = drawn(bags / "plain", *["*.outputs.*"])
    assert [len(labels(axis)) for axis in axes] == [CURVES_MAX] * 4
    assert len(left_out) == 1 and re.fullmatch(r"\d+ curves of .*", left_out[0])


def test_a_picture_has_a_limit_of_panels(bags: Path) -> None:
    run = RecordedRun(Bag(bags / "plain"))
    chosen = choose(run, ["coarse.outputs.noise[0]"] * (PANELS_MAX + 2))
    assert len(chosen.panels) == PANELS_MAX and chosen.left_out == ["2 more panels"]


def test_topics_of_other_programs(tmp_path: Path) -> None:
    bag = foreign_bags.write(
        tmp_path / "robot", {"/imu": [(int(k * 1e7), foreign_bags.imu(int(k * 1e7), (k, 0, 0))) for k in range(9)]}
    )
    (axis,), _ = drawn(bag, "/imu:angular_velocity.*")
    assert labels(axis) == [f"/imu:angular_velocity.{name}" for name in "xyz"]
    assert line(axis, "/imu:angular_velocity.x").get_ydata().tolist() == list(range(9))
    with pytest.raises(ViewError, match=r"did you mean /imu:angular_velocity.x"):
        drawn(bag, "/imu:angular_velocty.x")


# ---- how it is drawn ---------------------------------------------------------------------------------------------------


@given(roles=st.lists(st.sampled_from(ROLES), min_size=1, max_size=CURVES_MAX))
def test_no_two_curves_of_a_panel_look_alike(roles: list[str]) -> None:
    looks = styles(roles)
    assert len({look.colour for look in looks}) == len({look.rerun_colour for look in looks}) == len(roles)
    for role, look in zip(roles, looks, strict=True):
        assert (look.dots, look.dashed) == (role == "measured", role == "command")
    widths = [
        look.width for role, look in zip(roles, looks, strict=True) if role not in ("truth", "command", "measured")
    ]
    # Lines that coincide stay visible: later ones are thinner, and truth on top of all is the thinnest.
    assert widths == sorted(widths, reverse=True) and all(1.0 <= width <= 2.0 for width in widths)
    assert all(look.width == 1.0 for role, look in zip(roles, looks, strict=True) if role in ("truth", "command"))
    if len(widths) > 1 and "command" not in roles:
        assert widths[0] > widths[1]


def test_legends_are_beside_the_data(viewed: list[Any]) -> None:
    for axis in viewed:
        assert axis.get_legend().get_window_extent().x0 >= axis.get_window_extent().x1
        assert axis.get_legend().get_window_extent().x1 <= axis.figure.bbox.x1


def test_states_have_their_names_above(viewed: list[Any]) -> None:
    assert [text.get_text() for text in viewed[0].texts] == ["WAIT", "TRACK", "WAIT"]
    assert viewed[0].figure.legends == []


def test_missing_messages_are_a_gap_in_whatever_batches() -> None:
    ticks = np.array([5, 6, 7, 10, 11, 12, 30])
    t_s, values = ticks * 0.1, ticks * 2.0
    whole = Gaps().insert(t_s, ticks, {"v": values, "health": np.zeros(7, np.uint8)}, "health")
    assert whole[0].tolist() == pytest.approx([0.5, 0.6, 0.7, 0.8, 1.0, 1.1, 1.2, 1.3, 3.0])
    assert str(whole[1]["v"].tolist()) == "[10.0, 12.0, 14.0, nan, 20.0, 22.0, 24.0, nan, 60.0]"
    assert whole[1]["health"].tolist() == [0, 0, 0, -1, 0, 0, 0, -1, 0]
    for cut in range(2, 7):
        gaps = Gaps()
        parts = [gaps.insert(t_s[some], ticks[some], {"v": values[some]}) for some in (slice(cut), slice(cut, None))]
        assert str(np.concatenate([part[1]["v"] for part in parts])) == str(whole[1]["v"])
        assert np.concatenate([part[0] for part in parts]).tolist() == pytest.approx(whole[0].tolist())


@given(values=arrays(np.float64, st.integers(1, 3000), elements=st.floats(-1e6, 1e6) | st.just(math.nan)))
def test_thinning_keeps_every_extreme_and_every_gap(values: np.ndarray) -> None:
    t, thin = thinned(np.arange(len(values)) * 0.01, values, 200)
    assert len(t) == len(thin) and (np.diff(t) > 0).all()
    assert np.isnan(thin).sum() == np.isnan(values).sum()
    if not np.isnan(values).any():
        assert len(thin) <= 600
    if not np.isnan(values).all():
        assert np.nanmin(thin) == np.nanmin(values) and np.nanmax(thin) == np.nanmax(values)


# ---- the command -------------------------------------------------------------------------------------------------------


#: main of each tool, in this process: an error is what it raises, as run_tool prints it.
TOOLS = {"plot": simclient.plot.main, "to_rerun": simclient.to_rerun.main}


def test_pictures_are_written_whole(bags: Path, tmp_path: Path) -> None:
    for suffix, magic in ((".png", b"\x89PNG"), (".svg", b"<?xml")):
        plot(bags / "viewed", tmp_path / f"run{suffix}")
        assert (tmp_path / f"run{suffix}").read_bytes().startswith(magic)
    with pytest.raises(BagError, match="run.xyz"):
        plot(bags / "viewed", tmp_path / "run.xyz")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.png", "run.svg"]


def test_views_of_a_file_take_the_place_of_the_bags_own(
    bags: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "my.json").write_text(
        json.dumps({"views": {"panels": [{"title": "mine", "values": ["coarse.outputs.noise[0]", "gone.outputs.x"]}]}})
    )
    monkeypatch.chdir(tmp_path)
    assert simclient.plot.main([str(bags / "viewed"), "--views", "my.json", "-o", "x.svg"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[1:] == ["left out: gone.outputs.x (not recorded); fcsl plot BAG PATH… chooses what is drawn"]
    assert simclient.to_rerun.main([str(bags / "viewed"), "--views", "my.json", "-o", "x.rrd"]) == 0
    written, *told = capsys.readouterr().out.splitlines()
    assert written == f"x.rrd: {(tmp_path / 'x.rrd').stat().st_size} bytes; view it with: rerun x.rrd"
    assert told == ["left out of the first page: gone.outputs.x (not recorded)"]
    with pytest.raises(SystemExit) as exited:
        simclient.plot.main([str(bags / "viewed"), "a.outputs.b", "--views", "my.json", "-o", "x.svg"])
    assert exited.value.code == 2 and "give one of them" in capsys.readouterr().err


@pytest.mark.parametrize("tool", ["plot", "to_rerun"])
def test_bad_input_leaves_nothing_behind(
    tool: str, bags: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    suffix = {"plot": "png", "to_rerun": "rrd"}[tool]
    run = bags / "plain"
    (tmp_path / "bad.json").write_text('{"views": {"panels": []}}')
    cases: list[tuple[list[object], str]] = [
        (["absent", "-o", f"x.{suffix}"], "no such bag"),
        ([run, "-o", f"no/where/x.{suffix}"], "no such directory"),
        ([run, "-o", "there"], {"plot": "there: the name of a picture ends in .png", "to_rerun": "there: a dir"}[tool]),
        ([run, "-o", f"there.{suffix}"], f"there.{suffix}: a directory"),
        ([run, "-o", f"x.{suffix}", "--machine", "other"], "no machine `other`"),
        ([run, "-o", f"x.{suffix}", "--truth", "/sim/lander"], "no topic `/sim/lander`"),
        ([run, "-o", f"x.{suffix}", "--views", "bad.json"], "bad.json: views: holds neither"),
        ([run, "-o", f"x.{suffix}", "--views", "none.json"], "none.json: No such file"),
    ]
    if tool == "plot":
        cases.append(([run, "nothing.outputs.x", "-o", "x.png"], "`nothing.outputs.x`: nothing of this path"))
    (tmp_path / "there").mkdir()
    (tmp_path / f"there.{suffix}").mkdir()
    for arguments, reason in cases:
        with pytest.raises((BagError, ViewError)) as caught:
            TOOLS[tool]([str(argument) for argument in arguments])
        assert reason in str(caught.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.json", "there", f"there.{suffix}"]


def test_a_rerun_file_must_be_named(bags: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exited:
        simclient.to_rerun.main([str(bags / "plain")])
    assert exited.value.code == 2 and "-o/--output" in capsys.readouterr().err


def test_a_picture_has_the_name_of_its_bag(bags: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a folder, also of this one, or of a file; it is written here."""
    monkeypatch.chdir(tmp_path)
    for bag in (bags / "plain", bags / "plain/plain_0.mcap"):
        assert simclient.plot.main([str(bag), "guide.outputs.height"]) == 0
    shutil.copytree(bags / "plain", tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    assert simclient.plot.main([".", "guide.outputs.height"]) == 0
    assert sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.png")) == [
        "here/here.png", "plain.png", "plain_0.png"
    ]  # fmt: skip


def test_a_picture_is_small_and_the_same_bytes(bags: Path, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        plot(bags / "viewed", tmp_path / name)
    written = (tmp_path / "a.png").read_bytes()
    assert written == (tmp_path / "b.png").read_bytes()
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.mode == "P" and picture.size[0] == 1440


@pytest.mark.parametrize(("tool", "slow"), [("plot", "matplotlib"), ("rerun", "rerun")])
def test_ctrl_c_while_importing_is_no_traceback(tool: str, slow: str, tmp_path: Path) -> None:
    # A library of that name that is still being imported when the signal comes.
    (tmp_path / f"{slow}.py").write_text("import time\nprint('importing', flush=True)\ntime.sleep(60)\n")
    command = ["fcsl", tool, "absent", "-o", "x"]
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
