# SPDX-License-Identifier: Apache-2.0
"""`targets`: link inputs of externs in fcslc and in CMake, and their scan, hashes, cache and reports."""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine

from fcsl_compiler.base.diagnostics import DiagnosticError, DiagnosticSink
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.externs import build_externs
from fcsl_compiler.driver.library import build_library
from fcsl_compiler.driver.symbols import SymbolError, check_symbols
from fcsl_compiler.driver.toolchain import FLAGS, ToolchainError, call_graph_flags, compile_objects, compiler
from fcsl_compiler.parse.machine_files import parse_machine

LAW = '''
from fcsl_builtins import extern, f64


@extern(header="probe.h", lang="c")
def probe(gain: f64, raw: "f64[3]") -> f64:
    """A measurement."""
    ...


class Law:
    inputs = {"raw": "f64[3]"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = probe(2.0, self.raw)
'''
HEADER = "#define PROBE_OFFSET 1.0\ndouble probe(double gain, const double *raw);\n"
STUB = '#include "probe.h"\ndouble probe(double gain, const double *raw) { return gain * raw[2] + PROBE_OFFSET; }\n'
#: The source of an extern may include the header of the machine for its structs.
WITH_OWN_HEADER = '#include "craft.h"\n' + STUB
BOARD = """#define _POSIX_C_SOURCE 200809L
#include "probe.h"
#include <unistd.h>
double probe(double gain, const double *raw)
{
    (void)raw;
    return gain * (double)(getpid() > 0);
}
"""
TARGETS: dict[str, Any] = {
    "simulation": {"sources": ["c/stub.c"], "include": ["c/include"]},
    "board": {"sources": ["c/board.c"], "include": ["c/include"], "libraries": ["m"]},
}
#: The .map.json names the extern, so the scan of the generated objects allows it.
SOURCES = {"law.py": LAW, "c/include/probe.h": HEADER, "c/stub.c": STUB, "c/board.c": BOARD}


def machine(folder: Path, targets: dict[str, Any] | None = None, **files: str) -> Path:
    """A machine whose law calls `probe`. `files` replaces texts; their names have _ for / and ."""
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law", "inputs": {"raw": [1.0, 2.0, 4.0]}}},
        "states": {"RUN": {"schedule": {"law": 100}}},
        "targets": TARGETS if targets is None else targets,
    }
    for name, text in SOURCES.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(files.get(name.replace("/", "_").replace(".", "_"), text))
    (folder / "craft.json").write_text(json.dumps(config, indent=1))
    return folder / "craft.json"


def output_of(library: Path) -> float:
    craft = Machine(library, "craft")
    craft.step()
    return float(craft.get("law.outputs.y"))


# ---- reading ----------------------------------------------------------------------------------------------------------

BAD: list[tuple[dict[str, Any], str]] = [
    ({"sources": ["c/none.c"]}, "cannot read `c/none.c`: no such file"),
    ({"sources": ["c/include/probe.h"]}, "`c/include/probe.h` is not a file in C or Nim"),
    ({"sources": ["../c/stub.c"]}, "`../c/stub.c` cannot be used"),
    ({"sources": ["/etc/passwd"]}, "`/etc/passwd` cannot be used"),
    ({"sources": ["c/pipe.c"]}, "cannot read `c/pipe.c`: it is not a regular file"),
    ({"sources": ["c/away.c"]}, "`c/away.c` cannot be used"),
    ({"sources": ["c/stub.c", "c/stub.c"]}, "`c/stub.c` is listed twice"),
    ({"include": ["c/nowhere"]}, "no such folder: `c/nowhere`"),
    ({"include": ["c/stub.c"]}, "`c/stub.c` is not a folder"),
    ({"libraries": ["-Wl,--wrap=malloc"]}, "`-Wl,--wrap=malloc` cannot be a library"),
    ({"libraries": ["lib/libx.so"]}, "`lib/libx.so` cannot be a library"),
    ({"libraries": ["lib/libx.a"]}, "cannot read `lib/libx.a`: no such file"),
    ({"libraries": ["../libx.a"]}, "`../libx.a` cannot be used"),
]


