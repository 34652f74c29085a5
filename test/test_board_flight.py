# SPDX-License-Identifier: Apache-2.0
"""A flight with the sensors of a board: `fcsl board`, `fcsl-fc --hal linux:PLAN`, replays. Folders stand for the kernel's devices here;
`make hardware` has its real drivers."""

from __future__ import annotations

import json
import os
import re
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_board_flights import LONG_S, PROGRAM, ROOT, Flight, compile_driver, flying, refusal, until

from fcsl_compiler.driver.cache import build_machine
from simclient.bag import Bag
from simclient.errors import BagError
from simclient.replay import replay

HZ = 100
ALGORITHMS = '''class Sensors:
    """What the board gives."""

    outputs = {"gyro": "f64[3] rad/s", "turned": "f64[3] rad", "sticks": "f32[4]"}

    def execute(self):
        pass


class Pilot:
    """Asks for SAFE when the gyro is not valid."""

    inputs = {"gyro": "f64[3] rad/s", "valid": "bool"}
    outputs = {"rate": "f64 rad/s", "transition_request": "TransitionRequest"}

    def execute(self):
        self.rate = self.gyro[2]
        self.transition_request = "FLY" if self.valid else "LOSE"
'''
MACHINE = {
    "tick_hz": HZ,
    "initial_state": "STAND",
    "algorithms": {"Sensors": {"source": "craft.py"}, "Pilot": {"source": "craft.py"}},
    "instances": {"sensors": {"algorithm": "Sensors"}, "pilot": {"algorithm": "Pilot"}},
    "connections": [
        {"from": "sensors.gyro", "to": "pilot.gyro"},
        {"from": "channels.imu.gyro.valid", "to": "pilot.valid"},
    ],
    "states": {
        "STAND": {"schedule": {"sensors": HZ, "pilot": HZ}},
        "FLIGHT": {"schedule": {"sensors": HZ, "pilot": HZ}},
        "SAFE": {"schedule": {"sensors": HZ, "pilot": HZ}},
    },
    "transitions": [
        {"from": ["STAND", "SAFE"], "to": "FLIGHT", "request": "FLY"},
        {"from": "FLIGHT", "to": "SAFE", "request": "LOSE"},
    ],
    "channels": [
        {"name": "imu.gyro", "id": 1, "field": "sensors.outputs.gyro", "direction": "sensor", "max_age_ticks": 200},
        {"name": "imu.turned", "id": 2, "field": "sensors.outputs.turned", "direction": "sensor", "max_age_ticks": 200},
    ],
}
IMU = {
    "kind": "inertial",
    "channels": {"gyro": "imu.gyro", "delta_angle": "imu.turned"},
    "backends": [
        {"device": "top", "rotation": "yaw_90", "correct": {"gyro": {"offset": [0.1, 0.0, 0.0]}}},
        {"device": "bottom", "rotation": "roll_180"},
    ],
    "health": {"max_age_s": 1.0, "recover_s": 0.2},
}
BOARD = {
    "machine": "craft.json",
    "devices": {
        "top": {"driver": "iio", "device": "imu-top", "rate_hz": 200},
        "bottom": {"driver": "iio", "device": "imu-bottom", "rate_hz": 200},
    },
    "sensors": {"imu": IMU},
}


