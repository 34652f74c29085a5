# SPDX-License-Identifier: Apache-2.0
"""A flight of the ROS 2 nodes, under launch_testing. `colcon test` runs it where launch_testing_ament_cmake is installed:

launch_test examples/lander/test/flight.launch.py
"""

import tempfile
import unittest
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

import launch_testing
import launch_testing.actions
import launch_testing.asserts
import launch_testing.markers
from launch import LaunchDescription
from launch_ros.actions import Node

MACHINE = Path(__file__).resolve().parents[1] / "fc" / "lander_control.json"
#: For the slowest computer; a flight takes a second.
LIMIT_S = 120.0
#: The domain and the folder of the bag, until the process ends.
held = ExitStack()


@unittest.skipIf(find_spec("fcsl_bridge") is None, "the nodes are in fcsl_bridge, which is not built")
@launch_testing.markers.keep_alive
def generate_test_description():
    from fcsl_bridge.domain import own_domain

    environment = {"ROS_DOMAIN_ID": str(held.enter_context(own_domain()))}  # away from whatever runs on this computer
    bag = Path(held.enter_context(tempfile.TemporaryDirectory())) / "bag"

    def node(executable, **parameters):
        more = {"parameters": [parameters], "additional_env": environment, "output": "screen"}
        return Node(package="fcsl_bridge", executable=executable, **more)

    controller = node("controller_node", machine="lander/lander_control", record=str(bag), timeout_s=LIMIT_S)
    simulator = node("sim_node", sim="package://lander/sim/lander.sim.json", seed=7, timeout_s=LIMIT_S)
    description = LaunchDescription([controller, simulator, launch_testing.actions.ReadyToTest()])
    return description, {"controller": controller, "simulator": simulator, "bag": bag}


class Flight(unittest.TestCase):
    def test_it_climbs_coasts_and_lands(self, proc_info, proc_output, controller, simulator):
        for change in ("ASCENT -> COAST", "COAST -> DESCENT"):
            proc_output.assertWaitFor(change, process=controller, timeout=LIMIT_S)
        proc_output.assertWaitFor("the stop condition held", process=simulator, stream="stdout", timeout=LIMIT_S)
        for process in (simulator, controller):
            proc_info.assertWaitForShutdown(process=process, timeout=LIMIT_S)


@launch_testing.post_shutdown_test()
class Afterwards(unittest.TestCase):
    def test_both_nodes_ended_well(self, proc_info):
        launch_testing.asserts.assertExitCodes(proc_info)

    def test_the_bag_replays_bit_for_bit(self, bag):
        from simclient.replay import replay

        verdict = replay(bag, config=str(MACHINE))
        self.assertTrue(verdict.identical, str(verdict))
