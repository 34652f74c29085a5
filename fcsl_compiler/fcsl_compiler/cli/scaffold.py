# SPDX-License-Identifier: Apache-2.0
"""Files that `fcsl new` writes. They compile with --strict, and their test passes."""

from __future__ import annotations

from pathlib import Path

from ..base.usage_error import UsageError
from ..check.scope import LANGUAGE_NAMES
from ..parse.machine_files import is_machine_name
from ..parse.parts import RESERVED_INSTANCES
from . import scaffold_package
from .verbs import MACHINE_SCHEMA

_SENSORS = '''class Sensors:
    """A source block: its outputs are written by the host, a test or a driver."""

    outputs = {
        "position": "f64 m",  # measured
        "speed": "f64 m/s",
    }

    def execute(self):
        pass
'''

_CONTROLLER = '''from fcsl_builtins import clamp


class Controller:
    """Proportional-derivative law within the actuator's limit.

    command = gain (target - position) - damping speed
    """

    inputs = {"position": "f64 m", "speed": "f64 m/s"}
    outputs = {"command": "f64 N"}  # positive towards larger positions
    parameters = {
        "target": "f64 m",
        "gain": "f64 N/m in 0..",
        "damping": "f64 N*s/m in 0..",
        "limit": "f64 N in 0..",
    }

    def execute(self):
        wanted = self.gain * (self.target - self.position) - self.damping * self.speed
        self.command = clamp(wanted, -self.limit, self.limit)
'''

_MACHINE = """{
  "$schema": "machine.schema.json",
  "tick_hz": 100,
  "initial_state": "RUN",
  "nan": "fail",
  "algorithms": {
    "Sensors": {"source": "algorithms/sensors.py"},
    "Controller": {"source": "algorithms/controller.py"}
  },
  "instances": {
    "sensors": {"algorithm": "Sensors"},
    "controller": {
      "algorithm": "Controller",
      "parameters": {"target": 1.0, "gain": 2.0, "damping": 0.5, "limit": 10.0}
    }
  },
  "connections": [
    {"from": "sensors.position", "to": "controller.position"},
    {"from": "sensors.speed", "to": "controller.speed"}
  ],
  "states": {"RUN": {"schedule": {"sensors": 100, "controller": 100}}},
  "transitions": [],
  "channels": [
    {
      "name": "position", "id": 1, "field": "sensors.outputs.position", "direction": "sensor", "max_age_ticks": 10,
      "ros": {"type": "nav_msgs/Odometry", "field": "pose.pose.position.x", "topic": "odom"}
    },
    {
      "name": "speed", "id": 2, "field": "sensors.outputs.speed", "direction": "sensor", "max_age_ticks": 10,
      "ros": {"type": "nav_msgs/Odometry", "field": "twist.twist.linear.x", "topic": "odom"}
    },
    {
      "name": "command", "id": 3, "field": "controller.outputs.command", "direction": "actuator",
      "ros": {"type": "geometry_msgs/Wrench", "field": "force.x", "topic": "cmd_wrench"}
    }
  ]
}
"""

_MACHINE_TEST = '''"""The machine, stepped tick by tick."""

import pytest
from simclient import AlgTwin


@pytest.fixture
def twin():
    with AlgTwin.from_config("../@NAME@.json") as twin:
        yield twin


def command(twin, position, speed):
    twin.set("sensors.outputs.position", position)
    twin.set("sensors.outputs.speed", speed)
    twin.tick()
    return twin.get_value("controller.outputs.command")


def test_it_pulls_towards_the_target(twin):
    assert command(twin, 0.0, 0.0) == 2.0
    assert command(twin, 3.0, 0.0) == -4.0


def test_it_damps(twin):
    assert command(twin, 1.0, 4.0) == -2.0


def test_the_command_stays_within_the_limit(twin):
    assert command(twin, -100.0, 0.0) == 10.0
'''

#: What an agent that writes code needs to know, in the folder that it works in.
_AGENTS = Path(__file__).with_name("agents.md")

_PYRIGHT = """{
  "ignore": ["algorithms"]
}
"""

