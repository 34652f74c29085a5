# SPDX-License-Identifier: Apache-2.0
"""Build rules of the bridge; name, version and texts come from package.xml."""

from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = ElementTree.parse("package.xml").getroot()
name = package.findtext("name")

setup(
    name=name,
    version=package.findtext("version"),
    description=package.findtext("description"),
    license=package.findtext("license"),
    packages=find_packages(include=[name, f"{name}.*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml"]),
        (f"share/{name}/launch", glob("launch/*.launch.py")),
        (f"share/{name}/config", glob("config/*")),
    ],
    # Without this colcon runs unittest, which finds nothing.
    extras_require={"test": ["pytest"]},
    # One line per node: "sim_node = fcsl_bridge.nodes.start:sim_node" becomes install/.../lib/fcsl_bridge/sim_node.
    entry_points={
        "console_scripts": [
            "controller_node = fcsl_bridge.nodes.start:controller_node",
            "diagnostics_node = fcsl_bridge.nodes.start:diagnostics_node",
            "rerun_node = fcsl_bridge.nodes.start:rerun_node",
            "sim_node = fcsl_bridge.nodes.start:sim_node",
            "topic_count = fcsl_bridge.nodes.start:topic_count",
        ],
        # Read by ros2cli where it is installed: `ros2 fcsl VERB`.
        "ros2cli.command": ["fcsl = fcsl_bridge.client.ros2_fcsl:FcslCommand"],
        "ros2cli.extension_point": ["ros2fcsl.verb = fcsl_bridge.client.ros2_fcsl:Verb"],
        "ros2fcsl.verb": [
            "info = fcsl_bridge.client.ros2_fcsl:InfoVerb",
            "list = fcsl_bridge.client.ros2_fcsl:ListVerb",
            "replay = fcsl_bridge.client.ros2_fcsl:ReplayVerb",
            "set-state = fcsl_bridge.client.ros2_fcsl:SetStateVerb",
            "state = fcsl_bridge.client.ros2_fcsl:StateVerb",
        ],
    },
)
