# SPDX-License-Identifier: Apache-2.0
"""Topics of actuators while the machine is disarmed."""

from __future__ import annotations

import json
import struct
import subprocess
from pathlib import Path
from typing import Any

import pytest

from fcsl_bridge import mapped_topics
from simclient.run import Run, open_run

PILOT = """
class Pilot:
    inputs = {"go": "bool"}
    outputs = {"force": "f64 N", "armed": "bool"}

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
    """Takes the place of a publisher: what it was given."""

    def __init__(self) -> None:
        self.values: list[float] = []

    def publish(self, cdr: bytes) -> None:
        self.values.append(struct.unpack_from("<d", cdr, 4)[0])


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
    outputs = mapped_topics.Outputs(None, run)  # type: ignore[arg-type]  # the node is for publishers only
    go = run.machine.fields["pilot.inputs.go"].index
    for on in (False, True, True, False):
        run.set(go, 0, bytes([on]))
        run.step(1)
        outputs.publish(0)
    assert publisher.values == published
    run.close()
