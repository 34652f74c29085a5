# SPDX-License-Identifier: Apache-2.0
"""Software in the loop: simulator and controller as two nodes in lock-step, on simulated time.

    ros2 launch fcsl_bridge sil.launch.py machine:=lander/lander_control sim:=package://lander/sim/lander.sim.json

The nodes also start as plain executables, see README.md.
"""

import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable, Shutdown
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from fcsl_bridge.loopback import loopback_environment

#: Parameters of each node: name, default (None: required), type, description. An empty value leaves the parameter out.
CONTROLLER = (
    ("machine", None, str, "package/machine, or the path of a machine library"),
    ("record", "", str, "new bag directory; empty: no bag"),
    ("decimate", "1", int, "the outputs of each n-th tick are published"),
)
SIMULATOR = (
    ("sim", None, str, "path of a *.sim.json, or package://<package>/<path>"),
    ("seed", "", int, "instead of the file's"),
    ("duration", "", float, "seconds of simulated time at most, instead of the file's"),
)
BOTH = (
    ("timeout_s", "5.0", float, "how long one node waits for the other's next bundle"),
    ("wait_for_subscribers", "0", int, "how many subscribers each topic needs before the first tick"),
)


def _node(context, executable, arguments, on_exit):
    given = context.launch_configurations
    typed = {name: ParameterValue(given[name], value_type=kind) for name, _, kind, _ in arguments if given[name] != ""}
    return Node(
        package="fcsl_bridge",
        executable=executable,
        namespace=given["namespace"] or None,
        parameters=[typed],
        output="screen",
        on_exit=on_exit,
    )


def _nodes(context):
    """The controller ends when the simulator tells it to; only a simulator that failed takes the launch down."""
    return [
        _node(context, "controller_node", (*CONTROLLER, *BOTH), Shutdown()),
        _node(context, "sim_node", (*SIMULATOR, *BOTH), lambda event, _: [Shutdown()] if event.returncode else []),
    ]


def generate_launch_description():
    """Arguments, environment (loopback unless the user chose otherwise), the two nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, default, _, description in (*CONTROLLER, *SIMULATOR, *BOTH)
    ]
    arguments.append(DeclareLaunchArgument("namespace", default_value="", description="ROS namespace of both nodes"))
    environment = [SetEnvironmentVariable(name, value) for name, value in loopback_environment(os.environ).items()]
    return LaunchDescription([*arguments, *environment, OpaqueFunction(function=_nodes)])
