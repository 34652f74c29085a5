# SPDX-License-Identifier: Apache-2.0
"""`diagnostics_node`: sensors and devices of a flight with a board, its lost requests and times, on /diagnostics. Folders stand for
the kernel's devices."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from bridge_harness import Domain, Process
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message

from fcsl_bridge.diagnostics.board_status import BoardStatus
from fcsl_bridge.diagnostics.lost_request_status import LostRequestStatus
from fcsl_bridge.diagnostics.requirement_status import RequirementStatus
from fcsl_bridge.diagnostics.time_status import TimeStatus
from fcsl_bridge.topics import qos
from fcsl_compiler.base.packages import package_prefix
from simclient import VarClient
from simclient.requirements import Status, Verdict

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = package_prefix("lander") / "lib/lander/liblander_machines.so"
DEVICES = ("top", "bottom")
BOARD = {
    "machine": str(ROOT / "examples/lander/fc/lander_control.json"),
    "devices": {
        **{name: {"driver": "iio", "device": f"lidar-{name}", "rate_hz": 200} for name in DEVICES},
        "valve": {"driver": "log", "device": "valve.log"},  # fcsl-guard's, so it has no status
    },
    "sensors": {
        "altimeter": {
            "kind": "range_finder",
            "channels": {"distance": "altitude"},
            "backends": [{"device": name} for name in DEVICES],
            "health": {"max_age_s": 0.5, "recover_s": 0.2},
        }
    },
    "outputs": {
        "throttle": {
            "device": "valve",
            "elements": [{"signal": "number", "command": [0, 1], "output": [1000, 2000]}],
        }
    },
}
REQUIREMENTS = "one/lander_control: requirements"
SENSOR, TOP, BOTTOM = "one/lander_control: sensor altimeter", *(f"one/lander_control: device {n}" for n in DEVICES)
OK, WARN, ERROR, STALE = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE


class Vehicle:
    """Two lidars, a plan for them, and what a node of the graph sees of it."""

    def __init__(self, domain: Domain):
        self._domain, self.socket, self.library = domain, domain.folder / "socket", LIBRARY
        domain.environment["FCSL_SYSFS"] = str(domain.folder / "sys")
        for name in DEVICES:
            self.device(name).mkdir(parents=True)
            (self.device(name) / "name").write_text(f"lidar-{name}")
            (self.device(name) / "in_distance_scale").write_text("0.01")
            self.measure(name)
        (domain.folder / "board.json").write_text(json.dumps(BOARD))
        subprocess.run(["fcslc", "board", domain.folder / "board.json"], check=True, capture_output=True)
        self.listener = domain.listener()
        self.listener.subscribe(DiagnosticArray, "/diagnostics", qos.EVENT)

    def device(self, name: str) -> Path:
        return self._domain.folder / f"sys/bus/iio/devices/iio:device{DEVICES.index(name)}"

    def measure(self, name: str, raw: str = "325") -> None:
        (self.device(name) / "in_distance_raw").write_text(raw)

    def fly(self, *options: str) -> Process:
        program = package_prefix("fcsl_runtime") / "bin/fcsl-fc"
        line = [program, self.library, "--machine", "lander_control", "--socket", self.socket, *options]
        return self._domain.run(line)

    def fly_with_board(self, *options: str) -> Process:
        return self.fly("--hal", f"linux:{self._domain.folder / 'board.plan'}", *options)

    def until(self, holds: Callable[[dict[str, DiagnosticStatus]], bool]) -> dict[str, DiagnosticStatus]:
        """The statuses by name, of the first message from now on for which it holds."""
        received = self.listener.received["/diagnostics"]
        received.clear()
        found: dict[str, DiagnosticStatus] = {}

        def is_there() -> bool:
            while received:
                array = deserialize_message(received.pop(0), DiagnosticArray)
                found.clear()
                found.update({status.name: status for status in array.status})
                if holds(found):
                    assert array.header.stamp.sec > 1_700_000_000, "ROS time"
                    return True
            return False

        self.listener.until(is_there)
        return found


@pytest.fixture
def vehicle(domain: Domain) -> Vehicle:
    return Vehicle(domain)


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


def test_a_flight_loses_its_lidars(domain: Domain, vehicle: Vehicle) -> None:
    """One is missing at first. Both fail, one by one; then the flight ends, and the next one begins."""
    vehicle.device("bottom").rename(domain.folder / "away")
    node = domain.start("diagnostics_node", "-r", "__ns:=/one", socket=vehicle.socket)
    node.wait_for(f"waiting for a flight program at {vehicle.socket}")
    flight = vehicle.fly_with_board()
    found = vehicle.until(lambda all_: all_[SENSOR].message == "primary top; bottom silent")
    assert list(found) == [SENSOR, TOP, BOTTOM, REQUIREMENTS] and {s.hardware_id for s in found.values()} == {
        "lander_control"
    }
    assert found[SENSOR].level == WARN
    assert values(found[REQUIREMENTS])["LND-1"] == "met"
    assert values(found[SENSOR]) == {"primary": "top", "condition.top": "healthy", "condition.bottom": "silent"}
    assert (found[TOP].level, found[TOP].message) == (OK, "there")
    assert list(values(found[TOP])) == [
        *("open", "samples", "errors", "dropped", "lost"),
        *("bytes", "frames", "rejected", "why"),
    ]
    assert (found[BOTTOM].level, found[BOTTOM].message) == (ERROR, "not there")
    (domain.folder / "away").rename(vehicle.device("bottom"))
    found = vehicle.until(lambda all_: all(status.level == OK for status in all_.values()))
    assert found[SENSOR].message == "primary top"
    vehicle.measure("top", "broken")
    found = vehicle.until(lambda all_: "primary bottom" in all_[SENSOR].message and all_[TOP].level == WARN)
    assert (found[SENSOR].level, found[SENSOR].message) == (WARN, "primary bottom; top silent")
    assert found[TOP].message.endswith(" errors") and found[BOTTOM].level == OK
    vehicle.measure("bottom", "broken")
    found = vehicle.until(lambda all_: all_[SENSOR].level == ERROR)
    assert found[SENSOR].message == "primary none; top silent; bottom silent"
    flight.signal(signal.SIGKILL)
    found = vehicle.until(lambda all_: all(status.level == STALE for status in all_.values()))
    assert list(found) == [SENSOR, TOP, BOTTOM, REQUIREMENTS] and str(vehicle.socket) in found[SENSOR].message
    for name in DEVICES:
        vehicle.measure(name)
    vehicle.fly_with_board()
    vehicle.until(lambda all_: all_[SENSOR].level == OK)
    node.signal(signal.SIGTERM)
    assert node.finish() == 0, node.err


def test_a_flight_that_hangs_is_stale(domain: Domain, vehicle: Vehicle) -> None:
    flight = vehicle.fly_with_board()
    node = domain.start("diagnostics_node", socket=vehicle.socket)
    vehicle.until(lambda all_: bool(all_))
    flight.signal(signal.SIGSTOP)
    vehicle.until(lambda all_: all(status.level == STALE for status in all_.values()))
    flight.signal(signal.SIGCONT)
    vehicle.until(lambda all_: any(status.level == OK for status in all_.values()))
    node.wait_for("waiting for the next flight program\nlander_control: its board is on /diagnostics\n")


def test_a_flight_loses_a_request(domain: Domain, vehicle: Vehicle) -> None:
    """`ascent` asks for COAST in the tick in which `monitor` fails, which leads to SAFE."""
    vehicle.fly_with_board("--paused")
    domain.start("diagnostics_node", "-r", "__ns:=/one", socket=vehicle.socket)
    assert list(vehicle.until(lambda all_: True)) == [SENSOR, TOP, BOTTOM, REQUIREMENTS]
    with VarClient(vehicle.socket) as client:
        client.set({"ascent.parameters.target_altitude": -1000.0})
        client.inject("monitor", "failed")
        client.tick()
    found = vehicle.until(lambda all_: len(all_) == 5)
    lost = found["one/lander_control"]
    assert (lost.level, lost.message) == (WARN, "ASCENT; 1 lost requests ASCENT -> COAST: START_COAST")
    assert values(lost) == {"lost requests ASCENT -> COAST: START_COAST": "1"}
    found = vehicle.until(lambda all_: all_["one/lander_control"].level == OK)
    assert found["one/lander_control"].message == "ASCENT" and found[SENSOR].level == OK


def test_a_flight_without_a_board(domain: Domain, vehicle: Vehicle) -> None:
    vehicle.fly()
    node = domain.start("diagnostics_node", socket=vehicle.socket)
    assert node.finish() == 1 and "has no board with devices: --hal linux:PLAN has one" in node.err, node.err


def test_a_node_without_its_socket(domain: Domain) -> None:
    node = domain.start("diagnostics_node")
    assert node.finish() == 1 and "parameter `socket` is missing" in node.err, node.err


# ---- statuses --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("primary", "conditions", "level", "text"),
    [
        (1, (0, 0), OK, "primary top"),
        (1, (0, 5), WARN, "primary top; bottom disagrees"),
        (1, (6, 1), WARN, "primary top; top recovering; bottom silent"),
        (2, (0, 0), WARN, "primary bottom"),
        (0, (1, 3), ERROR, "primary none; top silent; bottom out of range"),
        (0, (0, 0), ERROR, "primary none"),
    ],
)
def test_a_sensor(primary: int, conditions: tuple[int, int], level: bytes, text: str) -> None:
    """What the wire of a composite flight counts is no part of a board."""
    top, bottom = conditions
    counters = {"commands": 7, "link.port1.sent": 3, "sensors.imu.primary": primary}
    counters |= {"sensors.imu.condition.top": top, "sensors.imu.condition.bottom": bottom}
    (status,) = BoardStatus("rover", "rover").statuses(counters)
    assert (status.name, status.level, status.message) == ("rover: sensor imu", level, text)


def test_counts_of_lost_requests_grow() -> None:
    """What was lost before the first look is old."""
    status = LostRequestStatus("rover", "rover")
    assert status.statuses("RUN", {}) == []
    for lost, text in (
        ({"A -> B": 2}, "2 lost requests A -> B"),
        ({"A -> B": 2}, ""),
        ({"A -> B": 5, "A -> C": 1}, "3 lost requests A -> B; 1 lost requests A -> C"),
        ({"A -> B": 1}, ""),  # a checkpoint was restored
    ):
        (found,) = status.statuses("RUN", lost)
        assert (found.level, found.message) == ((WARN, f"RUN; {text}") if text else (OK, "RUN"))
        assert values(found) == {f"lost requests {name}": str(count) for name, count in lost.items()}
    (found,) = LostRequestStatus("rover", "rover").statuses("RUN", {"A -> B": 2})
    assert (found.name, found.level, found.message) == ("rover", OK, "RUN")


def test_counts_of_a_device_grow() -> None:
    """What was counted before the first look is old."""
    board = BoardStatus("rover", "rover")
    names = ("open", "samples", "errors", "dropped", "lost", "bytes", "frames", "rejected", "why")
    for numbers, level, text in (
        ((1, 10, 4, 4, 1, 50, 5, 7, 0), OK, "there"),
        ((1, 20, 4, 4, 1, 60, 6, 7, 0), OK, "there"),
        ((1, 30, 6, 4, 1, 60, 6, 7, 0), WARN, "there; 2 errors"),
        ((1, 40, 6, 5, 2, 60, 6, 7, 0), WARN, "there; 1 dropped; 1 lost"),
        ((1, 50, 6, 5, 2, 80, 6, 17, 0), WARN, "there; 10 bytes rejected"),
        ((1, 50, 6, 5, 2, 80, 6, 17, 1), WARN, "there; silent: no bytes arrive"),
        ((0, 50, 7, 5, 2, 80, 6, 17, 0), ERROR, "not there; 1 errors"),
        ((1, 60, 7, 5, 2, 80, 6, 17, 0), OK, "there"),
    ):
        counts = dict(zip(names, numbers, strict=True))
        (status,) = board.statuses({f"devices.gyro.{name}": count for name, count in counts.items()})
        assert (status.name, status.level, status.message) == ("rover: device gyro", level, text)
        why = text.partition("silent: ")[2]
        assert values(status) == {name: str(count) for name, count in counts.items()} | {"why": why}


def verdict(id_: str, violations: int, holds: bool, assumed: bool = False, kind: str = "then") -> Verdict:
    counts = dict.fromkeys(("evaluated", "exercised", "undefined", "faults", "violated_ticks"), 9)
    status = Status.VIOLATED if violations else Status.MET
    ticks = (3, 4) if violations else (None, None)
    line = f"{id_} violated" if violations else f"{id_} met"
    return Verdict(
        id_, "It holds.", kind, "x", assumed, status, holds, **counts, violations=violations, first_tick=ticks[0],
        last_tick=ticks[1], line=line,
    )  # fmt: skip


def test_times_are_a_status(domain: Domain, vehicle: Vehicle, tmp_path: Path) -> None:
    """Of a machine that was built with --times."""
    config = ROOT / "examples/lander/fc/lander_control.json"
    subprocess.run(["fcslc", "build", "--times", config, "-o", tmp_path], check=True, capture_output=True)
    vehicle.library = tmp_path / "liblander_control.so"
    vehicle.fly_with_board("--paused")
    times = "one/lander_control: times"
    domain.start("diagnostics_node", "-r", "__ns:=/one", socket=vehicle.socket)
    assert vehicle.until(lambda _: True)[times].level == OK
    with VarClient(vehicle.socket) as client:
        client.tick(3)
    found = vehicle.until(lambda all_: values(all_[times])["machine runs"] == "3")[times]
    shown = values(found)
    assert found.level == OK and re.fullmatch(r"\w+ takes [0-9.]+ % of the step", found.message)
    assert [shown[f"{name} runs"] for name in ("filter", "safe", "machine")] == ["3", "0", "3"]
    assert float(shown["filter share"]) < float(shown["machine share"]) == 1.0
    assert float(shown["filter max us"]) >= float(shown["filter mean us"]) > 0


def test_a_machine_without_times_has_no_status_of_them() -> None:
    assert TimeStatus("rover", "rover").statuses({}) == []


def test_requirements_are_a_status() -> None:
    """ERROR while one is violated, WARN afterwards; an assumption is a warning. What has begun is told once."""
    found = RequirementStatus("rover", "rover")
    assert found.statuses([]) == []
    (met,) = found.statuses([verdict("A", 0, True), verdict("E", 0, False, kind="at_end")])
    assert (met.level, met.message, [v.key for v in met.values]) == (DiagnosticStatus.OK, "1 of 1 met so far", ["A"])
    (bad,) = found.statuses([verdict("A", 1, False), verdict("B", 0, True)])
    assert (bad.level, bad.message, bad.values[0].value) == (DiagnosticStatus.ERROR, "A violated", "violated")
    (once,) = found.statuses([verdict("A", 1, True)])
    (world,) = found.statuses([verdict("A", 1, False, assumed=True)])
    assert once.level == world.level == DiagnosticStatus.WARN
    assert found.begun([verdict("A", 1, False)]) == ["A violated"] and found.begun([verdict("A", 1, True)]) == []
    assert found.begun([verdict("A", 2, False)]) == ["A violated"]
