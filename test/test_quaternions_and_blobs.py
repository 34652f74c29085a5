# SPDX-License-Identifier: Apache-2.0
"""Quaternions and blobs from the machine JSON to the wire: what an algorithm reads and writes, and what a peer sees."""

from __future__ import annotations

import contextlib
import json
import subprocess
from pathlib import Path

import pytest

from simclient.link.message import Channel, Kind, Message, decode, encode
from simclient.replay import replay
from simclient.run import Run

RELAY = """class Relay:
    inputs = {"packet": "u32[9]", "attitude": "f32[4]"}
    outputs = {"reply": "u32[5]", "turned": "f64[4]"}

    def execute(self):
        self.reply[0] = self.packet[0] + 1  # a byte more than came
        for i in range(4):
            self.reply[1 + i] = self.packet[1 + i] + 0x100  # more than a byte
            self.turned[i] = f64(self.attitude[i])
"""
CHANNELS = [
    {"name": "packet", "id": 5, "field": "relay.inputs.packet", "direction": "sensor", "as": "blob"},
    {"name": "attitude", "id": 4, "field": "relay.inputs.attitude", "direction": "sensor", "as": "quaternion"},
    {"name": "reply", "id": 6, "field": "relay.outputs.reply", "direction": "actuator", "as": "blob"},
    {"name": "turned", "id": 7, "field": "relay.outputs.turned", "direction": "actuator", "as": "quaternion"},
]
MACHINE = {
    "tick_hz": 100,
    "initial_state": "A",
    "algorithms": {"Relay": {"source": "relay.py"}},
    "instances": {"relay": {"algorithm": "Relay"}},
    "states": {"A": {"schedule": {"relay": 100}}},
    "channels": CHANNELS,
}
TABLE = [
    Channel(5, False, 0, (8,), "blob"),
    Channel(4, False, 5, (4,), "quaternion"),
    Channel(6, True, 0, (4,), "blob"),
    Channel(7, True, 6, (4,), "quaternion"),
]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("relay")
    (folder / "relay.py").write_text(RELAY)
    (folder / "relay.json").write_text(json.dumps(MACHINE))
    done = subprocess.run(["fcslc", "build", folder / "relay.json", "-o", folder], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "librelay.so"


def fly(run: Run, packet: bytes, attitude: tuple[float, ...]) -> Message:
    run.sense(encode(Message(Kind.SENSORS, run.tick, {5: list(packet), 4: attitude}), TABLE))
    run.step(1)
    return decode(run.actuate(), Kind.ACTUATORS, TABLE)


def test_an_algorithm_reads_and_writes_them(library: Path, tmp_path: Path) -> None:
    with contextlib.closing(Run(library, None)) as run:
        run.record(tmp_path / "bag", "", lossless=True)
        first = fly(run, b"$GPRMC,1", (1.0, 0.0, -0.5, 0.25))
        second = fly(run, b"ab", (0.0, 0.0, 0.0, 1.0))
        third = fly(run, b"", (1.0, 0.0, 0.0, 0.0))
    assert bytes(first.values[6]) == b"$GPR"  # 9 bytes do not fit into 4
    assert tuple(first.values[7]) == (1.0, 0.0, -0.5, 0.25)
    assert bytes(second.values[6]) == b"ab\0"  # what came before is gone
    assert bytes(third.values[6]) == b"\0"
    assert replay(tmp_path / "bag", library=str(library)).identical