@pytest.mark.parametrize(("target", "message"), BAD)
def test_a_wrong_target_is_refused(tmp_path: Path, target: dict[str, Any], message: str) -> None:
    config = machine(tmp_path / "in", {"simulation": target})
    os.mkfifo(tmp_path / "in/c/pipe.c")
    (tmp_path / "away.c").write_text(STUB)
    (tmp_path / "in/c/away.c").symlink_to(tmp_path / "away.c")
    sink = DiagnosticSink()
    parse_machine(config, sink)
    assert [(d.code, d.message) for d in sink.diagnostics] == [("E233", message)]


def test_an_unknown_target_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = machine(tmp_path)
    for command in (["build", "-o", str(tmp_path / "out")], ["externs"]):
        assert main([*command, str(config), "--target", "bord"]) == 1
        err = capsys.readouterr().err
        assert (
            "craft.json:28:13: error[E233]: the machine has no target `bord`" in err and "did you mean `board`?" in err
        )
    assert not (tmp_path / "out").exists()
    config = machine(tmp_path / "only", {"board": TARGETS["board"]})
    assert main(["check", str(config)]) == 0  # a missing file concerns the build only
    with pytest.raises(DiagnosticError, match="the machine has no target `simulation`"):
        build_machine(config)


# ---- building ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", ["c", "nim"])
def test_a_header_of_an_extern_may_be_called_like_the_machine(tmp_path: Path, backend: str) -> None:
    """Also with the guard that everybody gives it; and a change of it is another build."""
    guarded = f"#ifndef CRAFT_H\n#define CRAFT_H\n{HEADER}#endif\n"
    path = machine(tmp_path, law_py=LAW.replace("probe.h", "craft.h"), c_stub_c=STUB.replace("probe.h", "craft.h"))
    (tmp_path / "c/include/craft.h").write_text(guarded)
    built = [build_library([path], tmp_path / "out/libcraft.so", backend=backend)]
    assert output_of(tmp_path / "out/libcraft.so") == 9.0
    (tmp_path / "c/include/craft.h").write_text(guarded.replace("OFFSET 1.0", "OFFSET 2.0"))
    built.append(build_library([path], tmp_path / "other/libcraft.so", backend=backend))
    assert output_of(tmp_path / "other/libcraft.so") == 10.0
    assert built[0][0].build_hash != built[1][0].build_hash


def test_each_target_links_its_own(tmp_path: Path) -> None:
    config = machine(tmp_path)
    simulation, board = build_machine(config), build_machine(config, "board")
    assert output_of(simulation.library) == 9.0 and output_of(board.library) == 2.0
    assert simulation.source_hash == board.source_hash
    hashes = {Machine(b.library, "craft").d.build_hash for b in (simulation, board)}
    assert len(hashes) == 2


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("c/stub.c", "PROBE_OFFSET;", "PROBE_OFFSET + 1.0;"), ("c/include/probe.h", "OFFSET 1.0", "OFFSET 2.0")],
)
def test_a_changed_source_or_header_is_another_build(tmp_path: Path, name: str, old: str, new: str) -> None:
    config = machine(tmp_path)
    before = build_machine(config)
    assert build_machine(config) == before
    (tmp_path / name).write_text((tmp_path / name).read_text().replace(old, new))
    after = build_machine(config)
    assert after.library != before.library and after.source_hash == before.source_hash
    script = f"from test_targets import *; print(output_of(Path({str(after.library)!r})))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=Path(__file__).parent)
    assert done.stdout == "10.0\n", done.stderr


def test_a_static_library_is_linked(tmp_path: Path) -> None:
    config = machine(tmp_path, {"simulation": {"include": ["c/include"], "libraries": ["c/libprobe.a"]}})
    objects = tmp_path / "stub.o"
    subprocess.run(
        [*compiler(), *FLAGS, f"-I{tmp_path}/c/include", "-c", tmp_path / "c/stub.c", "-o", objects], check=True
    )
    subprocess.run(["ar", "rcs", tmp_path / "c/libprobe.a", objects], check=True)
    assert output_of(build_machine(config).library) == 9.0