class Craft:
    """A folder with machine, board and two gyroscopes that the kernel shows in its sysfs."""

    def __init__(self, folder: Path):
        self.folder, self.plan, self.socket = folder, folder / "board.plan", folder / "socket"
        self.sysfs = folder / "sys"
        self.environment = {**os.environ, "FCSL_SYSFS": str(self.sysfs)}
        (folder / "craft.py").write_text(ALGORITHMS)
        (folder / "craft.json").write_text(json.dumps(MACHINE))
        self.library = build_machine(folder / "craft.json", "simulation").library
        for number, name in enumerate(("imu-top", "imu-bottom")):
            device = self.device(number)
            device.mkdir(parents=True)
            (device / "name").write_text(f"{name}\n")
            (device / "in_anglvel_scale").write_text("0.001\n")
            self.turn(number, (300, 500, 700))
        self.write_plan(BOARD)

    def device(self, number: int) -> Path:
        return self.sysfs / f"bus/iio/devices/iio:device{number}"

    def turn(self, number: int, raw: tuple[int, int, int]) -> None:
        for axis, value in zip("xyz", raw, strict=True):
            self.write(number, axis, str(value))

    def fail(self, number: int) -> None:
        for axis in "xyz":
            self.write(number, axis, "bad")

    def write(self, number: int, axis: str, three: str) -> None:
        """At once, as the kernel's files change: a flight that reads meanwhile gets the old text or the new one."""
        assert len(three) == 3
        file = os.open(self.device(number) / f"in_anglvel_{axis}_raw", os.O_WRONLY | os.O_CREAT, 0o644)
        os.pwrite(file, f"{three}\n".encode(), 0)
        os.close(file)

    def write_plan(self, board: dict[str, Any], plan: str = "board.plan") -> Path:
        (self.folder / "board.json").write_text(json.dumps(board))
        line = ["fcslc", "board", self.folder / "board.json", "-o", self.folder / plan]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return self.folder / plan

    def line(self, *options: str | Path) -> list[str]:
        words = [PROGRAM, self.library, "--hal", f"linux:{self.plan}", *options]
        return [str(word) for word in words]

    def refusal(self, *options: str, status: int = 1) -> str:
        """What a flight says that cannot begin."""
        return refusal(self.line(*options), self.environment, status)


@pytest.fixture
def craft(tmp_path: Path) -> Craft:
    return Craft(tmp_path)


@pytest.fixture
def fly(craft: Craft) -> Iterator[Callable[..., Flight]]:
    with flying(lambda *options: Flight(craft.line(*options), craft.socket, craft.environment)) as fly:
        yield fly


def near(values: Any, expected: list[float]) -> bool:
    return list(values) == pytest.approx(expected, abs=1e-9)


def test_a_gyro_is_lost_then_the_other_one(craft: Craft, fly: Callable[..., Flight]) -> None:
    """The primary changes and nothing else; then the channel is invalid, and the machine goes to SAFE. Both come back."""
    flight = fly("--record", craft.folder / "bag")
    flight.until_value("hal.sensors.imu.primary", 1)
    flight.until_value("machine.state", "FLIGHT")
    # Raw 0.3 0.5 0.7 rad/s, less 0.1 of x; then turned by 90° about z. The other one stands on its head.
    assert near(flight.get("sensors.outputs.gyro"), [-0.5, 0.2, 0.7])
    # Over a tick, or two where the device was late.
    assert flight.get("sensors.outputs.turned")[2] == pytest.approx(0.7 / HZ, rel=2)
    craft.fail(0)
    flight.until_value("hal.sensors.imu.primary", 2)
    assert near(flight.get("sensors.outputs.gyro"), [0.3, -0.5, -0.7])
    assert flight.get("machine.state") == "FLIGHT"
    assert flight.get("hal.sensors.imu.condition.top") == 1
    craft.fail(1)
    flight.until_value("machine.state", "SAFE")
    assert flight.get("channels.imu.gyro.valid") is False
    assert flight.get("hal.sensors.imu.primary") == 0
    craft.turn(0, (300, 500, 700))
    flight.until_value("machine.state", "FLIGHT")
    assert flight.get("hal.sensors.imu.primary") == 1
    craft.turn(1, (300, 500, 700))
    flight.until_value("hal.sensors.imu.condition.bottom", 0)
    assert flight.get("hal.sensors.imu.primary") == 1
    assert flight.get("hal.devices.top.errors") > 0
    said = flight.end()
    told = re.findall(r"fcsl-fc: (sensor 'imu': .*|device .*)", said)
    assert told[:2] == [
        "sensor 'imu': primary is device 'top'",
        "device 'top' fails: in_anglvel_x: 'bad' is no number",
    ]
    assert "sensor 'imu': no device is healthy; 'bottom' is silent" in told
    # The flight comes out of the readings again, bit for bit.
    bag, library = craft.folder / "bag", str(craft.library)
    whole = replay(bag, library=library, board=craft.plan)
    assert whole.identical and whole.ticks > 50, str(whole)
    # Another calibration shows from the first reading on.
    other = json.loads(json.dumps(BOARD))
    other["sensors"]["imu"]["backends"][0]["correct"]["gyro"]["offset"][0] = 0.15
    changed = replay(bag, library=library, board=craft.write_plan(other, "other.plan"))
    assert changed.divergence and changed.divergence.path == "sensors.outputs.gyro[1]"
    assert float(changed.divergence.replayed) == pytest.approx(0.15)


