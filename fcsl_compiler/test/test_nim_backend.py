# SPDX-License-Identifier: Apache-2.0
"""The Nim backend: the same machine as the C backend makes, bit for bit."""

import json
import math
import random
import re
import struct
import subprocess
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from fcsl_generator.campaign import campaign
from fcsl_generator.harness import check
from fcsl_generator.machines import cases
from fcsl_test_abi import Machine, write_machine
from fcsl_test_twins import InReference
from test_golden import CONFIG, GOLDEN, describe, golden

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.backends import NIM
from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.externs import build_externs
from fcsl_compiler.driver.nim import refuse_allocation
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import ToolchainError, include_dirs, math_library
from fcsl_compiler.reference.externs import externs_of

EXAMPLES = Path(__file__).parents[2] / "examples"
PAGE = EXAMPLES.parent / "docs/internals/nim.md"
C_OF_NIM = Path(__file__).parents[1] / "cmake/fcsl_c_of_nim.cmake"


def nim_machine(config: Path, **options: Any) -> Machine:
    built = build_machine(config, backend="nim")
    return Machine(built.library, built.name, **options)


@pytest.mark.parametrize("single", [True, False], ids=["programs", "machines"])
def test_generated_ones_agree(request: pytest.FixtureRequest, single: bool) -> None:
    """Nim, CPython and the oracle: every field, tick and bit. test_generated.py compares C with these two."""
    count = max(10, request.config.getoption("--programs") // 20)
    campaign(cases(single=single), count, request.config.getoption("--program-seed"), partial(check, backend="nim"))


@pytest.mark.parametrize("name", ["small", "values"])
def test_generated_nim(name: str) -> None:
    """`small` is a plain machine; `values` has every kind of value: structs, slices, frozen parameters, hardware."""
    made = compile_machine(GOLDEN / f"{name}.json", "", backend="nim")
    golden(f"{name}.nim.txt", made.source.replace(made.build_hash, "…"))


@pytest.mark.parametrize("name", ["small", "values"])
def test_nim_warns_of_nothing(tmp_path: Path, name: str) -> None:
    """A user's program imports the module."""
    module = tmp_path / f"{name}.nim"
    module.write_text(compile_machine(GOLDEN / f"{name}.json", "", backend="nim").source)
    quiet = ("--hints:off", "--skipCfg", "--compileOnly", f"--nimcache:{tmp_path / 'c'}")
    done = subprocess.run(["nim", "c", *quiet, str(module)], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_a_number_that_is_no_state_runs_nothing() -> None:
    machines = [Machine.build(CONFIG), nim_machine(CONFIG)]
    for m in machines:
        m.step(5)
        before = {path: bytes(m.raw(path)) for path in m.fields}
        for path in ("machine.state", "machine.next_state"):
            m.raw(path)[0] = 99
            before[path] = bytes(m.raw(path))
        m.step(3)
        changed = {path for path in m.fields if bytes(m.raw(path)) != before[path]}
        assert changed == {"machine.tick"}


def test_no_host_can_tell_which_backend_made_a_machine() -> None:
    """But by the build hash."""
    c, nim = Machine.build(CONFIG), nim_machine(CONFIG)
    assert describe(nim) == describe(c)
    assert nim.d.build_hash != c.d.build_hash


#: Names that Nim takes for one, its keywords, its own names, and names that C refuses.
NAMES = """
class Names:
    inputs = {"end": "f64", "result": "f64", "pos_x": "f64", "posX": "f64", "POS_X": "f64", "x_1": "f64", "INF": "f64", "CHAR_BIT": "f64"}
    outputs = {"sum": "f64", "type": "f64", "p_os_x": "f64", "transition_request": "TransitionRequest"}
    state = {"float64": "f64", "addr": "i64", "double": "f64", "echo": "f64", "seq": "i32"}

    def execute(self):
        array = self.end
        arr_ay = array + self.result
        aRRAY = arr_ay + self.pos_x
        let = aRRAY + 10.0 * self.posX + 100.0 * self.POS_X
        for proc in range(3):
            let += f64(proc)
        self.double = let
        self.sum = self.double
        self.echo = let
        self.seq += 1
        PATH_MAX = self.CHAR_BIT + 1.0
        NI = PATH_MAX * PATH_MAX
        self.type = self.x_1 - self.INF + NI
        self.float64 += self.type
        self.addr += 1
        self.p_os_x = self.float64
        self.transition_request = "stop_it"
"""


def test_names_that_are_one_to_nim_are_told_apart(tmp_path: Path) -> None:
    instance = {"algorithm": "Names"}
    config = write_machine(
        tmp_path,
        "names",
        {
            "tick_hz": 10,
            "initial_state": "end",
            "instances": {"one": instance, "o_ne": instance},
            "states": {"end": {"schedule": {"one": 10, "o_ne": 10}}, "END": {"schedule": {"one": 10}}},
            "requests": ["stop_it", "stopIt"],
            "transitions": [{"from": "end", "to": "END", "request": "stop_it"}],
        },
        {"names": NAMES},
    )
    machines = [Machine.build(config), nim_machine(config)]
    for m in machines:
        for n, name in enumerate(("end", "result", "pos_x", "posX", "POS_X", "x_1", "INF", "CHAR_BIT"), 1):
            m.set(f"one.inputs.{name}", float(n))
        m.step(3)
    found = [{path: list(m.raw(path)) for path in m.fields} for m in machines]
    assert found[0] == found[1]
    assert machines[1].get("one.outputs.sum") == 1 + 2 + 3 + 40 + 500 + 3
    assert machines[1].get("machine.state") == "END"


@pytest.mark.parametrize("name", ["health", "host", "system", "result"])
def test_a_machine_may_have_a_name_of_nim(tmp_path: Path, name: str) -> None:
    m = nim_machine(_counter(tmp_path, name))
    m.step(3)
    assert m.get("one.outputs.y") == 3.0


def test_a_keyword_is_no_module(tmp_path: Path) -> None:
    with pytest.raises(ToolchainError, match="machine `object`: no module of Nim has this name, a keyword; rename"):
        nim_machine(_counter(tmp_path, "object"))


def _counter(folder: Path, name: str) -> Path:
    text = 'class A:\n    outputs = {"y": "f64"}\n\n    def execute(self):\n        self.y += 1.0\n'
    config = {
        "tick_hz": 10,
        "initial_state": "S",
        "instances": {"one": {"algorithm": "A"}},
        "states": {"S": {"schedule": {"one": 10}}},
    }
    return write_machine(folder, name, config, {"a": text})


def test_floats_are_written_to_the_bit(tmp_path: Path) -> None:
    numbers = random.Random(1)
    values = [struct.unpack("<d", numbers.randbytes(8))[0] for _ in range(300)]
    values = [v for v in values if math.isfinite(v)] + [
        5e-324,
        1.7976931348623157e308,
        0.1,
        -0.0,
        2.0**53 + 2,
        1e22,
        1e23,
    ]
    text = "from fcsl_builtins import f32, f64\n\n"
    text += f"WIDE: f64[{len(values)}] = [{', '.join(map(repr, values))}]\n"
    narrow = [v for v in values if abs(v) < 3e38 and (v == 0 or abs(v) > 1e-44)]
    text += f"NARROW: f32[{len(narrow)}] = [{', '.join(map(repr, narrow))}]\n"
    text += f"""

class Constants:
    outputs = {{"wide": "f64[{len(values)}]", "narrow": "f32[{len(narrow)}]"}}

    def execute(self):
        self.wide = WIDE
        self.narrow = NARROW
"""
    config = write_machine(
        tmp_path,
        "floats",
        {
            "tick_hz": 10,
            "initial_state": "A",
            "instances": {"one": {"algorithm": "Constants"}},
            "states": {"A": {"schedule": {"one": 10}}},
        },
        {"constants": text},
    )
    machines = [Machine.build(config), nim_machine(config)]
    for m in machines:
        m.step()
    for name in ("wide", "narrow"):
        one, other = (bytes(m.raw(f"one.outputs.{name}")) for m in machines)
        assert one == other
    assert bytes(machines[1].raw("one.outputs.wide")) == struct.pack(f"<{len(values)}d", *values)


EXTERNS = """
from fcsl_builtins import extern, f64


@extern(header="board.nim", lang="nim")
def smooth(x: f64, weights: "f64[3]") -> f64: ...


@extern(header="board.nim", lang="nim")
def doubled(x: "f64[3]") -> "f64[3]": ...


class Filter:
    inputs = {"x": "f64"}
    outputs = {"y": "f64", "twice": "f64[3]"}
    parameters = {"weights": "f64[3]"}

    def execute(self):
        self.y = smooth(self.x, self.weights)
        self.twice = doubled(self.weights)
"""
BOARD = """
proc smooth*(x: float64, weights: ptr array[3, float64]): float64 {.exportc, cdecl.} =
  for w in weights[]:
    result += w * x

proc doubled*(x, to: ptr array[3, float64]) {.exportc, cdecl.} =
  for i in 0 ..< 3:
    to[i] = 2.0 * x[i]
"""


def with_externs(folder: Path, board: str = BOARD) -> Path:
    (folder / "board.nim").write_text(board)
    config = {
        "tick_hz": 10,
        "initial_state": "S",
        "instances": {"one": {"algorithm": "Filter", "parameters": {"weights": [1.0, 2.0, 3.0]}}},
        "states": {"S": {"schedule": {"one": 10}}},
        "targets": {"simulation": {"sources": ["board.nim"]}},
    }
    return write_machine(folder, "filter", config, {"filter": EXTERNS})


def test_an_extern_in_nim_is_called_from_either_backend_and_from_python(tmp_path: Path) -> None:
    config = with_externs(tmp_path)
    built = build_machine(config)
    checked = compile_machine(config, "").checked
    python = InReference(built.library, checked, externs=externs_of(build_externs(config)))
    for m in (Machine.build(config), nim_machine(config), python):
        m.set("one.inputs.x", 2.0)
        m.step()
        assert m.get("one.outputs.y") == 12.0
        assert list(m.raw("one.outputs.twice")) == [2.0, 4.0, 6.0]


@pytest.mark.parametrize("c_only", [[], ["--c-only"]])
def test_an_extern_of_other_types_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], c_only: list[str]
) -> None:
    config = with_externs(tmp_path, BOARD.replace("x: float64, weights", "x: float32, weights"))
    assert main(["build", str(config), "-o", str(tmp_path / "out"), *c_only]) != 0
    said = capsys.readouterr().err
    assert (
        "type mismatch: got" in said
        and "x: float32" in said
        and "The machine calls the externs doubled, smooth" in said
    )
    assert not list((tmp_path / "out").glob("*")) if c_only else not (tmp_path / "out").exists()


