# SPDX-License-Identifier: Apache-2.0
"""What `fcslc new` writes: files that compile under --strict and whose test passes, to be changed from there."""

from __future__ import annotations

from pathlib import Path

from .config import RESERVED_INSTANCES
from .parse import is_machine_name
from .usage import UsageError

#: JSON Schema of the machine JSON.
SCHEMA = Path(__file__).with_name("machine.schema.json")

_SENSORS = '''"""A source block: its outputs are written by the host, a test or a driver."""


class Outputs:
    position: "f64 m"  # measured
    speed: "f64 m/s"


def execute() -> None:
    pass
'''

_CONTROLLER = '''"""Proportional-derivative law: command = gain (target - position) - damping speed, within the actuator's limit."""

from fcsl_builtins import clamp


class Inputs:
    position: "f64 m"
    speed: "f64 m/s"


class Parameters:
    target: "f64 m"
    gain: "f64 N/m"
    damping: "f64 N*s/m"
    limit: "f64 N"


class Outputs:
    command: "f64 N"  # positive towards larger positions


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.command = clamp(p.gain * (p.target - u.position) - p.damping * u.speed, -p.limit, p.limit)
'''

_MACHINE = """{
  "$schema": "machine.schema.json",
  "tick_hz": 100,
  "initial_state": "RUN",
  "algorithms": {
    "sensors": {"source": "algorithms/sensors.py"},
    "controller": {"source": "algorithms/controller.py"}
  },
  "instances": {
    "sensors": {"algorithm": "sensors"},
    "controller": {
      "algorithm": "controller",
      "parameters": {"target": 1.0, "gain": 2.0, "damping": 0.5, "limit": 10.0}
    }
  },
  "connections": [
    {"from": "sensors.outputs.position", "to": "controller.inputs.position"},
    {"from": "sensors.outputs.speed", "to": "controller.inputs.speed"}
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

_README = """# @NAME@

Next: change `algorithms/*.py` and `@NAME@.json` step by step, with

```sh
fcslc check --strict @NAME@.json     # what is wrong, why, and what to write instead
python3 -m pytest test          # the compiled machine, tick by tick
fcslc graph @NAME@.json -o @NAME@.svg     # a picture of it
fcslc new algorithm NAME        # one more algorithm, with a test of its own
```

`machine.schema.json` lets editors complete and check `@NAME@.json`; `fcslc schema > machine.schema.json` renews it.
"""

_README_PACKAGE = """
In a colcon workspace (`src/@NAME@`), `colcon build --packages-select @NAME@` compiles the machine and generates one ROS 2 message per
instance; nodes then find it as `machine:=@NAME@/@NAME@`.
"""

_CMAKE = """cmake_minimum_required(VERSION 3.22)
project(@NAME@ C)

find_package(ament_cmake REQUIRED)
find_package(fcsl_compiler REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(std_msgs REQUIRED)

# The machine as a library that nodes find as `machine:=@NAME@/@NAME@`, and one ROS 2 message per instance.
fcsl_add_machine(@NAME@_machines @NAME@.json STRICT)
fcsl_generate_interfaces()

install(FILES @NAME@.json DESTINATION share/${PROJECT_NAME})
install(DIRECTORY algorithms DESTINATION share/${PROJECT_NAME} PATTERN __pycache__ EXCLUDE)

if(BUILD_TESTING)
  find_package(ament_cmake_pytest REQUIRED)
  ament_add_pytest_test(pytest test TIMEOUT 120)
endif()

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""

_PACKAGE = """<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" schematypens="http://www.w3.org/2001/XMLSchema"?>
<package format="3">
  <name>@NAME@</name>
  <version>0.1.0</version>
  <description>The machine @NAME@.</description>
  <maintainer email="you@example.invalid">you</maintainer>
  <license>Apache-2.0</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>

  <depend>fcsl_compiler</depend>
  <depend>std_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>

  <test_depend>ament_cmake_pytest</test_depend>
  <test_depend>python3-pytest</test_depend>
  <test_depend>fcsl_runtime</test_depend>

  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

_ALGORITHM = '''"""Limits how fast a value may change: y follows u by at most `rate` per second."""

from fcsl_builtins import clamp


class Inputs:
    dt: "f64 s"  # since the last execution
    value: f64


class Parameters:
    rate: "f64 1/s"


class Outputs:
    value: f64


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    step = p.rate * u.dt
    y.value += clamp(u.value - y.value, -step, step)
'''

_BENCH = """{
  "description": "A test bench: @NAME@ alone, its inputs written by test/test_@NAME@.py.",
  "tick_hz": 10,
  "initial_state": "RUN",
  "algorithms": {"@NAME@": {"source": "algorithms/@NAME@.py"}},
  "instances": {"@NAME@": {"algorithm": "@NAME@", "parameters": {"rate": 2.0}, "inputs": {"value": 0.0}}},
  "connections": [{"from": "machine.dt", "to": "@NAME@.inputs.dt"}],
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
    twin.set("@NAME@.inputs.value", 1.0)
    twin.tick()
    assert twin.get_value("@NAME@.outputs.value") == pytest.approx(0.2)
    twin.tick(10)
    assert twin.get_value("@NAME@.outputs.value") == pytest.approx(1.0)


def test_a_small_change_passes_at_once(twin):
    twin.set("@NAME@.inputs.value", -0.125)
    twin.tick()
    assert twin.get_value("@NAME@.outputs.value") == -0.125
'''


def machine_files(name: str, package: bool) -> dict[Path, str]:
    """Texts by path, all below the folder `name`. Raises UsageError for a name that no machine can have."""
    _check(name, name)
    readme = _README + (_README_PACKAGE if package else "")
    texts = {
        f"{name}.json": _MACHINE,
        "machine.schema.json": SCHEMA.read_text(),
        "algorithms/sensors.py": _SENSORS,
        "algorithms/controller.py": _CONTROLLER,
        f"test/test_{name}.py": _MACHINE_TEST,
        "README.md": readme,
    }
    if package:
        texts |= {"CMakeLists.txt": _CMAKE, "package.xml": _PACKAGE}
    folder = Path(name)
    return {folder / file: _named(text, name) for file, text in texts.items()}


def algorithm_files(name: str) -> dict[Path, str]:
    """Texts by path: the algorithm, a machine that is its test bench, and a test. Raises UsageError for a wrong name."""
    _check(name, f"{name}_bench")
    if name in RESERVED_INSTANCES:
        raise UsageError(f"`{name}` is reserved: no instance could have the algorithm's name")
    texts = {f"algorithms/{name}.py": _ALGORITHM, f"{name}_bench.json": _BENCH, f"test/test_{name}.py": _ALGORITHM_TEST}
    return {Path(file): _named(text, name) for file, text in texts.items()}


def _check(name: str, machine: str) -> None:
    if not is_machine_name(machine):
        raise UsageError(f"`{name}` cannot be the name: lower_snake_case, and no name of C")


def _named(text: str, name: str) -> str:
    return text.replace("@NAME@", name)