def test_what_a_target_lacks_is_told(tmp_path: Path) -> None:
    for number, (targets, words) in enumerate(
        [
            ({}, ["It has no `targets`"]),
            ({"simulation": {"include": ["c/include"]}}, ["undefined reference", "`simulation` has no source; "]),
            ({"simulation": {"sources": ["c/stub.c"]}}, ["probe.h", "stub.c; no include folder."]),
        ]
    ):
        config = machine(tmp_path / str(number), targets)
        if not targets:
            config.write_text(json.dumps({k: v for k, v in json.loads(config.read_text()).items() if k != "targets"}))
        with pytest.raises(ToolchainError) as raised:
            build_machine(config)
        assert "The machine calls the externs probe." in str(raised.value)
        assert all(word in str(raised.value) for word in words), raised.value


def test_another_prototype_is_refused(tmp_path: Path) -> None:
    wrong = "int probe(double gain, const double *raw);\n"
    config = machine(
        tmp_path,
        c_include_probe_h=wrong,
        c_stub_c='#include "probe.h"\nint probe(double g, const double *r)\n{ return (int)(g + r[0]); }\n',
    )
    with pytest.raises(
        ToolchainError, match=r"probe is not what law.py:6:1 declares: double\(double, const double \*\)"
    ):
        build_machine(config)


def test_an_object_that_does_not_compile_ends_those_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wrapper, pids = tmp_path / "cc", tmp_path / "pids"
    wrapper.write_text(f"""#!/bin/sh
case "$*" in
*hangs.c*) echo $$ >> {pids}; exec sleep 600;;
*wrong.c*) while [ ! -s {pids} ]; do sleep 0.01; done;;
esac
exec cc "$@"
""")
    wrapper.chmod(0o755)
    monkeypatch.setenv("CC", str(wrapper))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    (tmp_path / "wrong.c").write_text("int wrong = ;\n")
    (tmp_path / "hangs.c").write_text("int right = 1;\n")
    with pytest.raises(ToolchainError, match="wrong.c:1"):
        compile_objects([tmp_path / "wrong.c", tmp_path / "hangs.c"], [], tmp_path / "objects")
    assert not Path(f"/proc/{int(pids.read_text())}").exists()


