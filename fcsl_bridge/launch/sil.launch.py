# SPDX-License-Identifier: Apache-2.0
"""Software in the loop: simulator, controller and, if wanted, viewer, in lock-step on simulated time.

    ros2 launch fcsl_bridge sil.launch.py machine:=lander/lander_control sim:=package://lander/sim/lander.sim.json

A package includes this file and gives `machine` and `sim` (examples/lander/launch). The nodes also start as plain
executables, see docs/guide/ros2.md.
"""

import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable, Shutdown
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from fcsl_bridge.loopback import loopback_environment

#: Parameters of each node: name, default (None: required), type, description. An empty value leaves the parameter out.
MACHINE = (("machine", None, str, "package/machine, or the path of a machine library"),)
CONTROLLER = (
    *MACHINE,
    ("record", "", str, "new bag directory; empty: no bag; of several vehicles <record>_<vehicle>"),
    ("allow_set_state", "false", bool, "whether the controller's ~/set_state and ~/restore may be used"),
    ("checkpoints", "", str, "an existing folder for the files of ~/save and ~/restore; empty: no files"),
)
SIMULATOR = (
    ("sim", None, str, "path of a *.sim.json, or package://<package>/<path>"),
    ("seed", "", int, "instead of the file's"),
    ("duration", "", float, "seconds of simulated time at most, instead of the file's"),
    ("speed", "0.0", float, "simulated seconds per second at most; 0: as fast as possible"),
    ("paused", "false", bool, "whether it begins paused"),
)
BOTH = (
    ("decimate", "1", int, "outputs and truth of each n-th tick are published"),
    ("timeout_s", "5.0", float, "how long one node waits for the other's next bundle"),
    ("start_timeout_s", "60.0", float, "how long for its first one"),
    ("wait_for_subscribers", "0", int, "how many subscribers each topic needs before the first tick"),
)


#: What an argument of each type takes, for messages.
WANTED = {str: "text", bool: "`true` or `false`", int: "a whole number", float: "a number"}


def _typed(name, text, kind):
    """The parameter's value. launch_ros takes a value of the very type; of plain text it would guess one."""
    try:
        value = {"true": True, "false": False}[text.lower()] if kind is bool else kind(text)
    except (KeyError, ValueError):
        raise RuntimeError(f"launch argument `{name}` takes {WANTED[kind]}, got `{text}`") from None
    return ParameterValue(value, value_type=kind)


def _node(given, executable, options, **more):
    """One node; `more` overrides and extends the parameters in `given`."""
    given = given | more.pop("replaced", {})
    typed = {name: _typed(name, given[name], kind) for name, _, kind, _ in options if given[name] != ""}
    typed |= more.pop("parameters", {})
    return Node(package="fcsl_bridge", executable=executable, parameters=[typed], output="screen", **more)


class _Controllers:
    """Shuts the launch down when every controller has ended (the simulator ends them), or when one has failed."""

    def __init__(self, count):
        self.left = count

    def ended(self, event, _):
        self.left -= 1
        return [Shutdown()] if event.returncode or not self.left else []


def _nodes(context):
    given = dict(context.launch_configurations)
    vehicles = [name.strip() for name in given["vehicles"].split(",") if name.strip()]
    base = given["namespace"].strip("/")
    controllers = _Controllers(max(1, len(vehicles)))
    nodes = []
    for vehicle in vehicles or [""]:
        name_space = "/".join(part for part in (base, vehicle) if part) or None
        record = f"{given['record']}_{vehicle.replace('/', '_')}" if vehicle and given["record"] else given["record"]
        replaced = {"record": record}
        more = {"namespace": name_space, "on_exit": controllers.ended, "replaced": replaced}
        nodes.append(_node(given, "controller_node", (*CONTROLLER, *BOTH), **more))
        if given["rerun"] == "true":
            nodes.append(_node(given, "rerun_node", MACHINE, namespace=name_space))
    several = {"vehicles": vehicles} if vehicles else {}
    failed = {"on_exit": lambda event, _: [Shutdown()] if event.returncode else []}
    nodes.append(_node(given, "sim_node", (*SIMULATOR, *BOTH), namespace=base or None, parameters=several, **failed))
    return nodes


def generate_launch_description():
    """Arguments, environment (loopback unless the user chose otherwise), the nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, default, _, description in (*CONTROLLER, *SIMULATOR, *BOTH)
    ]
    arguments += [
        DeclareLaunchArgument("namespace", default_value="", description="ROS namespace of all nodes"),
        DeclareLaunchArgument("vehicles", default_value="", description="several vehicles: one,two (namespaces)"),
        DeclareLaunchArgument(
            "rerun", default_value="false", choices=["true", "false"], description="whether to open the viewer"
        ),
    ]
    environment = [SetEnvironmentVariable(name, value) for name, value in loopback_environment(os.environ).items()]
    return LaunchDescription([*arguments, *environment, OpaqueFunction(function=_nodes)])