def test_a_device_that_is_not_there_comes_later(craft: Craft, fly: Callable[..., Flight]) -> None:
    """It is found by its name, whatever number the kernel gives it."""
    away = craft.folder / "away"
    craft.device(0).rename(away)
    flight = fly()
    flight.until_value("hal.sensors.imu.primary", 2)
    flight.until_value("machine.state", "FLIGHT")
    assert flight.get("hal.devices.top.open") == 0
    away.rename(craft.device(7))
    flight.until_value("hal.devices.top.open", 1)
    flight.until_value("hal.sensors.imu.condition.top", 0)
    assert flight.get("hal.sensors.imu.primary") == 2
    until(lambda: flight.get("hal.devices.top.samples") > 400)  # a device has one text a second
    said = flight.end()
    assert re.search(r"device 'top' is not there: .*imu-top", said) and "device 'top' is there" in said


def test_it_ends_while_it_waits_for_a_slow_device(craft: Craft, fly: Callable[..., Flight]) -> None:
    slow = json.loads(json.dumps(BOARD))
    slow["devices"]["bottom"]["rate_hz"] = 0.01
    slow["sensors"]["imu"]["health"]["max_age_s"] = 200
    craft.write_plan(slow)
    flight = fly()
    flight.until_value("machine.state", "FLIGHT")
    begun = time.monotonic()
    flight.end()
    assert time.monotonic() - begun < 20


def test_plans_that_cannot_fly(craft: Craft) -> None:
    good = re.sub(r"end \w{8}\n", "end\n", craft.plan.read_text())  # as if it were written by hand
    craft.plan.rename(craft.folder / "away.plan")
    assert f"cannot read '{craft.plan}': No such file or directory" in craft.refusal(status=2)
    for old, new, reason in (
        ("end\n", "", "the plan has no `end`: it was cut off"),
        (
            "fcsl-board-plan 1",
            "fcsl-board-plan 2",
            "board.plan:1: not a plan, or of another version: `fcsl board board.json` writes it",
        ),
        ("machine craft 100", "machine raft 100", "is for machine 'raft' at 100 Hz, and this is 'craft' at 100 Hz"),
        ("sensor imu inertial", "sensor imu internal", "board.plan:5: not a kind of sensor"),
        ("bind gyro imu.gyro", "bind gyro imu.giro", "machine 'craft' has no channel 'imu.giro'"),
        ("iio imu-top", "no_driver imu-top", "device 'top': FCSL has no driver 'no_driver' for sensors; it has: iio, "),
        ("iio imu-top", "ubx imu-top", "device 'top': driver 'ubx' has no signal 'gyro'"),
    ):
        assert old in good
        craft.plan.write_text(good.replace(old, new))
        assert reason in craft.refusal(), new


def test_a_machine_whose_units_have_changed(craft: Craft) -> None:
    """Its plan was right for other units: numbers would mean something else."""
    (craft.folder / "craft.py").write_text(ALGORITHMS.replace("f64[3] rad/s", "f64[3] deg/s"))
    craft.library = build_machine(craft.folder / "craft.json", "simulation").library
    assert "channel 'imu.gyro' is in deg/s, and sensor 'imu' gives rad/s" in craft.refusal()


def test_threads_of_devices_have_less_priority_than_ticks(craft: Craft, fly: Callable[..., Flight]) -> None:
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(7))
        os.sched_setscheduler(0, *before)
    except PermissionError:
        pytest.skip("needs the right to real-time scheduling (CAP_SYS_NICE)")
    flight = fly("--realtime-priority", "7")

    def priorities() -> list[int]:
        threads = [int(t.name) for t in Path(f"/proc/{flight.process.pid}/task").iterdir()]
        real_time = [t for t in threads if os.sched_getscheduler(t) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO]
        return sorted(os.sched_getparam(t).sched_priority for t in real_time)

    deadline = time.monotonic() + 30
    while len(priorities()) < 3 and time.monotonic() < deadline:  # the threads may still be starting
        time.sleep(0.01)
    assert priorities() == [6, 6, 7]
    flight.get("machine.tick")  # while it opens its hardware, a signal ends it as any program
    flight.end()