def test_an_extern_in_nim_that_allocates_does_not_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = with_externs(tmp_path, BOARD + "\nvar log: seq[float64]\nproc more*() {.exportc.} =\n  log.add(1.0)\n")
    assert main(["build", str(config), "-o", str(tmp_path / "out")]) != 0
    assert "Nim's own library is not linked" in capsys.readouterr().err


def test_a_change_of_an_extern_in_nim_builds_again(tmp_path: Path) -> None:
    config = with_externs(tmp_path)
    before = build_machine(config).library
    assert build_machine(config).library == before
    (tmp_path / "board.nim").write_text(BOARD.replace("2.0 * x", "4.0 * x"))
    assert build_machine(config).library != before


def test_a_struct_is_for_c_alone(tmp_path: Path) -> None:
    config = with_externs(tmp_path)
    whole = json.loads(config.read_text())
    config.write_text(json.dumps({**whole, "structs": {"Pose": {"x": "f64"}}}))
    source = next(tmp_path.rglob("filter.py"))
    source.write_text(source.read_text().replace("def smooth(x: f64,", 'def smooth(x: "Pose",'))
    with pytest.raises(DiagnosticError, match="`smooth` is written in Nim, which has no type for the struct `Pose`"):
        compile_machine(config, "")


def test_what_allocates_is_refused() -> None:
    refuse_allocation('# a seq of words\nlet text = "new string"\n{.emit: ["""\nref\n"""].}\n', "a.nim")
    for line in ("var x: seq[int]", "let y = new(Thing)", "raise e", "var s: string", "try:"):
        with pytest.raises(ToolchainError, match="a.nim:2: .* has no place in control code"):
            refuse_allocation(f"proc f() =\n  {line}\n", "a.nim")


