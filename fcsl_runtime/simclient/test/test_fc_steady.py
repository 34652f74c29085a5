# SPDX-License-Identifier: Apache-2.0
"""fcsl-fc in steady state: the step thread allocates nothing and makes no system call that could block but its sleep, whatever
is recorded and whoever asks. The kernel says so (steady.c, a seccomp filter on that thread), and seeded defects are found."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from conftest import CFLAGS, ROOT
from guarding import guarding
from native import FIXTURE, PROGRAM, WIRE_SIM, Fc
from telemetry_page import Port
from test_fc_wire import HELLO, TABLE, TICK_HZ, control, listening

from fcsl_compiler.driver.cache import build_machine
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint
from simclient.bus.session import Session
from simclient.errors import BusError
from simclient.link.message import table_hash

pytestmark = pytest.mark.skipif(platform.system() != "Linux", reason="seccomp is Linux's")

TICKS = 1500
#: Puts values under the key of a sensor, and hears its commands.
SOURCE = """
import struct, sys, time, zenoh
config = zenoh.Config.from_json5('{mode: "peer", scouting: {multicast: {enabled: false}}}')
config.insert_json5("listen/endpoints", f'["{sys.argv[1]}"]')
with zenoh.open(config) as bus:
    heard = bus.declare_subscriber("flown_0/tick", lambda sample: print("heard", flush=True))
    print("listening", flush=True)
    while True:
        bus.put("flown_0/sample", struct.pack("<3d", 0.0, 0.1, 0.2))
        time.sleep(0.0005)
"""
CANNOT, FORBIDDEN = 77, 90
#: What an extern does in every tick, by number; 0 is nothing.
MISDEEDS = {"sleeps a little": 1, "allocates": 2, "writes to a stream": 3, "asks who it is": 4}
EXTERN = """
#define _GNU_SOURCE
#include "misbehave.h"

#include <stdlib.h>
#include <time.h>
#include <unistd.h>

int64_t misbehave(int64_t kind)
{
    const struct timespec time = {.tv_nsec = 1000};
    void *volatile memory = NULL;
    switch (kind) {
    case 1:
        return nanosleep(&time, NULL);
    case 2:
        memory = malloc(16);
        free(memory);
        return 0;
    case 3:
        return write(2, "misdeed\\n", 8);
    case 4:
        return getppid();
    default:
        return 0;
    }
}
"""
ALGORITHM = '''from fcsl_builtins import extern


@extern(header="misbehave.h", lang="c")
def misbehave(kind: i64) -> i64: ...


class Misbehave:
    """Does in every tick what no step may; and reaches hardware, which any may."""

    inputs = {"sample": "f64[3]"}
    outputs = {"result": "i64"}
    parameters = {"kind": "i64"}
    state = {"ticks": "u64"}

    def execute(self):
        self.ticks += 1
        hw_write_gpio(1, self.ticks % 2 == 0)
        counts = hw_read_adc(0)
        word = hw_read_u32(16)
        hw_write_u32(16, word + counts)
        self.result = misbehave(self.kind)
'''


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The preloaded library, and sources of machines."""
    folder = tmp_path_factory.mktemp("steady")
    (folder / "misbehave.py").write_text(ALGORITHM)
    (folder / "misbehave.c").write_text(EXTERN)
    (folder / "misbehave.h").write_text("#include <stdint.h>\nint64_t misbehave(int64_t kind);\n")
    source = ROOT / "fcsl_runtime/simclient/test/steady.c"
    include = f"-I{ROOT}/fcsl_hal/test/support"
    subprocess.run(["cc", *CFLAGS, include, str(source), "-o", str(folder / "libsteady.so"), "-lpthread"], check=True)
    return folder


CHANNELS = [
    {"name": "sample", "id": 1, "field": "agent.inputs.sample", "direction": "sensor", "max_age_ticks": 5},
    {"name": "result", "id": 2, "field": "agent.outputs.result", "direction": "actuator"},
]


def machine(folder: Path, kind: int, name: str = "misdeed", channels: Sequence[dict[str, object]] = ()) -> str:
    """A machine at 1 kHz."""
    config = folder / f"{name}_{kind}.json"
    config.write_text(
        json.dumps(
            {
                "tick_hz": 1000,
                "initial_state": "RUN",
                "algorithms": {"Misbehave": {"source": "misbehave.py"}},
                "instances": {"agent": {"algorithm": "Misbehave", "parameters": {"kind": kind}}},
                "connections": [],
                "states": {"RUN": {"schedule": {"agent": 1000}}},
                "transitions": [],
                "channels": channels,
                "targets": {"simulation": {"sources": ["misbehave.c"], "include": ["."]}},
            }
        )
    )
    return str(build_machine(config, "simulation").library)


