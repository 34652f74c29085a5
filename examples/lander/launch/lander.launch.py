# SPDX-License-Identifier: Apache-2.0
"""Flies the lander: simulator, controller (which records), and the viewer with rerun:=true.

    ros2 launch lander lander.launch.py record:=flight rerun:=true
    ros2 launch lander lander.launch.py sim:=package://lander/sim/dropout.sim.json seed:=3 speed:=1.0

Every other argument is one of fcsl_bridge's sil.launch.py; `--show-args` lists them.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration


def generate_launch_description():
    """The general launch file with this package's machine and simulation."""
    sil = Path(get_package_share_directory("fcsl_bridge")) / "launch" / "sil.launch.py"
    simulation = DeclareLaunchArgument(
        "sim", default_value="package://lander/sim/lander.sim.json", description="which simulation to fly"
    )
    arguments = {"machine": "lander/lander_control", "sim": LaunchConfiguration("sim")}
    include = IncludeLaunchDescription(PythonLaunchDescriptionSource(str(sil)), launch_arguments=arguments.items())
    return LaunchDescription([simulation, include])
