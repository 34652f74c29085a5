# SPDX-License-Identifier: Apache-2.0
"""What `fcsl new machine NAME --package` writes besides the machine: a ROS 2 package, a simulation, launch files."""

from __future__ import annotations

#: At the end of the machine's README.md.
README = """
`sim/` has a vehicle to fly: `cart.c` is the plant, `@NAME@.sim.json` connects it with the machine.

```sh
fcsl sim sim/@NAME@.sim.json --record flight     # the simulated vehicle, recorded
```

In a colcon workspace (`src/@NAME@`), `colcon build --packages-select @NAME@` compiles the machine and generates one ROS 2 message per
instance; nodes then find it as `machine:=@NAME@/@NAME@`.

```sh
ros2 launch @NAME@ sil.launch.py rerun:=true         # the same flight in ROS 2, with the viewer
ros2 launch @NAME@ robot.launch.py record:=drive     # on the robot
```
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
install(DIRECTORY algorithms launch sim DESTINATION share/${PROJECT_NAME} PATTERN __pycache__ EXCLUDE)

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
  <!-- launch/ -->
  <exec_depend>fcsl_bridge</exec_depend>
  <exec_depend>ros2launch</exec_depend>

  <test_depend>ament_cmake_pytest</test_depend>
  <test_depend>fcsl_sim</test_depend>
  <test_depend>python3-pytest</test_depend>
  <test_depend>simclient</test_depend>

  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

_PLANT = """/* A cart on rails, pushed by a motor and by the wind:
 *
 *   x' = v,    v' = (force + push - friction v) / mass
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct { double force; } inputs;
    struct { double mass, friction, push; } parameters;
    struct { double position, speed; } state; /* integrated */
    struct { double position, speed; } outputs;
} cart_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const cart_t *c = self;
    (void)context;
    return c->parameters.mass > 0.0 ? NULL : "parameters.mass must be positive";
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const cart_t *c = self;
    (void)t;
    dx[0] = x[1];
    dx[1] = (c->inputs.force + c->parameters.push - c->parameters.friction * x[1]) / c->parameters.mass;
}

static void output(void *self, double t, const double *x)
{
    cart_t *c = self;
    (void)t;
    c->outputs.position = x[0];
    c->outputs.speed = x[1];
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(cart_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.force, "N", "of the motor"),
    FIELD(PARAMETER, parameters.mass, "kg", ""),
    FIELD(PARAMETER, parameters.friction, "N*s/m", ""),
    FIELD(PARAMETER, parameters.push, "N", "of the wind"),
    FIELD(OUTPUT, outputs.position, "m", ""),
    FIELD(OUTPUT, outputs.speed, "m/s", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "cart", .doc = "a cart on rails",
    .fields = fields, .field_count = sizeof fields / sizeof *fields, .size = sizeof(cart_t), .align = _Alignof(cart_t),
    .continuous_offset = offsetof(cart_t, state), .continuous_count = 2, .sampled_offset = FCSL_NO_OFFSET,
    .init = init, .derivative = derivative, .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
"""

_SIMULATION = """{
  "controller": {"machine": "../@NAME@.json"},
  "seed": 1,
  "duration": 20.0,
  "integrator": {"method": "rk4", "hz": 1000},
  "models": {"cart": {"source": "cart.c"}, "sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"}},
  "instances": {
    "plant": {"model": "cart", "parameters": {"mass": 1.0, "friction": 0.2, "push": 0.0}},
    "ruler": {"model": "sensor", "parameters": {"bias": 0.0, "sigma": 0.01, "dropout": false}}
  },
  "connections": [
    {"from": "plant.position", "to": "ruler.truth"},
    {"from": "ruler.value", "to": "controller.position"},
    {"from": "plant.speed", "to": "controller.speed"},
    {"from": "controller.command", "to": "plant.force"}
  ],
  "rates": {"ruler": 100},
  "events": [{"at_s": 10.0, "set": "plant.parameters.push", "value": 0.5}],
  "views": {
    "panels": [
      {"title": "position", "truth": ["plant.outputs.position"], "measured": ["sensors.outputs.position"]},
      {"title": "force", "command": ["controller.outputs.command"]}
    ],
    "body": {"shape": "rover", "position": ["plant.outputs.position", 0, 0]}
  }
}
"""

_FLIGHT_TEST = '''"""The machine on its simulated vehicle."""

import json
import subprocess
from pathlib import Path

import pytest

SIM = Path(__file__).parents[1] / "sim" / "@NAME@.sim.json"


def fly(*options):
    """The summary of a flight."""
    line = ["fcsl", "sim", str(SIM), "--json", *options]
    return json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout)


def test_it_stands_on_its_target():
    assert fly("--duration", "10")["truth"]["plant.outputs.position"] == pytest.approx(1.0, abs=0.1)


def test_the_wind_pushes_it_by_force_over_gain():
    assert fly()["truth"]["plant.outputs.position"] == pytest.approx(1.25, abs=0.1)
'''

_SIL_LAUNCH = '''"""Flies @NAME@ in simulation: simulator, controller, and the viewer with rerun:=true.

    ros2 launch @NAME@ sil.launch.py record:=flight rerun:=true

The other arguments are those of fcsl_bridge's sil.launch.py; `--show-args` lists them.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource


def generate_launch_description():
    sil = Path(get_package_share_directory("fcsl_bridge")) / "launch" / "sil.launch.py"
    given = {"machine": "@NAME@/@NAME@", "sim": "package://@NAME@/sim/@NAME@.sim.json"}
    return LaunchDescription(
        [IncludeLaunchDescription(PythonLaunchDescriptionSource(str(sil)), launch_arguments=given.items())]
    )
'''

_ROBOT_LAUNCH = '''"""Runs @NAME@ on a robot: it ticks in real time, reads `odom` and commands `cmd_wrench`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description():
    bag = ParameterValue(LaunchConfiguration("record"), value_type=str)
    controller = Node(
        package="fcsl_bridge",
        executable="controller_node",
        parameters=[{"machine": "@NAME@/@NAME@", "mode": "realtime", "record": bag}],
        # Without this, the node talks to nodes of its own computer alone.
        additional_env={"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"},
        output="screen",
    )
    record = DeclareLaunchArgument("record", default_value="", description="new bag directory; empty: no bag")
    return LaunchDescription([record, controller])
'''


#: Texts by path; @NAME@ stands for the machine's name.
FILES = {
    "CMakeLists.txt": _CMAKE,
    "package.xml": _PACKAGE,
    "sim/cart.c": _PLANT,
    "sim/@NAME@.sim.json": _SIMULATION,
    "test/test_@NAME@_flight.py": _FLIGHT_TEST,
    "launch/sil.launch.py": _SIL_LAUNCH,
    "launch/robot.launch.py": _ROBOT_LAUNCH,
}