_README = """# @NAME@

Next: change `algorithms/*.py` and `@NAME@.json` step by step, with

```sh
fcsl check --strict @NAME@.json     # errors, with reasons and corrections
fcsl test                          # the compiled machine, tick by tick
fcsl graph @NAME@.json -o @NAME@.svg     # a picture of it
fcsl new algorithm NAME        # another algorithm, with a test
fcsl new plant NAME            # a vehicle to simulate, connected with it, with a test
```

With `machine.schema.json`, editors complete and check `@NAME@.json`; `fcsl schema > machine.schema.json` updates it.
`pyrightconfig.json` excludes `algorithms` from pyright and Pylance, which do not support the ports of algorithms. mypy supports them with
the plugin `fcsl_builtins.mypy_plugin`.
"""

_ALGORITHM = '''from fcsl_builtins import clamp


class @CLASS@:
    """Limits how fast a value may change: by at most `rate` per second."""

    inputs = {
        "dt": "f64 s",  # since the last execution
        "wanted": "f64",
    }
    outputs = {"value": "f64"}  # follows `wanted`
    parameters = {"rate": "f64 1/s in 0.."}

    def execute(self):
        step = self.rate * self.dt
        self.value += clamp(self.wanted - self.value, -step, step)
'''

_BENCH = """{
  "description": "A test bench: @NAME@ alone, its inputs written by test/test_@NAME@.py.",
  "tick_hz": 10,
  "initial_state": "RUN",
  "nan": "fail",
  "algorithms": {"@CLASS@": {"source": "algorithms/@NAME@.py"}},
  "instances": {"@NAME@": {"algorithm": "@CLASS@", "parameters": {"rate": 2.0}, "inputs": {"wanted": 0.0}}},
  "connections": [{"from": "machine.dt", "to": "@NAME@.dt"}],
  "states": {"RUN": {"schedule": {"@NAME@": 10}}}
}
"""

_ALGORITHM_TEST = '''"""@NAME@ on its bench."""

import pytest
from simclient import AlgTwin


@pytest.fixture
def twin():
    with AlgTwin.from_config("../@NAME@_bench.json") as twin:
        yield twin


def test_it_follows_at_its_rate(twin):
    twin.set("@NAME@.inputs.wanted", 1.0)
    twin.tick()
    assert twin.get_value("@NAME@.outputs.value") == pytest.approx(0.2)
    twin.tick(10)
    assert twin.get_value("@NAME@.outputs.value") == pytest.approx(1.0)


def test_a_small_change_passes_at_once(twin):
    twin.set("@NAME@.inputs.wanted", -0.125)
    twin.tick()
    assert twin.get_value("@NAME@.outputs.value") == -0.125
'''


def machine_files(name: str, package: bool) -> dict[Path, str]:
    """Texts by path, all below the folder `name`. Raises UsageError if `name` is not a valid machine name."""
    _check(name, name)
    readme = _README + (scaffold_package.README if package else "")
    texts = {
        f"{name}.json": _MACHINE,
        "machine.schema.json": MACHINE_SCHEMA.read_text(),
        "algorithms/sensors.py": _SENSORS,
        "algorithms/controller.py": _CONTROLLER,
        f"test/test_{name}.py": _MACHINE_TEST,
        "pyrightconfig.json": _PYRIGHT,
        "README.md": readme,
        "AGENTS.md": _AGENTS.read_text(encoding="utf-8"),
    }
    if package:
        texts |= scaffold_package.FILES
    folder = Path(name)
    return {folder / _named(file, name): _named(text, name) for file, text in texts.items()}


def algorithm_files(name: str) -> dict[Path, str]:
    """Texts by path: the algorithm, a machine as its test bench, and a test. Raises UsageError if the name is
    invalid."""
    _check(name, f"{name}_bench")
    if name in RESERVED_INSTANCES:
        raise UsageError(f"`{name}` is reserved: no instance could have the name of the algorithm")
    if _class_name(name) in LANGUAGE_NAMES:
        raise UsageError(f"`{_class_name(name)}` is a name of the language: no class can have it")
    texts = {f"algorithms/{name}.py": _ALGORITHM, f"{name}_bench.json": _BENCH, f"test/test_{name}.py": _ALGORITHM_TEST}
    return {Path(file): _named(text, name) for file, text in texts.items()}


def _check(name: str, machine: str) -> None:
    if not is_machine_name(machine):
        raise UsageError(f"`{name}` is not a valid name: lower_snake_case, not a name of C")


def _named(text: str, name: str) -> str:
    return text.replace("@NAME@", name).replace("@CLASS@", _class_name(name))


def _class_name(name: str) -> str:
    """Class name of an algorithm: `rate_damper` → `RateDamper`."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))