def test_a_missing_compiler_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("NIM", "/nowhere/nim")
    assert main(["build", "--backend", "nim", str(CONFIG), "-o", str(tmp_path / "out")]) != 0
    said = capsys.readouterr().err
    assert "no Nim compiler: `/nowhere/nim` does not run; install nim" in said and "or set NIM" in said
    assert not (tmp_path / "out").exists()


def test_a_nim_program_hosts_a_machine(tmp_path: Path) -> None:
    """examples/minimal/host.nim, built as its first lines say, prints what the C library computes."""
    assert main(["build", "--backend", "nim", str(EXAMPLES / "minimal/minimal.json"), "-o", str(tmp_path)]) == 0
    command = [
        "nim",
        "c",
        "--hints:off",
        "--mm:arc",
        "-d:release",
        f"--path:{tmp_path}",
        f"--nimcache:{tmp_path / 'nim'}",
    ]
    command += [f"--passC:-I{include_dirs()[0]} -ffp-contract=off", f"--passL:{math_library()} -lm"]
    host = EXAMPLES / "minimal/host.nim"
    subprocess.run([*command, f"--out:{tmp_path / 'host'}", str(host)], check=True, capture_output=True, timeout=120)
    printed = subprocess.run([str(tmp_path / "host")], check=True, capture_output=True, text=True).stdout
    (shown,) = re.findall(r"<!-- file: examples/minimal/host.nim -->\n```nim\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert host.read_text().endswith(shown)
    m = Machine.build(EXAMPLES / "minimal/minimal.json")
    expected = []
    for tick in range(5):
        m.set("sensors.outputs.theta", 0.1 * tick)
        m.step()
        expected.append(float(m.get("pilot.outputs.force")))
    assert [float(line.split()[-1]) for line in printed.splitlines()] == pytest.approx(expected, rel=1e-15)


def test_cmake_has_the_flags_of_fcslc() -> None:
    (flags,) = re.findall(r"set\(flags (.*?)\)", C_OF_NIM.read_text(), re.DOTALL)
    assert ("c", *flags.split()) == NIM.flags


def test_cmake_takes_the_compiler_of_fcslc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """$NIM is a command with arguments."""
    (tmp_path / "board.nim").write_text(BOARD)
    (tmp_path / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.22)\nproject(by_nim C)\ninclude({json.dumps(str(C_OF_NIM))})\n"
        'fcsl_c_of_nim(board board.nim "" made library)\nadd_custom_target(board ALL DEPENDS "${made}")\n'
    )
    wrapper, log = tmp_path / "my nim", tmp_path / "log"
    wrapper.write_text(f'#!/bin/sh\nshift\necho "$1" >> {log}\nexec nim "$@"\n')
    wrapper.chmod(0o755)
    configure = ["cmake", "-S", str(tmp_path), "-B", str(tmp_path / "build")]
    monkeypatch.setenv("NIM", f"'{wrapper}' first")
    for command in (configure, ["cmake", "--build", str(tmp_path / "build")]):
        subprocess.run(command, check=True, capture_output=True, timeout=120)
    assert log.read_text().split() == ["dump", "c"]
    assert (tmp_path / "build/board_nim/board.nim.c").is_file()
    monkeypatch.setenv("NIM", "/nowhere/nim")
    done = subprocess.run(configure, capture_output=True, text=True, timeout=120)
    said = " ".join(done.stderr.split())
    assert done.returncode != 0 and "`/nowhere/nim dump` does not say" in said and "or set NIM" in said


def test_cmake(tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(by_nim C)\nfind_package(fcsl_compiler REQUIRED)\n"
        f"fcsl_add_machine(by_nim_machines {json.dumps(str(CONFIG))} BACKEND nim)\n"
        f"fcsl_add_machine(with_extern {json.dumps(str(with_externs(tmp_path)))})\n"
    )
    for command in (["-S", str(tmp_path), "-B", str(tmp_path / "build")], ["--build", str(tmp_path / "build")]):
        done = subprocess.run(["cmake", *command], capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
    m, c = Machine(tmp_path / "build/libby_nim_machines.so", "small"), Machine.build(CONFIG)
    for one in (m, c):
        one.step(100)
    assert [list(m.raw(p)) for p in m.fields] == [list(c.raw(p)) for p in c.fields]
    assert "small: a step needs at most " in done.stdout
    m = Machine(tmp_path / "build/libwith_extern.so", "filter")
    m.step()
    assert list(m.raw("one.outputs.twice")) == [2.0, 4.0, 6.0]
