# SPDX-License-Identifier: Apache-2.0
"""Named values without lock-step: simulator and flight program keep to their own clocks, nobody waits for anybody, and who dies,
freezes or returns is told. A hopper comes down, also when its controller or its sensors are away for a second."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import struct
import subprocess
import threading
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from test_wires import run

from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint
from simclient.vars.client import VarClient

ALGORITHM = '''
class Descent:
    """Comes down the slower the lower it is. Armed while it knows its height."""

    inputs = {"altitude": "f64 m", "velocity": "f64 m/s", "seen": "bool"}
    outputs = {"thrust": "f64 m/s^2", "armed": "bool"}

    def execute(self):
        self.thrust = clamp(1.6 + 4.0 * (-0.3 - 0.5 * self.altitude - self.velocity), 0.1, 20.0)
        self.armed = self.seen
'''
MACHINE: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "DOWN",
    "algorithms": {"Descent": {"source": "descent.py"}},
    "instances": {"descent": {"algorithm": "Descent"}},
    "connections": [{"from": "channels.altitude.valid", "to": "descent.seen"}],
    "states": {"DOWN": {"schedule": {"descent": 100}}},
    "channels": [
        {"name": "altitude", "id": 1, "field": "descent.inputs.altitude", "direction": "sensor", "max_age_ticks": 20},
        {"name": "velocity", "id": 2, "field": "descent.inputs.velocity", "direction": "sensor", "max_age_ticks": 20},
        {"name": "thrust", "id": 16, "field": "descent.outputs.thrust", "direction": "actuator", "safe": 0.0},
    ],
    "arm": "descent.armed",
    "command_timeout_s": 0.1,
}
PLANT = """
#include <stdbool.h>
#include "fcsl/fcsl_model.h"

typedef struct {
    struct { double thrust; } inputs;
    struct { double height; } parameters;
    struct { double altitude, velocity; bool released, landed; double touchdown; } state; /* two are integrated */
    struct { double altitude, velocity, touchdown; bool released, landed; } outputs;
} plant_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    plant_t *p = self;
    (void)context;
    p->state.altitude = p->parameters.height;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const plant_t *p = self;
    const bool flies = p->state.released && !p->state.landed;
    (void)t;
    dx[0] = flies ? x[1] : 0.0;
    dx[1] = flies ? p->inputs.thrust - 1.6 : 0.0;
}

static void output(void *self, double t, const double *x)
{
    plant_t *p = self;
    (void)t;
    p->outputs.altitude = x[0];
    p->outputs.velocity = x[1];
    p->outputs.released = p->state.released;
    p->outputs.landed = p->state.landed;
    p->outputs.touchdown = p->state.touchdown;
}

static void event(const void *self, double t, const double *x, double *value)
{
    (void)t;
    value[0] = ((const plant_t *)self)->inputs.thrust;
    value[1] = x[0];
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    plant_t *p = self;
    (void)context;
    if (number == 0) {
        p->state.released = true;
    } else if (!p->state.landed) {
        p->state.landed = true;
        p->state.touchdown = -p->state.velocity;
    }
}

static const fcsl_model_event_t events[] = {
    {"release", FCSL_RISING, "it hangs until its controller is there"}, {"touchdown", FCSL_FALLING, ""},
};

#define FIELD(role, path) FCSL_MODEL_SCALAR(plant_t, FCSL_ROLE_##role, path, "", "")

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.thrust),     FIELD(PARAMETER, parameters.height), FIELD(OUTPUT, outputs.altitude),
    FIELD(OUTPUT, outputs.velocity), FIELD(OUTPUT, outputs.touchdown),    FIELD(OUTPUT, outputs.released),
    FIELD(OUTPUT, outputs.landed),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "plant", .doc = "", .fields = fields,
    .field_count = sizeof fields / sizeof *fields, .size = sizeof(plant_t), .align = _Alignof(plant_t),
    .continuous_offset = offsetof(plant_t, state), .continuous_count = 2, .sampled_offset = FCSL_NO_OFFSET,
    .events = events, .event_count = 2, .init = init, .derivative = derivative, .output = output, .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
