# SPDX-License-Identifier: Apache-2.0
"""What arms, and the safe values, in the descriptor. What the compiler refuses: fcsl_test_wrong.py."""

from __future__ import annotations

import copy
import ctypes
import struct
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import NONE, Machine, write_machine

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.dump import dump_machine
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.model import machine as model

VALVES = """class Valves:
    inputs = {"close": "bool"}
    outputs = {
        "thrust": "f64[3] N",
        "flaps": "f32[2][2]",
        "gear": "i64",
        "rate": "u64",
        "open": "bool",
        "gate": "Gate",
    }

    def execute(self):
        self.open = not self.close
        self.gate.armed = self.open
"""
LAMP = """class Lamp:
    outputs = {"on": "bool"}

    def execute(self):
        self.on = True
"""
#: Safe values by the field of the channel, and their bits.
SAFE: dict[str, tuple[Any, bytes]] = {
    "thrust": ([0.1, -0.0, 1e300], struct.pack("<3d", 0.1, -0.0, 1e300)),
    "flaps": ([[0.1, 1], [2, 3]], struct.pack("<4f", 0.1, 1, 2, 3)),
    "gear": (-(2**63), struct.pack("<q", -(2**63))),
    "rate": (2**64 - 1, struct.pack("<Q", 2**64 - 1)),
    "open": (True, b"\1"),
}
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {"Gate": {"armed": "bool"}},
    "instances": {"valves": {"algorithm": "Valves"}, "lamp": {"algorithm": "Lamp"}},
    "states": {"RUN": {"schedule": {"valves": 100, "lamp": 100}}},
    "channels": [
        {"name": "close", "id": 1, "field": "valves.inputs.close", "direction": "sensor"},
        *(
            {"name": name, "id": 10 + n, "field": f"valves.outputs.{name}", "direction": "actuator", "safe": value}
            for n, (name, (value, _)) in enumerate(SAFE.items())
        ),
        {"name": "lamp", "id": 20, "field": "lamp.outputs.on", "direction": "actuator", "safe": False},
    ],
    "arm": "valves.gate.armed",
    "command_timeout_s": 0.0333333333333,
}


def write(folder: Path, **changes: Any) -> Path:
    config = copy.deepcopy(CONFIG) | changes
    config = {key: value for key, value in config.items() if value is not None}
    return write_machine(folder, "plant", config, {"valves": VALVES, "lamp": LAMP})


def test_the_descriptor_has_what_the_json_says(tmp_path: Path) -> None:
    m = Machine.build(write(tmp_path))
    assert m.d.fields[m.d.arm_field].path == b"valves.outputs.gate.armed"
    assert m.d.command_timeout_ns == 33_333_333  # fractions of a nanosecond are dropped
    for name, (_, bits) in SAFE.items():
        channel = m.channels[name]
        assert m.d.fields[channel.field].size == len(bits)
        assert ctypes.string_at(channel.safe, len(bits)) == bits, name
    assert m.channels["close"].safe is None


@pytest.mark.parametrize("gone", ["arm", "command_timeout_s"])
def test_each_key_alone(tmp_path: Path, gone: str) -> None:
    d = Machine.build(write(tmp_path, **{gone: None})).d
    assert (d.arm_field == NONE) == (gone == "arm")
    assert (d.command_timeout_ns == 0) == (gone == "command_timeout_s")


def test_without_them(tmp_path: Path) -> None:
    channels = [{k: v for k, v in c.items() if k != "safe"} for c in CONFIG["channels"]]
    m = Machine.build(write(tmp_path, arm=None, command_timeout_s=None, channels=channels))
    assert (m.d.arm_field, m.d.command_timeout_ns) == (NONE, 0)
    assert all(c.safe is None for c in m.channels.values())


def test_they_change_the_source_and_not_the_layout(tmp_path: Path) -> None:
    whole = Machine.build(write(tmp_path / "a")).d
    other = Machine.build(write(tmp_path / "b", command_timeout_s=0.5)).d
    assert whole.source_hash != other.source_hash and whole.layout_hash == other.layout_hash


def test_a_subset_keeps_what_it_can(tmp_path: Path) -> None:
    def subset(*names: str) -> model.Machine:
        made = compile_machine(write(tmp_path), "", instances=names).machine
        assert made is not None
        return made

    valves, lamp = subset("valves"), subset("lamp")
    assert valves.arm is not None and valves.instances[valves.arm.instance].name == "valves"
    assert lamp.arm is None and lamp.command_timeout_ns == 33_333_333
    assert [c.safe for c in lamp.channels] == [(False,)]


def test_the_dump_shows_them(tmp_path: Path) -> None:
    machine = compile_machine(write(tmp_path), "", until="schedule").machine
    assert machine is not None
    lines = dump_machine(machine).splitlines()
    assert "channel 12 gear actuator valves.gear safe [-9223372036854775808]" in lines
    assert "channel 1 close sensor valves.close" in lines
    assert lines[-2:] == ["arm valves.gate.armed", "command time-out 33333333 ns"]


@pytest.mark.parametrize(("tick_hz", "shortest_ns"), [(1, 10**9 + 1), (3, 333_333_335), (100, 10**7 + 1)])
def test_a_timeout_is_longer_than_any_tick(tmp_path: Path, tick_hz: int, shortest_ns: int) -> None:
    """Ticks are whole nanoseconds apart, so at 3 Hz up to 333 333 334 ns."""
    states = {"RUN": {"schedule": {"valves": tick_hz, "lamp": tick_hz}}}

    def timeout(ns: int) -> int:
        path = write(tmp_path, tick_hz=tick_hz, states=states)
        text = f"{ns // 10**9}.{ns % 10**9:09d}"
        path.write_text(path.read_text().replace("0.0333333333333", text))
        return compile_machine(path, "", until="schedule").machine.command_timeout_ns  # type: ignore[union-attr]

    assert timeout(shortest_ns) == shortest_ns and timeout(60 * 10**9) == 60 * 10**9
    for wrong in (shortest_ns - 1, 60 * 10**9 + 1):
        with pytest.raises(DiagnosticError, match=r"E204.*command_timeout_s"):
            timeout(wrong)
