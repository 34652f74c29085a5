# SPDX-License-Identifier: Apache-2.0
"""Topics of actuators while the machine is disarmed."""

from __future__ import annotations

import json
import struct
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from rclpy.duration import Duration

from fcsl_bridge.topics import mapped_topics
from fcsl_bridge.topics.queue_publisher import QueuePublisher
from simclient.ros.publish_queue import RunTopics
from simclient.run import Run, open_run

PILOT = """
class Pilot:
    inputs = {"go": "bool"}
    outputs = {"force": "f64 N", "other": "f64 N", "armed": "bool"}

    def execute(self):
        self.force = 3.0
        self.armed = self.go
"""
FORCE: dict[str, Any] = {
    "name": "force",
    "id": 1,
    "field": "pilot.outputs.force",
    "direction": "actuator",
    "ros": {"type": "std_msgs/Float64", "field": "data"},
}


class Publisher:
    """Takes the place of a publisher: what it was given, and how long it was waited for."""

    def __init__(self) -> None:
        self.values: list[float] = []
        self.waited_s = 0.0

    def publish(self, cdr: bytes) -> None:
        self.values.append(struct.unpack_from("<d", cdr, 4)[0])

    def wait_for_all_acked(self, timeout: Duration) -> bool:
        """Of a receiver that never answers."""
        self.waited_s += timeout.nanoseconds / 1e9
        time.sleep(timeout.nanoseconds / 1e9)
        return False


def opened(folder: Path, **keys: Any) -> Run:
    (folder / "pilot.py").write_text(PILOT)
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "publish": [],
        "algorithms": {"Pilot": {"source": "pilot.py"}},
        "instances": {"pilot": {"algorithm": "Pilot"}},
        "states": {"RUN": {"schedule": {"pilot": 100}}},
        **keys,
    }
    (folder / "craft.json").write_text(json.dumps(config))
    subprocess.run(["fcslc", "build", str(folder / "craft.json"), "-o", str(folder)], check=True)
    return open_run(folder / "libcraft.so", "craft")


@pytest.mark.parametrize(
    ("keys", "published"),
    [
        ({"channels": [{**FORCE, "safe": -1.0}], "arm": "pilot.armed"}, [-1.0, 3.0, 3.0, -1.0]),
        ({"channels": [FORCE]}, [3.0, 3.0, 3.0, 3.0]),
    ],
    ids=["arm", "no arm"],
)
def test_a_disarmed_machine_publishes_safe_values(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keys: dict[str, Any], published: list[float]
) -> None:
    publisher = Publisher()
    monkeypatch.setattr(mapped_topics.qos, "publisher", lambda *_: publisher)
    run = opened(tmp_path, **keys)
    queue_publisher = QueuePublisher(lossless=False)
    messages = RunTopics(run, queue_publisher.queue)
    mapped_topics.Outputs(None, run, queue_publisher, messages, ())  # type: ignore[arg-type]  # the node is for publishers only
    go = run.machine.fields["pilot.inputs.go"].index
    for on in (False, True, True, False):
        run.set(go, 0, bytes([on]))
        run.step(1)
        messages.put(0)
        queue_publisher.all()
    assert publisher.values == published
    messages.close()
    queue_publisher.close()
    run.close()


def test_reports_are_published_armed_or_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    publishers: list[Publisher] = []

    def publisher(*_: object) -> Publisher:
        publishers.append(Publisher())
        return publishers[-1]

    monkeypatch.setattr(mapped_topics.qos, "publisher", publisher)
    report = {**FORCE, "name": "other", "id": 2, "field": "pilot.outputs.other", "direction": "report"}
    report["ros"] = {**FORCE["ros"], "topic": "estimate"}
    run = opened(tmp_path, channels=[{**FORCE, "safe": -1.0}, report], arm="pilot.armed")
    queue_publisher = QueuePublisher(lossless=False)
    messages = RunTopics(run, queue_publisher.queue)
    outputs = mapped_topics.Outputs(None, run, queue_publisher, messages, ())  # type: ignore[arg-type]  # the node is for publishers only
    fields = run.machine.fields
    for on in (False, True, False):
        run.set(fields["pilot.inputs.go"].index, 0, bytes([on]))
        run.set(fields["pilot.outputs.other"].index, 0, struct.pack("<d", 7.0 + on))
        run.step(1)
        messages.put(0)
        queue_publisher.all()
    outputs.make_safe(0)
    assert [p.values for p in publishers] == [[-1.0, 3.0, -1.0, -1.0], [7.0, 8.0, 7.0]]
    messages.close()
    queue_publisher.close()
    run.close()


@pytest.mark.parametrize(
    ("arm", "published"), [({"arm": "pilot.armed"}, [-1.0, -2.0]), ({}, [])], ids=["arm", "no arm"]
)
def test_the_end_of_ticking_waits_once_for_all_actuators(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arm: dict[str, Any], published: list[float]
) -> None:
    """However many receivers do not answer; and nothing is published of a machine that nothing arms."""
    publisher = Publisher()
    monkeypatch.setattr(mapped_topics.qos, "publisher", lambda *_: publisher)
    other = {**FORCE, "name": "other", "id": 2, "field": "pilot.outputs.other"}
    run = opened(tmp_path, channels=[{**FORCE, "safe": -1.0}, {**other, "safe": -2.0}], **arm)
    queue_publisher = QueuePublisher(lossless=False)
    messages = RunTopics(run, queue_publisher.queue)
    outputs = mapped_topics.Outputs(None, run, queue_publisher, messages, ())  # type: ignore[arg-type]  # the node is for publishers only
    outputs.make_safe(0)
    assert publisher.values == published and publisher.waited_s <= 0.2
    messages.close()
    queue_publisher.close()
    run.close()