class Watched(Fc):
    """fcsl-fc with its step thread watched from sleep 100 to 100 + TICKS."""

    def __init__(self, folder: Path, library: str, *options: str, peer: bool = False) -> None:
        watch = {"STEADY_PEER": "1"} if peer else {}
        watch |= {"LD_PRELOAD": str(folder / "libsteady.so"), "STEADY_FROM": "100", "STEADY_TO": str(100 + TICKS)}
        self.process = subprocess.Popen(
            [PROGRAM, library, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **watch}
        )  # fmt: skip

    def report(self) -> tuple[int, str]:
        code, out, err = self.wait()
        if code == CANNOT:
            pytest.skip("this kernel does not let a thread be watched")
        lines = [line for line in out.splitlines() if line.startswith("steady: ")]
        assert lines, (code, out, err)
        return code, lines[0]

    def allocations(self) -> int:
        code, line = self.report()
        found = re.fullmatch(r"steady: (\d+) sleeps, (\d+) allocations, \d+ page faults", line)
        assert code == 0 and found and int(found[1]) == 100 + TICKS, line
        return int(found[2])


def test_alone(folder: Path) -> None:
    assert Watched(folder, machine(folder, 0)).allocations() == 0


def test_recording_with_a_watchdog(folder: Path, tmp_path: Path) -> None:
    options = ("--record", str(tmp_path / "bag"), "--watchdog-ms", "500", "--summary", str(tmp_path / "end"))
    assert Watched(folder, machine(folder, 0), *options).allocations() == 0


def test_telemetry(folder: Path, tmp_path: Path) -> None:
    """To a port where somebody listens, and to one where nobody does."""
    with Port() as port, Port() as closed:
        closed.socket.close()
        for address in (port.address, closed.address):
            options = ("--telemetry", address, "--telemetry-fields", "*", "--socket", str(tmp_path / "s"))
            assert Watched(folder, machine(folder, 0), *options).allocations() == 0
        assert len(port.datagrams()) > TICKS


def test_observers(folder: Path) -> None:
    endpoint = free_endpoint()
    fc = Watched(folder, machine(folder, 0), "--observers", endpoint)
    for _ in range(100):
        with contextlib.suppress(BusError), Session(endpoint) as session:
            session.subscribe(session.machines()[0], "@writes", "@written")
            came = [message.key.rpartition("/")[2] for message in session.messages() if message is not None]
            break
    assert fc.allocations() == 0
    assert len(came) > TICKS and came.count("@writes") > TICKS / 10  # what the extern left


def test_commands_to_a_guard(folder: Path, build_guarded: Callable[..., Path], tmp_path: Path) -> None:
    library = build_guarded("TICK_HZ=1000")
    with guarding(library, tmp_path) as guard:
        assert Watched(folder, str(library), "--guard", str(guard.slot)).allocations() == 0
        assert guard.end() == 0
        counts = re.search(r"; (\d+) commands, 0 refused", guard.told("periods")[-1])
        assert counts and int(counts[1]) > TICKS / 10


