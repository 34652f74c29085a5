# SPDX-License-Identifier: Apache-2.0
"""One block in a machine of its own, compiled and in CPython, side by side."""

from __future__ import annotations

import ast
import json
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from simclient import AlgTwin, PyTwin

BLOCKS = Path(__file__).resolve().parents[1] / "blocks"
#: Inputs that the machine gives, by their names.
OF_MACHINE = {"period": "machine.period", "resumed": "machine.resumed"}


def ports(source: str, class_: str) -> dict[str, dict[str, str]]:
    """The four dictionaries of a class."""
    tree = ast.parse((BLOCKS / source).read_text())
    node = next(n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == class_)
    found: dict[str, dict[str, str]] = {"inputs": {}, "outputs": {}, "parameters": {}, "state": {}}
    for s in node.body:
        if isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name):
            found[s.targets[0].id] = ast.literal_eval(s.value)
    return found


class Block:
    """An instance `block` that runs in state RUN at `rate` Hz of 1000, and not in REST."""

    def __init__(
        self, folder: Path, source: str, class_: str, rate: int, sizes: dict[str, int], parameters: dict[str, Any]
    ):
        inputs = ports(source, class_)["inputs"]
        entry: dict[str, Any] = {"source": f"package://fcsl_blocks/{source}"}
        config = {
            "tick_hz": 1000,
            "initial_state": "RUN",
            "algorithms": {class_: entry | ({"sizes": sizes} if sizes else {})},
            "instances": {"block": {"algorithm": class_, "parameters": parameters}},
            "connections": [{"from": OF_MACHINE[n], "to": f"block.{n}"} for n in inputs if n in OF_MACHINE],
            "states": {"RUN": {"schedule": {"block": rate}}, "REST": {"schedule": {}}},
            "transitions": [],
        }
        path = folder / "one_block.json"
        path.write_text(json.dumps(config))
        self.native, self.python = AlgTwin.from_config(path), PyTwin.from_config(path)
        self.ticks, self.outputs = 1000 // rate, list(ports(source, class_)["outputs"])

    def step(self, **inputs: Any) -> dict[str, Any]:
        """One run with these inputs: the outputs, and `health`. Both twins give the same bits."""
        for twin in (self.native, self.python):
            for name, value in inputs.items():
                twin.set(f"block.inputs.{name}", value)
            twin.tick(self.ticks)
        names = [*self.outputs, "health"]
        found = [{n: t.get_value(f"block.outputs.{n}") for n in names} for t in (self.native, self.python)]
        assert [bits(v) for v in found[0].values()] == [bits(v) for v in found[1].values()], found
        return found[0]

    def set(self, **parameters: Any) -> None:
        for twin in (self.native, self.python):
            for name, value in parameters.items():
                twin.set(f"block.parameters.{name}", value)

    def rest(self) -> None:
        """A tick in which the block is not scheduled; the next run is the first after a break."""
        for twin in (self.native, self.python):
            twin.set_state("REST")
            twin.tick(self.ticks)
            twin.set_state("RUN")


def bits(value: Any) -> Any:
    """For comparison: all NaN are equal, zeros keep their signs."""
    if isinstance(value, list | tuple) or hasattr(value, "tolist"):
        return [bits(v) for v in (value.tolist() if hasattr(value, "tolist") else value)]
    return ("nan" if math.isnan(value) else struct.pack("<d", value)) if isinstance(value, float) else value


@pytest.fixture
def block(tmp_path: Path) -> Callable[..., Block]:
    """block("pid.py", "Pid", rate=100, sizes={"n": 3}, kp=2.0)"""

    def make(source: str, class_: str, *, rate: int = 100, sizes: dict[str, int] | None = None, **values: Any) -> Block:
        return Block(tmp_path, source, class_, rate, sizes or {}, values)

    return make