def test_a_channel_that_a_device_lacks(craft: Craft) -> None:
    for axis in "xyz":
        (craft.device(1) / f"in_anglvel_{axis}_raw").unlink()
    reason = "device 'bottom' (imu-bottom) cannot be opened: the device has no channel for gyro"
    assert reason in craft.refusal()


#: A robot that sends a frame whenever it likes: a double, through a FIFO.
ROBOT = r"""
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include <fcsl/fcsl_driver.h>

typedef struct {
    double value;
    int fifo;
} robot_t;

static const fcsl_driver_signal_t signals[] = {FCSL_DRIVER_SIGNAL(robot_t, value, "", "what it says")};

static fcsl_driver_status_t probe(const char *device, char *why, size_t size)
{
    (void)why;
    (void)size;
    return access(device, F_OK) == 0 ? FCSL_DRIVER_OK : FCSL_DRIVER_ABSENT;
}

static fcsl_driver_status_t open_robot(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    robot_t *robot = self;
    (void)used;
    (void)why;
    (void)size;
    robot->fifo = open(device, O_RDWR | O_NONBLOCK);
    return robot->fifo >= 0 ? FCSL_DRIVER_OK : FCSL_DRIVER_FAILED;
}

static fcsl_driver_status_t read_robot(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    robot_t *robot = self;
    struct pollfd ready = {.fd = robot->fifo, .events = POLLIN};
    struct timespec now;
    (void)why;
    (void)size;
    if (poll(&ready, 1, FCSL_DRIVER_WAIT_MS) <= 0 || read(robot->fifo, &robot->value, sizeof robot->value) != 8) {
        return FCSL_DRIVER_NOTHING;
    }
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    *sample_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
    return FCSL_DRIVER_OK;
}

static void close_robot(void *self)
{
    (void)close(((robot_t *)self)->fifo);
}

static const fcsl_driver_t robot = {
    .abi_version = FCSL_DRIVER_ABI_VERSION, .name = "robot", .doc = "a robot", .direction = FCSL_SENSOR,
    .signals = signals, .signal_count = 1, .state_size = sizeof(robot_t), .state_align = _Alignof(robot_t),
    .waits = 1, .probe = probe, .open = open_robot, .read = read_robot, .close = close_robot,
};

const fcsl_driver_t *const fcsl_drivers[] = {&robot, NULL};
"""
ECHO = '''class Echo:
    """Adds up what it hears."""

    inputs = {"heard": "f64"}
    outputs = {"sum": "f64", "last": "f64"}
    state = {"total": "f64"}

    def execute(self):
        self.total += self.heard
        self.sum = self.total
        self.last = self.heard
'''
ECHO_MACHINE = {
    "tick_hz": 1000,
    "initial_state": "RUN",
    "algorithms": {"Echo": {"source": "echo.py"}},
    "instances": {"echo": {"algorithm": "Echo"}},
    "states": {"RUN": {"schedule": {"echo": 1000}}},
    "channels": [{"name": "heard", "id": 1, "field": "echo.inputs.heard", "direction": "sensor", "max_age_ticks": 9}],
}
PACED_BOARD = {
    "machine": "echo.json",
    "devices": {"robot": {"driver": "DRIVER", "device": "FIFO"}},
    "pace": {"device": "robot", "timeout_s": 2.0},
    "sensors": {"robot": {"kind": "value", "channels": {"value": "heard"}, "backends": [{"device": "robot"}]}},
}


def test_a_device_paces_the_loop(tmp_path: Path) -> None:
    """Tick k is its frame k, in bursts and with pauses. When it falls silent the flight ends, and says why."""
    library = compile_driver(ROBOT, "robot", tmp_path)
    (tmp_path / "echo.py").write_text(ECHO)
    (tmp_path / "echo.json").write_text(json.dumps(ECHO_MACHINE))
    fifo, bag = tmp_path / "fifo", tmp_path / "bag"
    os.mkfifo(fifo)
    board = json.dumps(PACED_BOARD).replace("DRIVER", f"{library}:robot").replace("FIFO", str(fifo))
    (tmp_path / "board.json").write_text(board)
    subprocess.run(["fcslc", "board", tmp_path / "board.json"], check=True)
    machine = build_machine(tmp_path / "echo.json", "simulation").library
    line = [PROGRAM, machine, "--hal", f"linux:{tmp_path / 'board.plan'}", "--record", bag]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        with fifo.open("wb", buffering=0) as robot:
            for burst in (1, 40, 3, 1, 55):
                for _ in range(burst):
                    robot.write(struct.pack("<d", 0.5))
                time.sleep(0.1)
            out, complaint = process.communicate(timeout=LONG_S)
    assert process.returncode == 1
    told = re.search(r"device 'robot', which paces the loop, has given nothing for (\d+(\.\d+)?) ms", complaint)
    assert told and float(told[1]) > 2000, complaint
    assert "paced in real time" in out and re.search(r"^fcsl-fc: 100 ticks,", out, re.MULTILINE), out
    whole = replay(bag, library=str(machine), board=tmp_path / "board.plan")
    assert whole.identical and whole.ticks == 100, str(whole)


