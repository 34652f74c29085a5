# SPDX-License-Identifier: Apache-2.0
"""Every diagnostic code: its title, why the rule exists, a wrong example and the right one.

One table, read by `fcslc explain`, by the SARIF report and by docs/diagnostics.md (generated). The tests compile every
example, and demand that the table and the sources name the same codes. Rows: codes_machine.py and codes_algorithm.py.
"""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass
from enum import Enum


class Kind(Enum):
    """What an example is a piece of."""

    BODY = "statements of the example algorithm's `execute`"
    FILE = "an algorithm file; where it has no `execute`, an empty one is understood"
    JSON = "members of the example machine, in place of those of the same name"
    STRICT = "members of the example machine, checked with --strict"
    TEXT = "the whole text of a machine JSON"
    COMMAND = "a command"


@dataclass(frozen=True)
class Code:
    title: str
    explanation: str
    kind: Kind
    wrong: str
    right: str


#: The machine that JSON examples change, and whose control.py BODY examples stand in.
EXAMPLE_MACHINE = """\
{
  "tick_hz": 100,
  "initial_state": "COAST",
  "structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s"}},
  "algorithms": {"nav": {"source": "nav.py"}, "control": {"source": "control.py"}},
  "instances": {
    "nav": {"algorithm": "nav"},
    "control": {"algorithm": "control", "parameters": {"gain": 2.0}}
  },
  "connections": [{"from": "nav.outputs.speed", "to": "control.inputs.speed"}],
  "states": {
    "COAST": {"schedule": {"nav": 100, "control": 50}},
    "SAFE": {"schedule": {"nav": 10}}
  },
  "transitions": [
    {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}
  ],
  "requests": ["ABORT"]
}
"""

EXAMPLE_NAV = '''\
"""Where the vehicle is."""


class Inputs:
    pressure: "f64 Pa"


class Outputs:
    altitude: "f64 m"
    speed: "f64 m/s"
    rate: "f64[3] rad/s"
    mode: i32


def execute(u: Inputs, y: Outputs) -> None:
    y.altitude = (101325.0 - u.pressure) / 12.0
'''

EXAMPLE_CONTROL = '''\
"""What the vehicle does about it."""


class Inputs:
    speed: "f64 m/s"
    rate: "f64[3] rad/s"
    mode: i32
    armed: bool


class Parameters:
    gain: "f64 N*s/m"


class Outputs:
    force: "f64 N"
    torque: "f64[3] N*m"
    steps: i32
    ready: bool


class State:
    integral: "f64 m"
    goal: "Goal"


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    y.force = -p.gain * u.speed
'''

_RECORDS = {"Inputs": "u", "Parameters": "p", "Outputs": "y", "State": "x"}
_WIDTH = 100


def table() -> dict[str, Code]:
    """Every code, sorted: errors, then warnings."""
    from .codes_algorithm import ALGORITHM_CODES
    from .codes_machine import MACHINE_CODES

    return dict(sorted({**MACHINE_CODES, **ALGORITHM_CODES}.items()))


def explain(code: str) -> str:
    """The page of one code. Raises KeyError."""
    row = table()[code]
    parts = [
        f"{code}: {row.title}",
        textwrap.fill(row.explanation, _WIDTH),
        "Wrong:\n\n" + textwrap.indent(row.wrong, "    "),
        "Right:\n\n" + textwrap.indent(row.right, "    "),
    ]
    ports = _ports_used(row)
    if ports:
        parts.append(f"where {ports}.")
    return "\n\n".join(parts) + "\n"


def overview() -> str:
    """One line for every code."""
    return "".join(f"{code}  {row.title}\n" for code, row in table().items())


def _ports_used(row: Code) -> str:
    """The types of the ports that a piece of `execute` mentions, as `u.speed is f64 m/s`."""
    if row.kind is not Kind.BODY:
        return ""
    declared: dict[str, str] = {}
    prefix = ""
    for line in EXAMPLE_CONTROL.splitlines():
        head = re.match(r"class (\w+):", line)
        port = re.match(r'    (\w+): "?([^"]+)"?$', line)
        if head:
            prefix = _RECORDS[head.group(1)]
        elif port:
            declared[f"{prefix}.{port.group(1)}"] = port.group(2)
    used = dict.fromkeys(re.findall(r"\b[upyx]\.\w+", f"{row.wrong}\n{row.right}"))
    return ", ".join(f"{name} is {declared[name]}" for name in used if name in declared)