def test_the_build_tells_what_it_cannot_know(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = machine(tmp_path)
    assert main(["build", str(config), "-o", str(tmp_path / "out"), "--target", "board"]) == 0
    out = capsys.readouterr().out
    assert out.endswith("functions called by its externs: getpid\n")
    if call_graph_flags(tuple(compiler())):
        assert ", without its externs: probe\n" in out
    compilation = build_library([config], tmp_path / "sim/libcraft.so")[0]
    assert compilation.extern_calls == ()
    assert {p.name for p in (tmp_path / "sim").iterdir()} == {
        "libcraft.so", "craft.c", "craft.h", "craft.map.json", "fcsl_machines.c"
    }  # fmt: skip


def test_the_depfile_and_externs_list_the_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = machine(tmp_path)
    depfile = tmp_path / "craft.d"
    command = ["build", "--c-only", str(config), "-o", str(tmp_path / "out"), "--depfile", str(depfile)]
    assert main([*command, "--target", "board"]) == 0
    needs = depfile.read_text().split()
    assert {str(tmp_path / n) for n in ("c/board.c", "c/include/probe.h")} <= set(needs)
    assert str(tmp_path / "c/stub.c") not in needs
    capsys.readouterr()
    assert main(["externs", str(config), str(config), "--target", "board"]) == 0
    listed = f"source {tmp_path}/c/board.c\ninclude {tmp_path}/c/include\nlibrary m\n"
    assert capsys.readouterr().out == listed


# ---- scan -------------------------------------------------------------------------------------------------------------


def test_the_scan_exempts_only_externs(tmp_path: Path) -> None:
    """The scan applies to the machine's object. Calls of the externs' code are printed, not rejected."""
    head = "#include <stdlib.h>\ndouble probe(double);\n"
    calls = {"own": "probe(1.0) + (double)(size_t)malloc(8)", "good": "probe(1.0)"}
    for name, call in calls.items():
        (tmp_path / f"{name}.c").write_text(head + f"double step(void) {{ return {call}; }}\n")
    (tmp_path / "extern.c").write_text(head + "double probe(double x) { return x + (double)(size_t)malloc(8); }\n")
    for name in ("own", "good", "extern"):
        subprocess.run([*compiler(), *FLAGS, "-c", tmp_path / f"{name}.c", "-o", tmp_path / f"{name}.o"], check=True)
    for name in calls:
        objects = [tmp_path / f"{name}.o"]
        library = tmp_path / f"lib{name}.so"
        subprocess.run([*compiler(), "-shared", *objects, tmp_path / "extern.o", "-o", library], check=True)
        if name == "own":
            with pytest.raises(SymbolError, match="libown.so would call malloc; a step .* and its externs"):
                check_symbols(library, objects, ["probe"])
        else:
            assert check_symbols(library, objects, ["probe"]) == ["malloc"]
        with pytest.raises(SymbolError, match="malloc, probe"[: 14 if name == "own" else 6]):
            check_symbols(library, objects, [])


def test_scan_takes_the_externs_from_the_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = machine(tmp_path)
    out = tmp_path / "out"
    assert main(["build", str(config), "-o", str(out), "--target", "board"]) == 0
    capsys.readouterr()
    library = str(out / "libcraft.so")
    assert main(["scan", library]) == 1 and "would call getpid" in capsys.readouterr().err
    assert main(["scan", library, "--emitted", str(out)]) == 0
    assert capsys.readouterr().out == "functions called by its externs: getpid\n"
    for text in ("{", "[]", '{"externs": 1}'):
        (out / "craft.map.json").write_text(text)
        assert main(["scan", library, "--emitted", str(out)]) == 2
        assert "craft.map.json` is not a map of this fcslc version" in capsys.readouterr().err


# ---- alone ------------------------------------------------------------------------------------------------------------


def test_externs_alone_are_a_library_that_python_can_call(tmp_path: Path) -> None:
    config = machine(tmp_path, c_stub_c=WITH_OWN_HEADER)
    raw = (ctypes.c_double * 3)(0.0, 0.0, 3.0)
    for target, expected in (("simulation", 13.0), ("board", 4.0 if os.getpid() else 0.0)):
        library = build_externs(config, target)
        assert library == build_externs(config, target)
        probe = ctypes.CDLL(str(library)).probe
        probe.restype = ctypes.c_double
        probe.argtypes = [ctypes.c_double, ctypes.POINTER(ctypes.c_double)]
        assert probe(4.0, raw) == expected
    none = machine(tmp_path / "none", {"simulation": {}})
    assert ctypes.CDLL(str(build_externs(none))).abs(-3) == 3


# ---- CMake ------------------------------------------------------------------------------------------------------------

CMAKE = """cmake_minimum_required(VERSION 3.22)
project(craft_package C)
find_package(fcsl_compiler REQUIRED)
fcsl_add_machine(craft_simulation craft.json)
fcsl_add_machine(craft_board craft.json TARGET board)
"""


def test_cmake_builds_both_targets(tmp_path: Path) -> None:
    config = machine(tmp_path / "a craft", c_stub_c=WITH_OWN_HEADER)
    folder = config.parent
    (folder / "CMakeLists.txt").write_text(CMAKE)

    def run(*command: object) -> str:
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run("cmake", "-S", folder, "-B", folder / "build", f"-DCMAKE_INSTALL_PREFIX={folder / 'prefix'}")
    told = run("cmake", "--build", folder / "build")
    assert "functions called by its externs: getpid\n" in told
    assert output_of(folder / "build/libcraft_simulation.so") == 9.0
    assert output_of(folder / "build/libcraft_board.so") == 2.0
    run("cmake", "--install", folder / "build")
    assert (folder / "prefix/lib/craft_package/libcraft_board.so").is_file()
    index = folder / "prefix/share/ament_index/resource_index/fcsl_machines"
    assert [p.read_text() for p in index.iterdir()] == ["lib/craft_package/libcraft_simulation.so\n"]
    # A changed extern is recompiled.
    (folder / "c/stub.c").write_text(WITH_OWN_HEADER.replace("gain * raw[2]", "100.0"))
    run("cmake", "--build", folder / "build")
    script = f"from test_targets import *; print(output_of(Path({str(folder / 'build/libcraft_simulation.so')!r})))"
    assert (
        run(
            sys.executable,
            "-c",
            f"import os; os.chdir({str(Path(__file__).parent)!r}); import sys; sys.path.insert(0, ''); {script}",
        )
        == "101.0\n"
    )
