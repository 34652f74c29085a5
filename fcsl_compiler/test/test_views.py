# SPDX-License-Identifier: Apache-2.0
"""`views`: the text that the descriptor carries, and that nothing else depends on it."""

import json
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from scipy.spatial.transform import Rotation

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.emit.field_table import field_table, layout_hash, source_hash
from fcsl_compiler.model.machine import Machine as Checked

NAV = """class Nav:
    inputs = {"rows": "f64[2][3] m"}
    outputs = {"p": "f64[3] m", "q": "f64[4]", "speed": "f64 m/s", "fix": "bool", "targets": "Target[2]"}
    def execute(self):
        self.speed = self.rows[1][2] + self.p[0]
        self.fix = self.speed > 0.0
        self.q = [1.0, 0.0, 0.0, 0.0]
        self.targets[1].at = self.p
"""
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "A",
    "structs": {"Target": {"at": "f64[3] m", "seen": "bool"}},
    "instances": {"nav": {"algorithm": "Nav"}, "other": {"algorithm": "Nav"}},
    "states": {"A": {"schedule": {"nav": 100, "other": 100}}},
}
PANEL = {"title": "height", "estimate": ["nav.outputs.p[2]"]}
VIEWS = {"panels": [PANEL]}


def checked(folder: Path, views: Any = None, instances: tuple[str, ...] | None = None) -> Checked:
    config = CONFIG if views is None else {**CONFIG, "views": views}
    path = write_machine(folder, "craft", config, {"nav": NAV})
    return compile_machine(path, "", until="schedule", instances=instances).checked


def codes(folder: Path, views: Any) -> list[str]:
    try:
        checked(folder, views)
    except DiagnosticError as error:
        return [d.code for d in error.diagnostics]
    return []


def test_the_text_is_compact_and_sorted_and_says_the_defaults(tmp_path: Path) -> None:
    views: dict[str, Any] = {"body": {"shape": "lander", "position": "nav.outputs.p"}, "panels": [PANEL]}
    assert checked(tmp_path, views).views == (
        '{"body":{"position":"nav.outputs.p","shape":"lander","size":3.0,"up":"+z"},'
        '"panels":[{"angles":false,"estimate":["nav.outputs.p[2]"],"title":"height"}]}'
    )
    views["body"] = {"shape": "rover", "attitude": "nav.outputs.q", "size": 2, "up": "-z"}
    found = json.loads(checked(tmp_path, views).views)["body"]
    assert found == {"shape": "rover", "attitude": "nav.outputs.q", "size": 2.0, "up": "-z"}


def test_frames_have_a_position_and_a_unit_quaternion(tmp_path: Path) -> None:
    """Roll, pitch, yaw are those of ROS: about the fixed axes x, y, z, in this order."""
    roll, pitch, yaw = 0.3, -0.4, 2.5
    frames = [
        {"frame": "base/imu", "parent": "base_link", "position": [0, 1, -2.5], "rpy": [roll, pitch, yaw]},
        {"frame": "camera", "parent": "base/imu", "rotation": [0.707, 0, 0, 0.707]},
        {"frame": "mast", "parent": "base_link"},
    ]
    imu, camera, mast = json.loads(checked(tmp_path, {"panels": [PANEL], "frames": frames}).views)["frames"]
    x, y, z, w = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_quat()
    assert imu["rotation"] == pytest.approx([w, x, y, z], abs=1e-15) and imu["position"] == [0.0, 1.0, -2.5]
    assert camera["rotation"] == pytest.approx([0.5**0.5, 0, 0, 0.5**0.5], abs=1e-15)
    assert mast == {"frame": "mast", "parent": "base_link", "position": [0.0] * 3, "rotation": [1.0, 0.0, 0.0, 0.0]}


def test_no_views_are_no_text(tmp_path: Path) -> None:
    assert checked(tmp_path).views == checked(tmp_path, {}).views == ""


def test_the_library_has_it(tmp_path: Path) -> None:
    config = {**CONFIG, "views": {"panels": [{"title": 'Höhe "m"?', "values": ["nav.outputs.p"]}]}}
    text = Machine.build(write_machine(tmp_path, "craft", config, {"nav": NAV})).d.views.decode("ascii")
    assert json.loads(text)["panels"][0]["title"] == 'Höhe "m"?'
    assert Machine.build(write_machine(tmp_path / "b", "craft", CONFIG, {"nav": NAV})).d.views == b""


@pytest.mark.parametrize(
    ("path", "curves"),
    [
        ("nav.outputs.speed", 1),
        ("nav.outputs.fix", 1),
        ("nav.outputs.q", 4),
        ("nav.inputs.rows", 6),
        ("nav.inputs.rows[1]", 3),
        ("nav.inputs.rows[1][2]", 1),
        ("nav.outputs.targets[1].at", 3),
        ("nav.outputs.targets[1].at[2]", 1),
    ],
)
def test_what_a_path_may_name(tmp_path: Path, path: str, curves: int) -> None:
    """Each alone; and with as many others as 8 leave room for."""
    rest = [f"other.outputs.q[{i % 4}]" for i in range(8 - curves)]
    assert codes(tmp_path, {"panels": [{"title": "t", "values": [path, *rest]}]}) == []
    assert codes(tmp_path, {"panels": [{"title": "t", "values": [path, *rest, "other.outputs.q[0]"]}]}) == ["E246"]


