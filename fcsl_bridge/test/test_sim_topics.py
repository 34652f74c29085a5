# SPDX-License-Identifier: Apache-2.0
"""Truth and sensors of a simulation as standard messages."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from bridge_harness import MACHINE, SIM, Domain, Listener, Process
from controller_client import ControllerClient
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Range

from fcsl_bridge.simulator.sim_topics import below
from fcsl_bridge.topics import qos
from fcsl_compiler.base.packages import package_share
from fcsl_msgs.msg import PlantTruth
from fcsl_msgs.srv import Step
from fcsl_sim.config import load
from fcsl_sim.native import Simulation
from simclient.library import runtime_program

#: Stamp of the last truth of a flight of one second at 100 Hz, each second tick shown.
LAST_NS = 980_000_000


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def messages_by_stamp(listener: Listener, topic: str, kind: Any) -> dict[int, Any]:
    messages = [deserialize_message(data, kind) for data in listener.received[topic]]
    return {stamp_ns(message): message for message in messages}


def test_truth_as_odometry_and_pose(domain: Domain) -> None:
    listener = domain.listener()
    kinds = {"/odom": Odometry, "/pose": PoseStamped, "/sim/truth": PlantTruth}
    for topic, kind in kinds.items():
        listener.subscribe(kind, topic, qos.STREAM)
    controller = domain.start("controller_node", machine=MACHINE, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, duration="1.0", timeout_s=60.0, paused="true", decimate=2)
    client = ControllerClient(listener, "/sim_node")
    while not all(listener.received.values()):  # until every subscription is matched
        assert client.call(Step, "step", ticks=2).success
    assert client.set(paused=False).successful
    assert (sim.finish(), controller.finish()) == (0, 0)
    listener.until(lambda: all(LAST_NS in messages_by_stamp(listener, topic, kind) for topic, kind in kinds.items()))
    found = {topic: messages_by_stamp(listener, topic, kind) for topic, kind in kinds.items()}
    common = set(found["/odom"]) & set(found["/pose"]) & set(found["/sim/truth"])
    assert LAST_NS in common
    for stamp in common:
        odom, pose, truth = (found[topic][stamp] for topic in kinds)
        plant = dict(zip(truth.name, truth.value, strict=True))
        assert odom.pose.pose.position.z == pose.pose.position.z == plant["lander.outputs.pos_z"]
        assert odom.twist.twist.linear.z == plant["lander.outputs.vel_z"]
        assert truth.tick * 10_000_000 == stamp and truth.tick % 2 == 0
        assert (odom.header.frame_id, odom.child_frame_id, pose.header.frame_id) == ("map", "base_link", "map")
        assert (odom.pose.pose.orientation.w, odom.pose.pose.position.x) == (1.0, 0.0)
    assert found["/odom"][LAST_NS].pose.pose.position.z > 0


def test_mapped_sensor_channels_are_published(domain: Domain, tmp_path: Path) -> None:
    """When the simulation samples them, with the values that the controller gets."""
    share = package_share("lander")
    for folder in ("fc", "sim"):
        shutil.copytree(share / folder, tmp_path / folder)
    machine = tmp_path / "fc" / "lander_control.json"
    content = json.loads(machine.read_text(encoding="utf-8"))
    ros = {"type": "sensor_msgs/Range", "field": "range", "topic": "altimeter", "frame": "altimeter_link"}
    content["channels"][0]["ros"] = ros
    machine.write_text(json.dumps(content), encoding="utf-8")
    listener = domain.listener()
    for kind, topic in ((Range, "/craft/altimeter"), (PlantTruth, "/craft/sim/truth"), (Clock, "/clock")):
        listener.subscribe(kind, topic, qos.STREAM)
    sim_file = tmp_path / "sim" / "lander.sim.json"
    done = subprocess.run(["fcslc", "build", machine, "-o", tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    sim = domain.start("sim_node", "-r", "__ns:=/craft", sim=sim_file, seed=7, paused="true", wait_for_subscribers=1)
    library = tmp_path / "out" / "liblander_control.so"
    address = sim_address(sim)
    domain.run([runtime_program("fcsl-fc"), library, "--hal", f"zenoh:{address}", "--namespace", "craft"])
    listener.until(lambda: listener.node.count_publishers("/craft/altimeter") == 1)
    assert ControllerClient(listener, "/craft/sim_node").set(paused=False).successful
    listener.until(lambda: bool(listener.received["/craft/altimeter"]))
    message = deserialize_message(listener.received["/craft/altimeter"][0], Range)
    config = load(sim_file, seed=7)
    with Simulation(config.plan, config.tables) as same:
        same.sense()
        assert same.sampled(0)
        measured = same.get("altimeter.outputs.value")
    assert message.header.frame_id == "altimeter_link" and stamp_ns(message) == 0
    assert message.range == pytest.approx(measured, rel=1e-6)  # a Range has a float32
    sim.signal(signal.SIGTERM)
    assert sim.finish() == 128 + signal.SIGTERM


def sim_address(sim: Process) -> str:
    sim.wait_for("waiting for a controller on ")
    return sim.out.rsplit("waiting for a controller on ", 1)[1].split()[0]


def test_topics_below_a_vehicle() -> None:
    assert [below("one", "odom"), below("", "odom"), below("one", "/odom")] == ["one/odom", "odom", "/odom"]
