# SPDX-License-Identifier: Apache-2.0
"""Every diagnostic code: its title, why the rule exists, a wrong example and the right one.

One table, read by `fcslc explain`, by the SARIF report and by docs/diagnostics.md (generated). The tests compile every
example, and demand that the table and the sources name the same codes. Rows: codes_machine.py, codes_ros.py and codes_algorithm.py.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from .diagnostics import nearest


class Kind(Enum):
    """What an example is a piece of."""

    BODY = "statements of the example algorithm's `execute`"
    FILE = "an algorithm file; where it has no class, one without ports is understood"
    SIMULATION = "members of a simulation"
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
  "algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}},
  "instances": {
    "nav": {"algorithm": "Nav"},
    "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}
  },
  "connections": [{"from": "nav.speed", "to": "control.speed"}],
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
class Nav:
    """Where the vehicle is."""

    inputs = {"pressure": "f64 Pa"}
    outputs = {
        "altitude": "f64 m",
        "speed": "f64 m/s",
        "rate": "f64[3] rad/s",
        "mode": "i32",
    }

    def execute(self):
        climb = (101325.0 - self.pressure) / 12.0 - self.altitude
        self.altitude += climb
        self.speed = 100.0 * climb
        self.rate = [0.0, 0.0, self.speed]
        self.mode = 1 if self.speed > 0.0 else 0
'''

EXAMPLE_CONTROL = '''\
class Control:
    """What the vehicle does about it."""

    inputs = {
        "speed": "f64 m/s",
        "rate": "f64[3] rad/s",
        "mode": "i32",
        "armed": "bool",
        "height": "f64 m",
        "dt": "f64 s",
    }
    parameters = {"gain": "f64 N*s/m"}
    outputs = {
        "force": "f64 N",
        "torque": "f64[3] N*m",
        "steps": "i32",
        "ready": "bool",
        "transition_request": "TransitionRequest",
    }
    state = {"integral": "f64 m", "goal": "Goal"}

    def execute(self):
        self.goal.speed = 0.0 if self.armed else self.speed
        self.integral += (self.goal.speed - self.speed) * self.dt
        self.force = self.gain * (self.goal.speed - self.speed) + self.integral
        self.torque = self.rate * -0.5
        self.steps = self.mode
        self.ready = self.height > 0.0
        if not self.ready:
            self.transition_request = "ABORT"
'''

EXAMPLE_PILOT = '''\
class Pilot:
    """Requests what its parameter says."""

    parameters = {"on_done": "TransitionRequest"}
    outputs = {"transition_request": "TransitionRequest"}

    def execute(self):
        self.transition_request = self.on_done
'''

_WIDTH = 100


def table() -> dict[str, Code]:
    """Every code, sorted: errors, then warnings."""
    from .codes_algorithm import ALGORITHM_CODES
    from .codes_machine import MACHINE_CODES
    from .codes_ros import ROS_CODES

    return dict(sorted({**MACHINE_CODES, **ROS_CODES, **ALGORITHM_CODES}.items()))


class UnknownCode(ValueError):
    """A code that is not in the table; str() says so, and which was meant."""


def pages(codes: Sequence[str], rows: Mapping[str, Code], elsewhere: str) -> str:
    """The pages of these codes; without any, one line for every row. Raises UnknownCode.

    elsewhere: what explains the codes of the other program.
    """
    for code in map(str.upper, codes):
        if code not in rows:
            other = bool(re.fullmatch(r"[EW]\d{3}", code)) and code[1] == "8" and "E801" not in rows
            other = other or (code in table() and rows.keys() != table().keys())
            hint = f"`{elsewhere} {code}` knows it" if other else nearest(code[:8].replace("O", "0"), list(rows))
            raise UnknownCode(f"there is no diagnostic `{code[:80]}`; {hint or 'without a code, `explain` lists all'}")
    return "\n".join(explain(code.upper(), rows) for code in codes) if codes else overview(rows)


def explain(code: str, rows: Mapping[str, Code]) -> str:
    """The page of one code. Raises KeyError."""
    row = rows[code]
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


def overview(rows: Mapping[str, Code]) -> str:
    """One line for every code."""
    return "".join(f"{code}  {row.title}\n" for code, row in rows.items())


def _ports_used(row: Code) -> str:
    """The types of the ports that a piece of `execute` mentions, as `self.speed is f64 m/s`."""
    if row.kind is not Kind.BODY:
        return ""
    declared = dict(re.findall(r'"(\w+)": "([^"]+)"', EXAMPLE_CONTROL))
    used = dict.fromkeys(re.findall(r"\bself\.(\w+)", f"{row.wrong}\n{row.right}"))
    return ", ".join(f"self.{name} is {declared[name]}" for name in used if name in declared)