@pytest.mark.parametrize(
    ("path", "code"),
    [
        ("nav.inputs.rows[2]", "E245"),
        ("nav.inputs.rows[1][3]", "E245"),
        ("nav.inputs.rows[0][0][0]", "E245"),
        ("nav.outputs.speed[0]", "E245"),
        ("nav.outputs.targets", "E245"),
        ("nav.outputs.targets[1]", "E245"),
        ("nav.outputs.targets[2].at", "E216"),
        ("nav.outputs.targets.at", "E216"),
        ("nav.outputs.p[-1]", "E216"),
        ("nav.outputs.p[0:2]", "E216"),
        ("nav.outputs.transition_request", "E245"),
        ("nav.counters.faults", "E215"),
        ("machine.state", "E206"),
        ("nav", "E215"),
        ("", "E206"),
    ],
)
def test_what_it_may_not_name(tmp_path: Path, path: str, code: str) -> None:
    assert codes(tmp_path, {"panels": [{"title": "t", "values": [path]}]}) == [code]


def test_units_of_a_panel(tmp_path: Path) -> None:
    """As in a connection, a value without a unit fits to any."""
    of = {"m": "nav.outputs.p[0]", "": "nav.outputs.q[0]", "m/s": "nav.outputs.speed"}
    for units, wanted in ((("m", "", "m"), []), (("", "m/s"), []), (("", "m", "m/s"), ["E247"])):
        assert codes(tmp_path, {"panels": [{"title": "t", "values": [of[u] for u in units]}]}) == wanted
    with pytest.raises(DiagnosticError, match="`nav.outputs.speed` is in m/s, and the panel in m\n"):
        checked(tmp_path, {"panels": [{"title": "t", "truth": [of["m"]], "command": [of["m/s"]]}]})


def test_angles_are_quaternions_and_count_once(tmp_path: Path) -> None:
    quaternions = ["nav.outputs.q", "other.outputs.q"] * 4
    assert codes(tmp_path, {"panels": [{"title": "t", "angles": True, "estimate": quaternions}]}) == []
    assert codes(tmp_path, {"panels": [{"title": "t", "angles": True, "estimate": ["nav.outputs.p"]}]}) == ["E245"]


def test_mistakes_elsewhere_hide_nothing_and_are_told_once(tmp_path: Path) -> None:
    """An instance of a wrong algorithm is not reported again; another panel's mistake is."""
    path = write_machine(tmp_path, "craft", CONFIG, {"nav": NAV.replace("self.p[0]", "self.pp[0]")})
    views = {"panels": [{"title": "t", "values": ["nav.outputs.none", "no.outputs.p"]}]}
    path.write_text(json.dumps({**json.loads(path.read_text()), "views": views}))
    with pytest.raises(DiagnosticError) as caught:
        compile_machine(path, "", until="schedule")
    assert sorted(d.code for d in caught.value.diagnostics) == ["E206", "E408"]


def test_more_mistakes_than_are_kept(tmp_path: Path) -> None:
    """Its own are then not reported, and do no harm."""
    config = {**CONFIG, **{f"key{n}": 1 for n in range(300)}}
    config["views"] = {"panels": [PANEL], "body": {"shape": "rover", "position": [{"a": 1}, [], None]}}
    path = write_machine(tmp_path, "craft", config, {"nav": NAV})
    with pytest.raises(DiagnosticError) as caught:
        compile_machine(path, "", until="schedule")
    assert {d.code for d in caught.value.diagnostics} == {"E201"}


# ---- what does not depend on them -----------------------------------------------------------------------------------


@pytest.mark.parametrize("indent", [None, 2])
@pytest.mark.parametrize("at", [0, 1, 99])
def test_source_hash_leaves_them_out(tmp_path: Path, at: int, indent: int | None) -> None:
    """Wherever they stand, and whatever they say."""
    path = write_machine(tmp_path, "craft", CONFIG, {"nav": NAV})
    plain = json.loads(path.read_text())

    def hashes(config: dict[str, Any]) -> tuple[str, str]:
        path.write_text(json.dumps(config, indent=indent))
        machine = compile_machine(path, "", until="schedule").checked
        return source_hash(machine), layout_hash(machine, field_table(machine))

    members = list(plain.items())
    members.insert(at, ("views", VIEWS))
    longer = {**VIEWS, "body": {"shape": "rover", "position": "nav.outputs.p"}}
    assert hashes(plain) == hashes(dict(members)) == hashes({**dict(members), "views": longer})
    assert hashes({**dict(members), "tick_hz": 200})[0] != hashes(plain)[0]


def test_a_name_like_theirs_elsewhere_is_not_left_out(tmp_path: Path) -> None:
    config = {**CONFIG, "instances": {"views": {"algorithm": "Nav"}}, "states": {"A": {"schedule": {"views": 100}}}}

    def hashed(rate: int) -> str:
        states = {"A": {"schedule": {"views": rate}}}
        path = write_machine(tmp_path, "craft", {**config, "states": states}, {"nav": NAV})
        return source_hash(compile_machine(path, "", until="schedule").checked)

    assert hashed(100) != hashed(50)


def test_a_subset_has_none(tmp_path: Path) -> None:
    assert checked(tmp_path, VIEWS, ("other",)).views == ""


# ---- meshes ---------------------------------------------------------------------------------------------------------


def test_a_mesh_is_told_as_an_absolute_path(tmp_path: Path) -> None:
    """Also where the same text was built in another folder before."""
    body = {"shape": "mesh", "mesh": "parts/craft.glb", "attitude": "nav.outputs.q"}
    for name in ("one", "two"):
        path = write_machine(tmp_path / name, "craft", {**CONFIG, "views": {**VIEWS, "body": body}}, {"nav": NAV})
        mesh = tmp_path / name / "parts/craft.glb"
        mesh.parent.mkdir()
        mesh.write_bytes(b"glTF")
        built = build_machine(path)
        text = Machine(built.library, "craft").d.views.decode()
        assert json.loads(text)["body"]["mesh"] == str(mesh.resolve())