"""
SIMULATION: dict[str, Any] = {
    "controller": {"machine": "hopper.json"},
    "seed": 1,
    "duration": 120.0,
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {"plant": {"source": "plant.c"}},
    "instances": {"plant": {"model": "plant", "parameters": {"height": 2.0}}},
    "connections": [
        {"from": "plant.altitude", "to": "controller.altitude"},
        {"from": "plant.velocity", "to": "controller.velocity"},
        {"from": "controller.thrust", "to": "plant.thrust"},
    ],
    "until": {"condition": "plant.outputs.landed", "for_s": 0.1},
}
#: The rows of the channels (docs/reference/transports.md).
TABLE = zlib.crc32(struct.pack("<" + 3 * "HBBI", 1, 0, 6, 1, 2, 0, 6, 1, 16, 1, 6, 1))
#: A fall of 2 m would end with 2.5 m/s.
SOFT_M_S = 1.5
#: What the lease of a session, its watcher and the printing of a line take, s; and a busy machine.
NOTICED_S = 3.0
LONG_S = 180.0
#: States of the gate.
ARMED, SILENT = 1, 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hopper")
    (folder / "descent.py").write_text(ALGORITHM)
    (folder / "plant.c").write_text(PLANT)
    (folder / "hopper.json").write_text(json.dumps(MACHINE))
    (folder / "hopper.sim.json").write_text(json.dumps(SIMULATION))
    run("fcslc", "build", folder / "hopper.json", "-o", folder)
    run("fcsl-sim", "check", folder / "hopper.sim.json")  # builds the model
    return folder


class Program:
    """Runs, and is listened to."""

    def __init__(self, *line: str | Path):
        words = [str(word) for word in line]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.said: list[str] = []
        self._heard = 0
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout
        for line in self.process.stdout:
            self.said.append(line.rstrip())

    def hears(self, text: str, limit_s: float = LONG_S) -> None:
        """Waits until it says that, in a line behind the last one that was waited for."""
        end = time.monotonic() + limit_s
        while True:
            lines = self.said[self._heard :]
            for number, line in enumerate(lines):
                if text in line:
                    self._heard += number + 1
                    return
            assert time.monotonic() < end and self.process.poll() is None, (text, self.said)
            time.sleep(0.01)

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def ends(self) -> int:
        code = self.process.wait(LONG_S)
        self._reader.join(LONG_S)
        return code

    def close(self) -> None:
        self.process.kill()
        self.process.wait(LONG_S)


@pytest.fixture
def programs() -> Iterator[contextlib.ExitStack]:
    with contextlib.ExitStack() as stack:
        yield stack


def start(programs: contextlib.ExitStack, *line: str | Path) -> Program:
    program = Program(*line)
    programs.callback(program.close)
    return program


def fc_line(folder: Path, place: str, *options: str | Path) -> list[str | Path]:
    return ["fcsl-fc", folder / "libhopper.so", "--hal", f"zenoh:{place},free-running", *options]


def sim_line(folder: Path, place: str, *options: str) -> list[str | Path]:
    line: list[str | Path] = ["fcsl-sim", "run", folder / "hopper.sim.json", "--speed", "1"]
    return [*line, "--external", f"zenoh:{place},free-running", *options]


@pytest.mark.parametrize("first", ["fcsl-fc", "fcsl-sim"])
def test_it_lands_in_whatever_order_they_start(
    first: str, folder: Path, tmp_path: Path, programs: contextlib.ExitStack
) -> None:
    place, summary = free_endpoint(), tmp_path / "summary.json"
    lines = {"fcsl-fc": fc_line(folder, place, "--summary", summary), "fcsl-sim": sim_line(folder, place)}
    (second,) = set(lines) - {first}
    started = {first: start(programs, *lines[first])}
    started[first].hears("HAL" if first == "fcsl-fc" else "a controller may come")
    started[second] = start(programs, *lines[second])
    fc, sim = started["fcsl-fc"], started["fcsl-sim"]
    assert sim.ends() == 0, sim.said
    (touchdown,) = (float(line.split()[2]) for line in sim.said if "touchdown" in line)
    assert 0.0 < touchdown < SOFT_M_S
    assert any("the controller is there" in line for line in sim.said)
    assert re.search(r"commands: in \d{2,} ticks; none in \d+, at most \d+ in a row", "\n".join(sim.said))
    fc.hears("the simulator is there")
    fc.hears("the simulator ended its run")
    fc.signal(signal.SIGTERM)
    assert fc.ends() == 0, fc.said
    left = json.loads(summary.read_text())
    assert left["ended"] == "signal" and left["hal"]["messages"] > 100 and left["hal"]["connected"] == 0
    assert left["counters"]["messages_refused"] == 0


def gate(path: Path) -> int:
    """Of the simulator (docs/hardware/arming.md)."""
    with VarClient(path) as client:
        return int(client.get_value("actuators.outputs.gate"))


def wait_for_gate(path: Path, state: int) -> None:
    end = time.monotonic() + LONG_S
    while gate(path) != state:
        assert time.monotonic() < end


def test_each_side_freezes_dies_and_returns(folder: Path, tmp_path: Path, programs: contextlib.ExitStack) -> None:
    """The other side says so within about a second, and flies on."""
    place = free_endpoint()
    high = ["--set", "plant.parameters.height=1000", "--socket", str(tmp_path / "socket")]
    sim = start(programs, *sim_line(folder, place, *high))
    fc = start(programs, *fc_line(folder, place))
    sim.hears("the controller is there")
    fc.signal(signal.SIGSTOP)
    sim.hears("the controller is gone", limit_s=NOTICED_S)
    wait_for_gate(tmp_path / "socket", SILENT)
    fc.signal(signal.SIGCONT)
    sim.hears("the controller is back")
    wait_for_gate(tmp_path / "socket", ARMED)
    fc.signal(signal.SIGKILL)
    sim.hears("the controller is gone", limit_s=NOTICED_S)
    fc = start(programs, *fc_line(folder, place))
    sim.hears("the controller is back")
    fc.hears("the simulator is there")
    sim.signal(signal.SIGSTOP)
    fc.hears("disarmed")  # its sensors are too old
    fc.hears("the simulator is gone", limit_s=NOTICED_S)
    sim.signal(signal.SIGCONT)
    fc.hears("the simulator is back")
    sim.signal(signal.SIGKILL)
    fc.hears("the simulator is gone", limit_s=NOTICED_S)
    sim = start(programs, *sim_line(folder, place, *high))
    fc.hears("the simulator is back")
    wait_for_gate(tmp_path / "socket", ARMED)


class Source:
    """A program of one file that puts values under keys, and hears the thrust. It listens, so that others connect to it."""

    def __init__(self, place: str):
        config = zenoh.Config.from_json5('{mode: "peer", scouting: {multicast: {enabled: false}}}')
        config.insert_json5("listen/endpoints", f'["{zenoh_locator(place)}"]')
        self.bus = zenoh.open(config)
        self.thrust, self.armed, self.ticks = 0.0, False, [0]
        self._subscribers = [
            self.bus.declare_subscriber("hopper/thrust", self._hear_thrust),
            self.bus.declare_subscriber("hopper/tick", self._hear_commit, allowed_origin=zenoh.Locality.REMOTE),
        ]

    def _hear_thrust(self, sample: zenoh.Sample) -> None:
        (self.thrust,) = struct.unpack("<d", bytes(sample.payload))

    def _hear_commit(self, sample: zenoh.Sample) -> None:
        tick, time_ns, table, direction, self.armed, channels, fresh = struct.unpack("<QQIB?HB", bytes(sample.payload))
        assert (time_ns, table, direction, channels, fresh) == (0, TABLE, 1, 3, 0b100)
        self.ticks.append(tick)

    def put(self, name: str, data: bytes) -> None:
        self.bus.put(f"hopper/{name}", data)

    def measure(self, altitude: float, velocity: float) -> None:
        self.put("altitude", struct.pack("<d", altitude))
        self.put("velocity", struct.pack("<d", velocity))

    def waits_until(self, armed: bool) -> None:
        end = time.monotonic() + LONG_S
        while self.armed != armed:
            assert time.monotonic() < end
            time.sleep(0.01)


def test_a_script_is_the_only_source(folder: Path, tmp_path: Path, programs: contextlib.ExitStack) -> None:
    """It flies the hopper at 300 Hz, without commits. What is no value of a channel is dropped and counted; of several values in
    a tick the newest counts, and a channel without new ones grows old."""
    place, summary = free_endpoint(), tmp_path / "summary.json"
    fc = start(programs, *fc_line(folder, place, "--summary", summary))
    fc.hears("HAL")
    source = Source(place)
    programs.callback(source.bus.close)
    altitude, velocity, was = 2.0, 0.0, time.monotonic()
    released = False
    while altitude > 0.0:
        source.measure(altitude, velocity)
        time.sleep(1 / 300)
        thrust, now = source.thrust if source.armed else 0.0, time.monotonic()
        released = released or thrust > 0.0
        assert now - was < LONG_S
        if released:
            altitude, velocity = altitude + (now - was) * velocity, velocity + (now - was) * (thrust - 1.6)
        was = now
    assert -SOFT_M_S < velocity < 0.0
    assert source.ticks == sorted(source.ticks)
    source.put("altitude", b"short")
    source.put("altitude", bytes(9))
    source.put("nothing", bytes(8))
    source.put("tick", struct.pack("<QQIBBHB", 0, 0, TABLE + 1, 0, 0, 3, 0b011))  # of another machine
    source.put("tick", bytes(26))
    source.put("@control", b"no packet")
    end = time.monotonic() + 0.5
    while time.monotonic() < end or source.armed:  # the altitude grows old, the velocity does not
        assert time.monotonic() < end + LONG_S
        source.put("velocity", struct.pack("<d", 0.0))
        time.sleep(0.01)
    source.measure(1.0, 0.0)
    source.waits_until(True)
    fc.signal(signal.SIGTERM)
    assert fc.ends() == 0, fc.said
    counted = json.loads(summary.read_text())["hal"]
    assert counted["bus.wrong_size"] == 3 and counted["bus.strays"] == 1 and counted["bus.commits_refused"] == 2
    assert counted["bus.replaced"] > 100 and counted["messages_dropped"] == 0
    assert not any("simulator" in line for line in fc.said)  # it holds no token, and says no hello


@pytest.mark.parametrize("free", ["fcsl-fc", "fcsl-sim"])
def test_one_side_in_lock_step_is_told(free: str, folder: Path, programs: contextlib.ExitStack) -> None:
    place = free_endpoint()
    lines = {"fcsl-fc": fc_line(folder, place), "fcsl-sim": sim_line(folder, place, "--duration", "100")}
    bound = ({*lines} - {free}).pop()
    lines[bound] = [str(word).removesuffix(",free-running") for word in lines[bound]]
    if bound == "fcsl-fc":
        lines[bound] += ["--timeout", "30"]
    started = {name: start(programs, *line) for name, line in lines.items()}
    assert started[bound].ends() in (1, 2)
    assert any("free" in line and "write ,free-running behind" in line for line in started[bound].said)
    assert started[free].process.poll() is None
    if free == "fcsl-sim":
        started[free].hears("the controller that is there does not fit: it flies in lock-step")


def test_a_speed_is_needed_and_no_timeout(folder: Path) -> None:
    line = [str(word) for word in sim_line(folder, "tcp:127.0.0.1:1")]
    slow = subprocess.run([*line, "--speed", "0"], capture_output=True, text=True, check=False)
    assert slow.returncode == 2 and "give it a speed, as with `--speed 1`" in slow.stderr
    waits = subprocess.run([*line, "--timeout", "3"], capture_output=True, text=True, check=False)
    assert waits.returncode == 2 and "`--timeout` does not go with `,free-running`" in waits.stderr
