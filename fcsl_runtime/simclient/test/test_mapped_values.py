# SPDX-License-Identifier: Apache-2.0
"""Requirements on any robot's bag, without a machine: what a map takes of it, what is undecided, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import MS, imu, make, number, write

from simclient.cli import run_tool

START = 100 * 10**9


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """/imu every 20 ms and silent from 200 to 300 ms; /level every 50 ms from 45 ms on, in cm; /mode once."""
    joints = make("sensor_msgs/msg/JointState", name=["left"], position=np.array([1.0]))
    content = {
        "/imu": [
            (START + (20 * i + 5) * MS, imu(START + 20 * i * MS, (i, 0.0, -1.0))) for i in range(25) if not 10 < i < 15
        ],
        "/level": [(START + (45 + 50 * i) * MS, number(100.0 * i)) for i in range(8)],
        "/mode": [(START + 5 * MS, make("std_msgs/msg/UInt8", data=3))],
        "/joints": [(START + 5 * MS, joints)],
    }
    return write(tmp_path / "robot", content)


MAP = """\
tick_hz: 100
values:
  imu.outputs.gyro: {topic: /imu, field: angular_velocity, timeout_ms: 50}
  imu.outputs.accel: {topic: /imu, field: linear_acceleration}
  level.outputs.height: {topic: /level, field: data, scale: 0.01}
  mode.outputs.number: {topic: /mode, field: data}
"""
REQUIREMENTS: list[dict[str, Any]] = [
    {"id": "TURN", "text": "It turns slower than 16 rad/s.", "then": "imu.outputs.gyro[0] < 16.0"},
    {
        "id": "AGAIN",
        "text": "It turns for 0.1 s.",
        "when": "held(imu.outputs.gyro[2] == -1.0, 0.1)",
        "then": "imu.outputs.gyro[1] == 0.0",
    },
    {"id": "SILENT", "text": "The IMU is silent nowhere.", "never": "imu.outputs.health == 'failed'"},
    {"id": "HIGH", "text": "It ends high.", "at_end": "level.outputs.height == 7.0 and mode.outputs.number == 3"},
    {"id": "LOST", "text": "No fault.", "then": "imu.outputs.gyro[0] < 99.0 and imu.counters.overruns < 1"},
    {"id": "RUN", "text": "After runs.", "then": "imu.outputs.gyro[0] < 99.0", "clock": "imu"},
]


def check(
    capfd: pytest.CaptureFixture[str], bag: Path, chart: str = MAP, requirements: Any = REQUIREMENTS
) -> tuple[int, str, str]:
    """Status and output of `fcsl check-bag`."""
    folder = bag.parent
    (folder / "map.yaml").write_text(chart)
    (folder / "f.json").write_text(json.dumps({"requirements": requirements}))
    names = ["--requirements", str(folder / "f.json"), "--map", str(folder / "map.yaml")]
    status = run_tool("check-bag", "replay.check_bag", [str(bag), *names])
    return status, *capfd.readouterr()


def test_values_are_unknown_before_a_message_and_when_it_is_old(bag: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Behind a gap a requirement begins anew."""
    status, out, _ = check(capfd, bag)
    assert status == 1 and out.splitlines() == [
        # /imu is known in ticks 0 to 25 and 30 to 48, and above 16 from 32 on
        "TURN violated 1 time, first at tick 32 (0.32 s), last at tick 48: It turns slower than 16 rad/s. "
        "(undecided in 4 ticks)",
        "AGAIN met, exercised in 25 ticks (undecided in 4 ticks)",  # 10 to 25, 40 to 48
        "SILENT violated 1 time, first at tick 26 (0.26 s), last at tick 29: The IMU is silent nowhere.",
        "HIGH met, exercised in 44 ticks (undecided in 5 ticks)",
        "LOST undecided: the map has no `imu.counters.overruns`",
        "RUN undecided: the map has no `machine.state`, which a `clock` needs",
        "2 of 6 met in 49 ticks",
    ]


