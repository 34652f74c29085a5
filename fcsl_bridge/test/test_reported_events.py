# SPDX-License-Identifier: Apache-2.0
"""What algorithms report: on its topic, and on /rosout with the place in the algorithm."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bridge_harness import Domain
from rcl_interfaces.msg import Log
from rclpy.serialization import deserialize_message

from fcsl_bridge.topics import qos
from fcsl_compiler.api.build import build_machine
from fcsl_msgs.msg import Event

_ALGORITHM = """
class Counter:
    outputs = {"count": "i64"}

    def execute(self):
        self.count += 1
        event("counted", self.count, severity="debug")
        if self.count % 10 == 0:
            event("ten more", self.count, severity="warning")
        if self.count == 25:
            event("a quarter", 0.25)
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reporting")
    (folder / "counter.py").write_text(_ALGORITHM)
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "publish": [],
        "algorithms": {"Counter": {"source": "counter.py"}},
        "instances": {"counter": {"algorithm": "Counter"}},
        "states": {"RUN": {"schedule": {"counter": 100}}},
    }
    (folder / "reporting.json").write_text(json.dumps(config))
    return build_machine(folder / "reporting.json").library


def test_events_are_on_their_topic_and_on_rosout(domain: Domain, library: Path) -> None:
    listener = domain.listener()
    listener.subscribe(Log, "/rosout", qos.LATCHED_HISTORY)
    listener.subscribe(Event, "/reporting/events", qos.EVENT)

    def logs() -> list[Log]:
        said = [deserialize_message(data, Log) for data in listener.received["/rosout"]]
        return [log for log in said if log.file == "counter.py"]

    def events() -> list[Event]:
        return [deserialize_message(data, Event) for data in listener.received["/reporting/events"]]

    process = domain.start("controller_node", machine=library, mode="realtime")
    listener.until(lambda: len(logs()) > 4 and any(event.text == "ten more" for event in events()))
    severities = {"ten more": Log.WARN, "a quarter": Log.INFO}
    for log in logs():
        text = log.msg.partition("counter: ")[2].rpartition(" ")[0]
        assert (log.level, log.function, log.name) == (severities[text], "counter", "reporting")
        assert log.line == {"ten more": 9, "a quarter": 11}[text]
    assert "0.240 s  counter: a quarter 0.25" in [log.msg for log in logs()]
    for event in events():
        count = event.tick + 1
        assert event.instance == "counter" and event.file == "counter.py"
        if event.text == "ten more":
            assert (event.severity, list(event.values), count % 10) == (Event.WARNING, [str(count)], 0)
    process.wait_for("counter: a quarter 0.25")