def test_the_board_of_the_page(tmp_path: Path) -> None:
    """docs/hardware/hal.md: its first board, for a machine with its channels."""
    page = (ROOT / "docs/hardware/hal.md").read_text()
    example = re.search(r"^```json\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert example
    channels = {"imu.gyro": "f64[3] rad/s", "imu.accel": "f64[3] m/s^2", "gps.latitude": "f64", "gps.longitude": "f64"}
    names = {channel: channel.replace(".", "_") for channel in channels}
    inputs = ", ".join(f'"{names[channel]}": "{kind}"' for channel, kind in channels.items())
    source = f'class Nav:\n    inputs = {{{inputs}}}\n    outputs = {{"x": "f64"}}\n\n    def execute(self):\n        self.x = 0.0\n'
    machine = {**ECHO_MACHINE, "algorithms": {"Nav": {"source": "nav.py"}}, "instances": {"nav": {"algorithm": "Nav"}}}
    machine["states"] = {"RUN": {"schedule": {"nav": 1000}}}
    machine["channels"] = [
        {"name": name, "id": number, "field": f"nav.inputs.{names[name]}", "direction": "sensor", "max_age_ticks": 9}
        for number, name in enumerate(channels)
    ]
    (tmp_path / "nav.py").write_text(source)
    (tmp_path / "craft.json").write_text(json.dumps(machine))
    (tmp_path / "board.json").write_text(example[1])
    done = subprocess.run(["fcslc", "board", tmp_path / "board.json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "warning" not in done.stderr, done.stderr


def first_reading(bag: Bag, backend: int) -> int:
    """The tick of a recorded backend's first reading."""
    (topic,) = [name for name in bag.topics if name.endswith("/readings")]
    for _, _, data in bag.messages({topic}):
        message = bag.decode_own(topic, data, ("tick", "readings"))
        if any(reading.backend == backend for reading in message.readings):
            return int(message.tick)
    raise AssertionError(f"backend {backend} has no reading")


def test_a_replay_matches_devices_by_name(craft: Craft, fly: Callable[..., Flight]) -> None:
    """Another order of the backends, fewer of them, and one that did not fly."""
    bag, library = craft.folder / "bag", str(craft.library)
    craft.turn(1, (100, 200, 400))
    flight = fly("--record", bag)
    flight.until_value("hal.sensors.imu.primary", 1)
    until(lambda: flight.get("machine.tick") > 100)
    flight.end()
    other = json.loads(json.dumps(BOARD))
    backends = other["sensors"]["imu"]["backends"]
    for chosen in (backends[::-1], backends[1:]):
        other["sensors"]["imu"]["backends"] = chosen
        changed = replay(bag, library=library, board=craft.write_plan(other, "other.plan"))
        # The first of the list is the one that stands on its head. Before its first reading a list of one has nothing.
        assert changed.divergence and changed.divergence.path == "sensors.outputs.gyro[0]", str(changed)
        expected = 0.1 if first_reading(Bag(bag), 1) <= changed.divergence.tick else 0.0
        assert float(changed.divergence.replayed) == pytest.approx(expected)
    other["devices"]["side"] = {"driver": "iio", "device": "imu-side", "rate_hz": 200}
    other["sensors"]["imu"]["backends"] = [*backends, {"device": "side"}]
    with pytest.raises(BagError, match="the flight has no readings of device `side` for sensor `imu`"):
        replay(bag, library=library, board=craft.write_plan(other, "other.plan"))