STATES = """\
tick_hz: 100
values:
  machine.state: {topic: /state, field: data, states: [IDLE, FLY, LAND]}
"""


@pytest.fixture
def states(tmp_path: Path) -> Path:
    """One every 100 ms."""
    names = ("IDLE", "FLY", "FLY", "IDLE")
    texts = [(START + 100 * i * MS, make("std_msgs/msg/String", data=name)) for i, name in enumerate(names)]
    return write(tmp_path / "robot", {"/state": texts})


def test_a_robot_has_states(states: Path, capfd: pytest.CaptureFixture[str]) -> None:
    landing = {"id": "LAND", "text": "It lands before it idles.", "when": "rose(machine.state == 'IDLE')"}
    landing["never"] = "previous(machine.state) == 'FLY'"
    status, out, _ = check(capfd, states, STATES, [landing])
    assert status == 1 and out.startswith("LAND violated 1 time, first at tick 30 (0.3 s)")
    status, _, error = check(
        capfd, states, STATES.replace("FLY, ", ""), [{**landing, "never": "once(machine.tick > 9)"}]
    )
    assert status == 2 and "map.yaml:3:18: the bag has the state `FLY`, which `states` lacks" in error


@pytest.mark.parametrize(
    ("chart", "message"),
    [
        ("", "a map has `channels` or `values`"),
        ("values: {a.outputs.b: {topic: /imu, field: angular_velocity}}", "map.yaml:1:1: `tick_hz` is missing"),
        (MAP.replace("100", "0.5"), "map.yaml:1:10: `tick_hz` must be a whole number from 1 to 1000000"),
        (
            MAP.replace("imu.outputs.gyro", "imu.gyro"),
            "map.yaml:3:13: `imu.gyro` is no name of a value: write <name>.o",
        ),
        (MAP.replace("imu.outputs.gyro", "imu.outputs.if"), "map.yaml:3:19: `imu.outputs.if` is no name of a value"),
        (MAP.replace("imu.outputs", "machine.outputs"), "`machine.outputs.gyro` is no name of a value"),
        (MAP.replace("angular_velocity", "velocity"), "map.yaml:3:21: `sensor_msgs/Imu` has no field `velocity`"),
        (MAP.replace("/imu", "/imo"), "no topic `/imo`; did you mean `/imu`?"),
        (MAP.replace("/mode, field: data", "/joints, field: position"), "take one: position[0]"),
        (MAP.replace("/mode, field: data", "/joints, field: name"), "`name` is text, not a number"),
        (
            MAP.replace("{topic: /mode, field: data}", "/mode"),
            "map.yaml:6:24: value `mode.outputs.number`: `field` is m",
        ),
        (MAP + "channels: {}", "unknown key `channels`"),
        (
            MAP.replace("mode.outputs.number", "machine.state"),
            "map.yaml:6:18: value `machine.state`: `states` is missing",
        ),
        (MAP + STATES[STATES.index("  machine") :].replace("/state", "/mode"), ":7:18: `data` of `/mode` is not text"),
        (STATES.replace("FLY", "to fly"), "map.yaml:3:18: `machine.state` is no name of a value: `to fly` is not"),
    ],
    ids=lambda text: "map" if "\n" in text else text,
)
def test_a_wrong_map_is_refused(chart: str, message: str, bag: Path, capfd: pytest.CaptureFixture[str]) -> None:
    status, _, error = check(capfd, bag, chart)
    assert status == 2 and message in error and "Traceback" not in error


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ("imu.outputs.giro[0] < 1.0", "there is no field `imu.outputs.giro[0]`"),
        ("imu.outputs.gyro < 1.0", "f.json:1:"),
        ("imu.outputs.gyro[0] < imu.outputs.accel[0]", "a comparison needs one unit"),
    ],
)
def test_a_requirement_that_does_not_fit_the_map_is_refused(
    condition: str, message: str, bag: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    wrong = [{"id": "A", "text": "a", "then": condition}]
    status, _, error = check(capfd, bag, requirements=wrong)
    assert status == 2 and message in error and "^" in error and "Traceback" not in error
