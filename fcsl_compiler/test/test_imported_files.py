# SPDX-License-Identifier: Apache-2.0
"""Helpers and constants of imported files: found, compiled once, part of the build. Compiled machines and CPython side
by side."""

import os
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_one_each
from fcsl_test_programs import FILES, STRUCTS
from fcsl_test_twins import Twins

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.passes import compile_machine

LAW, FRAMES, AXES, OTHER = FILES.values()
BOTH = FRAMES + OTHER.replace("from frames import wrap", "").replace("total", "less")

BESIDE: dict[str, tuple[dict[str, str], dict[str, Any]]] = {
    "in the machine's folder": (
        {"law.py": LAW, "frames.py": FRAMES, "axes.py": AXES, "other.py": OTHER},
        {"Law": {"source": "law.py"}, "Other": {"source": "other.py"}},
    ),
    "in a folder of it": (
        {"alg/law.py": LAW, "alg/frames.py": FRAMES, "alg/axes.py": AXES, "alg/other.py": OTHER},
        {"Law": {"source": "alg/law.py"}, "Other": {"source": "alg/other.py"}},
    ),
    "in a folder below": (
        {
            "law.py": LAW.replace("from frames", "from control.shared.frames"),
            "control/shared/frames.py": FRAMES.replace("from axes", "from deep.axes"),
            "control/shared/deep/axes.py": AXES,
            "control/other.py": OTHER.replace("from frames", "from shared.frames"),
        },
        {"Law": {"source": "law.py"}, "Other": {"source": "control/other.py"}},
    ),
    "of one name in two folders": (
        {
            "law.py": LAW,
            "frames.py": FRAMES.replace("from axes", "from below.axes"),
            "below/axes.py": AXES,
            "below/other.py": OTHER,
            "below/frames.py": "def wrap(x: f64) -> f64:\n    return x % 6.283185307179586\n",
        },
        {"Law": {"source": "law.py"}, "Other": {"source": "below/other.py"}},
    ),
    "that have algorithms of their own": (
        {
            "law.py": LAW,
            "frames.py": BOTH,
            "axes.py": AXES,
        },
        {"Other": {"source": "frames.py"}, "Law": {"source": "law.py"}},
    ),
    "by a path with a dot": (
        {
            "law.py": LAW,
            "frames.py": BOTH,
            "axes.py": AXES,
        },
        {"Law": {"source": "./law.py"}, "Other": {"source": "frames.py"}},
    ),
    "by another path with a dot": (
        {
            "law.py": LAW,
            "frames.py": BOTH,
            "axes.py": AXES,
        },
        {"Other": {"source": "./frames.py"}, "Law": {"source": "law.py"}},
    ),
}


@pytest.mark.parametrize("name", BESIDE)
def test_files_beside(name: str, tmp_path: Path) -> None:
    files, algorithms = BESIDE[name]
    path = write_one_each(tmp_path, files, algorithms, structs={"Goal": STRUCTS["Goal"]}, requests=["HALT", "GO"])
    twins = Twins(path)
    assert twins.get("law.outputs.goal.place") == [1, 2, 3]
    first = {
        "law.outputs.x": 3.0 + 14.0 + 6.0,
        "law.outputs.grid": [1, 0, 2, 3, 3, 0],
        "law.outputs.goal.speed": 3.5,
        "law.state.level": "degraded",
        "law.outputs.health": "degraded",
        "law.outputs.transition_request": "GO",
        "other.outputs.y": 0.5,
    }
    rows = [
        ({"law.inputs.v": [1.0, 2.0, 3.0], "law.inputs.i": 2, "other.inputs.x": 1.5}, first),
        (
            {"law.inputs.v": [0.0, 0.0, 0.0], "law.inputs.i": 0},
            {"law.outputs.transition_request": "", "law.outputs.goal.speed": 4.5},
        ),
        ({"law.inputs.i": 3}, {"law.outputs.health": "failed", "law.counters.faults": 1}),
    ]
    twins.expect(rows)


def test_helpers_beside_are_compiled_once(tmp_path: Path) -> None:
    files, algorithms = BESIDE["in the machine's folder"]
    path = write_one_each(tmp_path, files, algorithms, structs={"Goal": STRUCTS["Goal"]}, requests=["GO"])
    source = compile_machine(path, "").source
    for signature in ("mod_frames__wrap(double", "mod_frames__total(", "mod_axes__turned(", "mod_other__total(double"):
        assert sum(line.startswith("static") and signature in line for line in source.split("\n")) == 1, signature
    files, algorithms = BESIDE["of one name in two folders"]
    path = write_one_each(tmp_path / "two", files, algorithms, structs={"Goal": STRUCTS["Goal"]}, requests=["GO"])
    source = compile_machine(path, "").source
    assert "mod_frames__wrap(double" in source and "mod_frames_2__wrap(double" in source


