# SPDX-License-Identifier: Apache-2.0
"""Inputs that are too large are rejected immediately, large ones compile in time, and a C compiler that hangs is
killed."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver import toolchain
from fcsl_compiler.driver.library import build_library
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import ToolchainError

CLASS = """class Law:
    outputs = {{"x": "f64", "b": "bool", "v": "f64[3]", "k": "i64"}}

    def execute(self):
        {}
"""


def craft(folder: Path, text: str, **more: Any) -> Path:
    config = {
        "tick_hz": 100,
        "initial_state": "A",
        "instances": {"law": {"algorithm": "Law"}},
        "states": {"A": {"schedule": {"law": 100}}},
        **more,
    }
    return write_machine(folder, "craft", config, {"law": text})


def codes(config: Path) -> list[str]:
    """Codes of errors."""
    try:
        compile_machine(config, "")
    except DiagnosticError as error:
        return [d.code for d in error.diagnostics if d.code.startswith("E")]
    return []


def helpers(count: int, body: str) -> str:
    """h0, and `count` helpers that each call the previous one."""
    first = "def h0(a: f64) -> f64:\n    return a\n\n\n"
    return first + "".join(
        f"def h{n}(a: f64) -> f64:\n    return {body.format(f'h{n - 1}')}\n\n\n" for n in range(1, count)
    )


CHAINS = {
    "and": lambda n: "self.b = " + " and ".join(["self.x > 1.0"] * n),
    "or": lambda n: "self.b = " + " or ".join(["self.b"] * n),
    "comparison": lambda n: "self.b = " + " < ".join(["self.x"] * n),
    "max": lambda n: f"self.x = max({', '.join(['self.x'] * n)})",
}


@pytest.mark.parametrize("chain", CHAINS)
def test_chains_of_operands(tmp_path: Path, chain: str) -> None:
    assert codes(craft(tmp_path, CLASS.format(CHAINS[chain](90)))) == []
    for count in (120, 2000):
        assert codes(craft(tmp_path, CLASS.format(CHAINS[chain](count)))) == ["E110"]


def test_chains_of_helpers(tmp_path: Path) -> None:
    assert codes(craft(tmp_path, helpers(64, "{0}(a) + 1.0") + CLASS.format("self.x = h63(self.x)"))) == []
    assert codes(craft(tmp_path, helpers(300, "{0}(a) + 1.0") + CLASS.format("self.x = h299(self.x)"))) == ["E430"]


def test_helpers_that_call_others_twice_do_not_double_the_code(tmp_path: Path) -> None:
    config = craft(tmp_path, helpers(30, "{0}(a) * {0}(a + 1.0)") + CLASS.format("self.x = h29(self.x)"))
    build_library([config], tmp_path / "libcraft.so")
    assert (tmp_path / "libcraft.so").stat().st_size < 200_000


def test_loops_in_loops(tmp_path: Path) -> None:
    depth = 18
    lines = ["    " * n + f"for i{n} in range(1):" for n in range(depth)] + ["    " * depth + "self.v[self.k] = 1.0"]
    began = time.process_time()
    assert codes(craft(tmp_path, CLASS.format("\n        ".join(lines)))) == []
    assert time.process_time() - began < 20  # this took minutes


def test_structs_in_structs(tmp_path: Path) -> None:
    """Eight members each: four levels are 4096 scalars, and eighteen would be 2^54."""

    def structs(depth: int) -> dict[str, dict[str, str]]:
        return {f"S{n}": {f"m{k}": f"S{n - 1}" if n else "f64" for k in range(8)} for n in range(depth)}

    held = 'class Law:\n    state = {{"s": "S{}"}}\n\n    def execute(self): ...\n'
    assert codes(craft(tmp_path, held.format(3), structs=structs(4))) == []
    views = {"panels": [{"title": "large", "values": ["law.state.s.m0"]}]}
    assert set(codes(craft(tmp_path, held.format(17), structs=structs(18), views=views))) == {"E232"}


@pytest.mark.parametrize("order", [1, -1], ids=["inner first", "outer first"])
def test_a_chain_of_structs(tmp_path: Path, order: int) -> None:
    """Its length has one bound, whatever the order in the file."""
    held = 'class Law:\n    state = {{"s": "S{}"}}\n\n    def execute(self): ...\n'
    for length, expected in ((33, set()), (34, {"E232"}), (700, {"E232"})):
        chain = [(f"S{n}", {"m": f"S{n - 1}" if n else "f64"}) for n in range(length)]
        folder = tmp_path / str(length)
        folder.mkdir()
        found = codes(craft(folder, held.format(length - 1), structs=dict(chain[::order])))
        assert {code for code in found if code[0] == "E"} == expected


def test_a_c_compiler_that_does_not_end_is_ended_with_what_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Like gcc, it waits for a child process that is working."""
    compiler, started = tmp_path / "cc", tmp_path / "started"
    compiler.write_text(
        f'#!/bin/sh\ncase "$*" in *--version*|*" -E "*) exec cc "$@";; esac\nsleep 1000 &\necho $! > {started}\nwait\n'
    )
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setattr(toolchain, "_COMPILE_TIMEOUT_S", 2)
    with pytest.raises(ToolchainError, match="took longer than 2 s"):
        build_library([craft(tmp_path, CLASS.format("self.x = 1.0"))], tmp_path / "out" / "libcraft.so")
    child = int(started.read_text())
    for _ in range(100):
        if not _works(child):
            return
        time.sleep(0.05)
    pytest.fail("the compiler's child lives on")


def _works(pid: int) -> bool:
    """Whether a process exists and is not a zombie."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        os.kill(pid, 0)
        return state != "Z"
    except OSError:
        return False
