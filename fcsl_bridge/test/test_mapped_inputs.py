# SPDX-License-Identifier: Apache-2.0
"""Subscribed topics of messages that are not standard, and definitions other than those of the build."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bridge_harness import Domain, Listener
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

from fcsl_bridge.errors import BridgeError
from fcsl_bridge.topics import qos
from fcsl_bridge.topics.interfaces import mapped_class
from fcsl_bridge.topics.mapped_topics import Inputs
from simclient.machine_build import build_config
from simclient.run import Run, open_run

AVOID = """
class Avoid:
    inputs = {"ranges": "f32[4]", "count": "u32", "mode": "i32"}
    outputs = {"least": "f32"}

    def execute(self):
        self.least = 100.0
        for i in range(4):
            if u32(i) < self.count and self.mode == 1:
                self.least = min(self.least, self.ranges[i])
"""
MAPPED = {
    "ranges": {"type": "sensor_msgs/LaserScan", "field": "ranges", "topic": "scan"},
    "count": {"type": "sensor_msgs/LaserScan", "field": "ranges.count", "topic": "scan"},
    "mode": {"type": "std_msgs/String", "field": "data", "topic": "mode", "choices": ["manual", "auto"]},
}


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    (tmp_path / "avoid.py").write_text(AVOID)
    channels = [
        {"name": name, "id": i, "field": f"avoid.inputs.{name}", "direction": "sensor", "ros": ros}
        for i, (name, ros) in enumerate(MAPPED.items())
    ]
    machine = {
        "tick_hz": 10,
        "initial_state": "RUN",
        "algorithms": {"Avoid": {"source": "avoid.py"}},
        "instances": {"avoid": {"algorithm": "Avoid"}},
        "states": {"RUN": {"schedule": {"avoid": 10}}},
        "channels": channels,
    }
    (tmp_path / "rover.json").write_text(json.dumps(machine))
    library, name = build_config(tmp_path / "rover.json")
    opened = open_run(library, name)
    opened.attach()
    yield opened
    opened.close()


class Graph:
    """The machine's inputs, and publishers of its topics."""

    def __init__(self, listener: Listener, run: Run):
        self.listener, self.run = listener, run
        self.inputs = Inputs(listener.node, run)
        self.scan = listener.node.create_publisher(LaserScan, "/scan", qos.COMMAND)
        self.mode = listener.node.create_publisher(String, "/mode", qos.COMMAND)
        listener.until(lambda: self.scan.get_subscription_count() == self.mode.get_subscription_count() == 1)

    def send(self, ranges: list[float], mode: str) -> None:
        """Sends both, and polls until both came, taken or not."""
        before = self.came()
        self.scan.publish(LaserScan(ranges=ranges))
        self.mode.publish(String(data=mode))

        def done() -> bool:
            self.inputs.poll(self.listener.node.get_clock().now().nanoseconds, frozenset())
            return self.came() == before + 2

        self.listener.until(done)
        self.run.step(1)

    def came(self) -> int:
        reasons = ("taken", "shape", "unknown", "definition")
        counts = self.inputs.figures() | self.inputs.troubles()
        return sum(number for name, number in counts.items() if name.endswith(reasons))

    def least(self) -> float:
        field = self.run.machine.fields["avoid.outputs.least"]
        return float(np.frombuffer(self.run.read(field.offset, field.size), np.float32)[0])


def test_messages_that_are_not_standard(domain: Domain, run: Run) -> None:
    graph = Graph(domain.listener(), run)
    graph.send([3.0, 2.0], "auto")
    assert graph.least() == 2.0  # and not 0, which stands behind the end
    graph.send([5.0, 4.0, 6.0], "auto")
    assert graph.least() == 4.0
    graph.send([1.0], "other")  # none of the choices: the last one stays
    assert graph.least() == 1.0
    assert graph.inputs.troubles()["hal.mode unknown"] == 1
    graph.inputs.close()


def test_no_message_of_another_definition_is_taken(domain: Domain, run: Run) -> None:
    graph = Graph(domain.listener(), run)
    scan = graph.inputs._inputs[0]
    graph.listener.until(lambda: graph.listener.node.count_publishers("/scan") == 1)
    scan.topic = replace(scan.topic, type_hash="RIHS01_" + 64 * "0")
    scan.look_at_publishers()
    graph.send([3.0], "auto")
    assert graph.inputs.troubles()["hal.scan definition"] == 1 and graph.least() == 100.0
    graph.inputs.close()


def test_an_installed_definition_that_is_not_that_of_the_build() -> None:
    with pytest.raises(BridgeError, match="another definition than the one that the machine was compiled with"):
        mapped_class("sensor_msgs/msg/LaserScan", "RIHS01_" + 64 * "0")