def test_files_beside_of_a_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A source of a package imports from files in the same folder of the package."""
    share = tmp_path / "prefix" / "share"
    (share / "ament_index" / "resource_index" / "packages").mkdir(parents=True)
    (share / "ament_index" / "resource_index" / "packages" / "laws").write_text("")
    for name, text in (("law.py", LAW), ("frames.py", FRAMES), ("axes.py", AXES)):
        (share / "laws" / "alg").mkdir(parents=True, exist_ok=True)
        (share / "laws" / "alg" / name).write_text(text)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'prefix'}:{os.environ.get('AMENT_PREFIX_PATH', '')}")
    path = write_one_each(
        tmp_path / "m",
        {},
        {"Law": {"source": "package://laws/alg/law.py"}},
        structs={"Goal": STRUCTS["Goal"]},
        requests=["GO"],
    )
    Twins(path).expect([({"law.inputs.v": [1.0, 2.0, 3.0]}, {"law.outputs.x": 23.0})])


def test_links_are_followed_to_the_files_beside(tmp_path: Path) -> None:
    """Like an installation by colcon: the machine and its algorithms are links to the sources."""
    files, algorithms = BESIDE["in a folder of it"]
    path = write_one_each(tmp_path / "src", files, algorithms, structs={"Goal": STRUCTS["Goal"]}, requests=["GO"])
    (tmp_path / "installed" / "alg").mkdir(parents=True)
    for name in (*files, "several.json"):
        (tmp_path / "installed" / name).symlink_to(path.parent / name)
    twins = Twins(tmp_path / "installed" / "several.json")
    twins.expect([({"law.inputs.v": [1.0, 2.0, 3.0]}, {"law.outputs.x": 23.0})])


IMPORTS = [
    "from frames import wrap",
    "from frames import (\n    wrap,\n)",
    "from frames import(wrap)",
    "from frames \\\n    import wrap",
    "from\\\n frames import wrap",
    "from\tframes\timport\twrap",
    "N = 2; from frames import wrap",
    "from frames import wrap; N = 2",
    "from control . frames import wrap",
    "from control.frames import \\\n    wrap",
    "from control \\\n    .frames import wrap  # from nowhere import",
]


@pytest.mark.parametrize("line", IMPORTS)
def test_a_change_beside_is_a_new_build(tmp_path: Path, line: str) -> None:
    """For any notation of the import. A change of a file that is not imported has no effect."""
    frames = "def wrap(x: f64) -> f64:\n    return x + 1.0\n"
    law = (
        f'{line}\n\n\nclass Law:\n    outputs = {{"y": "f64"}}\n\n    def execute(self):\n        self.y = wrap(1.0)\n'
    )
    path = write_one_each(
        tmp_path, {"law.py": law, "frames.py": frames, "control/frames.py": frames}, {"Law": {"source": "law.py"}}
    )
    first = build_machine(path)
    (tmp_path / "other.py").write_text("X = 1\n")
    assert build_machine(path) == first
    for name in ("frames.py", "control/frames.py"):
        (tmp_path / name).write_text(frames.replace("1.0", "2.0"))
    second = build_machine(path)
    assert second.library != first.library and second.source_hash != first.source_hash
    m = Machine.build(path)
    m.step()
    assert m.get("law.outputs.y") == 3.0


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("link out", "E103"),
        ("folder out", "E103"),
        ("circle", "E304"),
        ("dangling", "E304"),
        ("pipe", "E304"),
        ("folder", "E304"),
        ("huge", "E100"),
        ("binary", "E100"),
    ],
)
def test_imports_that_are_not_read(tmp_path: Path, kind: str, code: str) -> None:
    """The rules for sources also apply to imports."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "frames.py").write_text("SECRET = 1\n")
    folder = tmp_path / "m"
    law = "from frames import SECRET\n\n\nclass Law:\n    def execute(self):\n        pass\n"
    if kind == "folder out":
        law = law.replace("from frames", "from below.frames")
    path = write_one_each(folder, {"law.py": law}, {"Law": {"source": "law.py"}})
    frames = folder / "frames.py"
    if kind == "folder out":
        (folder / "below").symlink_to(tmp_path / "out")
    elif kind == "pipe":
        os.mkfifo(frames)
    elif kind == "folder":
        frames.mkdir()
    elif kind == "huge":
        with frames.open("wb") as file:
            file.truncate(1 << 40)
    elif kind == "binary":
        frames.write_bytes(bytes(range(256)))
    else:
        targets = {"link out": tmp_path / "out" / "frames.py", "circle": frames, "dangling": tmp_path / "nothing.py"}
        frames.symlink_to(targets[kind])
    with pytest.raises(DiagnosticError) as error:
        compile_machine(path, "")
    assert [d.code for d in error.value.diagnostics] == [code], str(error.value)
    assert "SECRET = 1" not in str(error.value)