@contextmanager
def busy(fc: Watched, path: Path) -> Iterator[list[bool]]:
    """Clients that ask and change without a pause, until the program ends; whether each change was acknowledged."""
    acknowledged: list[bool] = []

    def ask(number: int) -> None:
        client = fc.client(path)
        try:
            while True:
                client("get", paths=["agent.state.ticks", "machine.state"])
                client("stats")
                acknowledged.append(client("set", values={"agent.state.ticks": number})["ok"])
                client("set", values={"agent.state.ticks": "no number"})
                client("set_state", state="RUN")
        except (OSError, AssertionError, ValueError):
            return

    threads = [threading.Thread(target=ask, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    yield acknowledged
    for thread in threads:
        thread.join()


def test_with_clients_that_ask_without_a_pause(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "s"
    fc = Watched(folder, machine(folder, 0), "--socket", str(path), "--record", str(tmp_path / "bag"))
    with busy(fc, path) as acknowledged:
        assert fc.allocations() == 0
    assert len(acknowledged) > 10 and all(acknowledged)


@pytest.mark.parametrize("policy", ["skip", "catch-up"])
def test_every_policy(folder: Path, policy: str) -> None:
    assert Watched(folder, machine(folder, 0), "--missed-deadline", policy).allocations() == 0


# ---- with a peer at the other end of a wire


@pytest.mark.parametrize("kind", ["unix", "udp:", "zenoh:tcp:"])
def test_in_lock_step(kind: str, folder: Path, tmp_path: Path) -> None:
    """It may wait for its peer, and for nothing else."""
    with socket.socket(type=socket.SOCK_DGRAM if kind == "udp:" else socket.SOCK_STREAM) as free:
        free.bind(("127.0.0.1", 0))
        wire = f"unix:{tmp_path / 'w'}" if kind == "unix" else f"{kind}127.0.0.1:{free.getsockname()[1]}"
    with subprocess.Popen([WIRE_SIM, FIXTURE, wire, "100000", "end"], stderr=subprocess.DEVNULL) as simulator:
        options = ("--hal", f"wire:{wire}", "--timeout", "30", "--record", str(tmp_path / "bag"))
        assert Watched(folder, FIXTURE, *options, peer=True).allocations() == 0
        simulator.kill()


def beside_a_rig(folder: Path, library: str, hello: bytes, path: Path) -> Watched:
    """Flown beside a rig that answers the hello and says nothing else."""
    with listening(path) as listener:
        fc = Watched(folder, library, "--hal", f"wire:unix:{path}", "--timeout", "30", peer=True)
        peer, _ = listener.accept()
        with peer:
            peer.settimeout(60)
            assert peer.recv(4096) == hello
            peer.send(hello)
            while peer.recv(4096):
                pass
    return fc


def test_beside_a_rig_that_says_nothing(folder: Path, tmp_path: Path) -> None:
    hello = control(HELLO, table_hash(TABLE), TICK_HZ)
    assert beside_a_rig(folder, FIXTURE, hello, tmp_path / "w").allocations() == 0


def test_free_running(folder: Path, tmp_path: Path) -> None:
    """It may not even wait for a peer. Values come at about its own rate, and their source, which reads its commands, freezes."""
    endpoint = free_endpoint()
    with subprocess.Popen(
        [sys.executable, "-c", SOURCE, zenoh_locator(endpoint)], stdout=subprocess.PIPE, text=True
    ) as source:
        try:
            assert source.stdout and source.stdout.readline() == "listening\n"
            options = ("--hal", f"zenoh:{endpoint},free-running", "--record", str(tmp_path / "bag"))
            fc = Watched(folder, machine(folder, 0, "flown", CHANNELS), *options)
            for _ in range(TICKS // 3):
                assert source.stdout.readline() == "heard\n"
            source.send_signal(signal.SIGSTOP)
            assert fc.allocations() == 0
        finally:
            source.kill()


# ---- with the sensors of a board


def test_with_a_board(folder: Path, tmp_path: Path) -> None:
    """Two gyroscopes, one of which fails and recovers all the time: threads of their own read them. Pins, counts and registers, too."""
    library = machine(folder, 0, "board", CHANNELS)
    names = ("top", "bottom")
    (tmp_path / "memory").write_bytes(bytes(4))
    for number, name in enumerate(names):
        device = tmp_path / f"sys/bus/iio/devices/iio:device{number}"
        device.mkdir(parents=True)
        (device / "name").write_text(name)
        (device / "in_voltage0_raw").write_text("3")
        for axis in "xyz":
            (device / f"in_anglvel_{axis}_raw").write_text("1")
    (tmp_path / "board.json").write_text(
        json.dumps(
            {
                "machine": str(folder / "board_0.json"),
                "devices": {
                    **{name: {"driver": "iio", "device": name, "rate_hz": 2000} for name in names},
                    "counts": {"driver": "adc", "device": "top", "rate_hz": 2000},
                    "lamp": {"driver": "log", "device": str(tmp_path / "lamp")},
                },
                "hardware": {
                    "gpio": {"1": {"device": "lamp", "signal": "number", "safe": False}},
                    "adc": {"0": {"device": "counts", "signal": "counts0"}},
                    "registers": {"16": {"file": str(tmp_path / "memory"), "bytes": 4, "write": True}},
                },
                "sensors": {
                    "imu": {
                        "kind": "inertial",
                        "channels": {"gyro": "sample"},
                        "backends": [{"device": name} for name in names],
                        "low_pass_hz": {"gyro": 100},
                        "health": {"recover_s": 0.01},
                    }
                },
            }
        )
    )
    subprocess.run(["fcslc", "board", tmp_path / "board.json"], check=True, capture_output=True)
    options = ("--hal", f"linux:{tmp_path / 'board.plan'}", "--record", str(tmp_path / "bag"))
    os.environ["FCSL_SYSFS"] = str(tmp_path / "sys")
    try:
        fc = Watched(folder, library, *options)
    finally:
        del os.environ["FCSL_SYSFS"]
    value = tmp_path / "sys/bus/iio/devices/iio:device0/in_anglvel_x_raw"
    while fc.process.poll() is None:
        value.write_text("broken")
        time.sleep(0.05)
        value.write_text("1")
        time.sleep(0.05)
    assert fc.allocations() == 0
    assert int.from_bytes((tmp_path / "memory").read_bytes(), "little") > TICKS  # three counts in most ticks
    assert b"number=1" in (tmp_path / "lamp").read_bytes()


# ---- controls


@pytest.mark.parametrize("misdeed", ["sleeps a little", "writes to a stream", "asks who it is"])
def test_control_a_system_call_is_found(folder: Path, misdeed: str) -> None:
    code, line = Watched(folder, machine(folder, MISDEEDS[misdeed])).report()
    assert code == FORBIDDEN and "the step thread made system call" in line


def test_control_beside_a_rig(folder: Path, tmp_path: Path) -> None:
    hello = control(HELLO, table_hash([]), 1000)
    library = machine(folder, MISDEEDS["asks who it is"])
    assert beside_a_rig(folder, library, hello, tmp_path / "w").report()[0] == FORBIDDEN


def test_control_an_allocation_is_found(folder: Path) -> None:
    assert Watched(folder, machine(folder, MISDEEDS["allocates"])).allocations() >= 2 * (TICKS - 10)
