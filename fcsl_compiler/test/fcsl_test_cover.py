# SPDX-License-Identifier: Apache-2.0
"""Coverage without a host: coverage builds stepped in this process, and their counts."""

from __future__ import annotations

import ctypes as c
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fcsl_test_abi import Machine, write_machine

from fcsl_compiler.coverage.counts import Counts, confirmed, validate
from fcsl_compiler.coverage.figures import FileFigures, Miss, figures
from fcsl_compiler.coverage.probe_map import read_map
from fcsl_compiler.driver.library import build_library


class CCover(c.Structure):
    """fcsl_cover_t"""

    _fields_ = [
        ("version", c.c_uint32),
        ("attached", c.c_uint32),
        ("id", c.c_char_p),
        ("map", c.POINTER(c.c_char)),
        ("map_bytes", c.c_uint64),
        ("word_count", c.c_uint64),
        ("words", c.POINTER(c.c_uint64)),
    ]


def counts(machine: Machine) -> Counts:
    """Counts in the library of a machine."""
    table = CCover.in_dll(machine.dll, f"fcsl_cover_{machine.d.name.decode()}")
    found = Counts(read_map(table.map[: table.map_bytes]), confirmed(table.words[: 2 * table.word_count]))
    validate(found)
    return found


PORTS = """\
class Law:
    inputs = {
        "a": "bool",
        "b": "bool",
        "c": "bool",
        "d": "bool",
        "x": "f64",
        "n": "i64",
    }
    parameters = {"mode": "i64", "limit": "f64"}
    outputs = {"r": "bool", "z": "f64"}
    state = {"k": "i64"}

"""


class Trial:
    """One algorithm in a separate machine: its methods, and text `before` the class."""

    def __init__(self, folder: Path, methods: str, before: str = "", **instance: Any):
        definition = {"algorithm": "Law", "parameters": {"mode": 1, "limit": 2.0}, **instance}
        config = {
            "tick_hz": 10,
            "initial_state": "RUN",
            "instances": {"law": definition},
            "states": {"RUN": {"schedule": {"law": 10}}},
        }
        self.config = write_machine(folder, "trial", config, {"law": before + PORTS + methods})
        library = folder / "out" / "libtrial.so"
        build_library([self.config], library, cover=True)
        self.machine = Machine(library, "trial")
        self.before = before.count("\n")

    def tick(self, **inputs: Any) -> Trial:
        for name, value in inputs.items():
            self.machine.set(f"law.inputs.{name}", value)
        self.machine.step()
        return self

    @property
    def figures(self) -> FileFigures:
        return figures(counts(self.machine))[0]

    def share(self, kind: str) -> tuple[int, int]:
        share = self.figures.shares[kind]
        return share.met, share.total

    def misses(self) -> list[tuple[str, int, str]]:
        """Kind, line, message."""
        return [(m.kind, self.line(m), m.message) for m in self.figures.misses]

    def line(self, miss: Miss) -> int:
        """Line of a miss (from 1) in the file without the ports."""
        line = miss.span.line
        return line if line <= self.before else line - PORTS.count("\n")


def bools(letters: str, values: str) -> Mapping[str, bool]:
    """`bools("abc", "101")`"""
    return {letter: value == "1" for letter, value in zip(letters, values, strict=True)}
