# SPDX-License-Identifier: Apache-2.0
"""The lander flies over every wire with the bits of the flight in one process, also where the line loses and damages."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import random
import re
import selectors
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from simclient.bus.free_port import free_endpoint, free_port

SIM = Path(__file__).resolve().parent.parent / "examples" / "lander" / "sim" / "lander.sim.json"
CONFIG = SIM.parent.parent / "fc" / "lander_control.json"
#: Simulated seconds: what a lossy line does takes real time.
LENGTH_S = "4"
DROPPED, DAMAGED = 0.10, 0.05


def run(*line: str | Path, statuses: tuple[int, ...] = (0,)) -> str:
    done = subprocess.run([str(w) for w in line], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode in statuses, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


def digest(bag: Path) -> str:
    return run("fcsl", "bag", "digest", bag).split()[0]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    run("fcslc", "build", CONFIG, "-o", folder)
    return folder / "liblander_control.so"


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> str:
    bag = tmp_path_factory.mktemp("reference") / "bag"
    run("fcsl-sim", "run", SIM, "--duration", LENGTH_S, "--record", bag, statuses=(0, 1))
    return digest(bag)


def fly(ours: str, theirs: str, library: Path, bag: Path, *options: str | Path, sim: Path = SIM) -> str:
    """The digest of the flight; the two programs may start in either order."""
    line = ["fcsl-sim", "run", str(sim), "--duration", LENGTH_S, "--external", ours]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as simulator:
        line = ["--hal", theirs, "--timeout", "60", "--summary", str(bag.with_suffix(".json"))]
        run("fcsl-fc", library, *line, "--record", bag, *options)
        _, err = simulator.communicate(timeout=60)
    assert simulator.returncode in (0, 1), err  # 1: `until` did not hold in so short a flight
    return digest(bag)


def frame_crc(data: bytes) -> bytes:
    """CRC-16/CCITT-FALSE, as behind a frame."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc.to_bytes(2, "little")


@pytest.mark.parametrize("kind", ["udp:", "tcp:", "zenoh:tcp:"])
def test_network(kind: str, reference: str, library: Path, tmp_path: Path) -> None:
    wire = f"wire:{kind}127.0.0.1:{free_port(socket.SOCK_DGRAM if kind == 'udp:' else socket.SOCK_STREAM)}"
    assert fly(wire, wire, library, tmp_path / "bag") == reference


@pytest.mark.parametrize("role", ["zenoh", "zenoh-peer"])
def test_named_values_on_the_bus(role: str, reference: str, library: Path, tmp_path: Path) -> None:
    """Each channel under its own key, and a commit for each tick."""
    place = free_endpoint()
    assert fly(f"zenoh:{place}", f"{role}:{place}", library, tmp_path / "bag") == reference


def test_messages_under_the_names_on_the_bus(reference: str, tmp_path: Path) -> None:
    """With `"payload": "cdr"` ROS 2 messages travel, of which one is mapped; not a bit of the flight is another."""
    shutil.copytree(SIM.parents[1], tmp_path / "lander")
    config = tmp_path / "lander/fc/lander_control.json"
    machine = json.loads(config.read_text())
    machine["bus"] = {"payload": "cdr"}
    machine["channels"][0]["ros"] = {"type": "geometry_msgs/PointStamped", "field": "point.z", "frame": "ground"}
    config.write_text(json.dumps(machine))
    run("fcslc", "build", config, "-o", tmp_path)
    place = free_endpoint()
    library, sim = tmp_path / "liblander_control.so", tmp_path / "lander/sim/lander.sim.json"
    assert fly(f"zenoh:{place}", f"zenoh:{place}", library, tmp_path / "bag", sim=sim) == reference


def test_a_guard_changes_nothing_in_the_flight(reference: str, library: Path, tmp_path: Path) -> None:
    slot, device = tmp_path / "slot", tmp_path / "throttle"
    line = ["fcsl-guard", str(library), "--slot", str(slot), "--actuator", f"throttle=log:{device}"]
    wire = f"wire:unix:{tmp_path / 'wire'}"
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as guard:
        try:
            assert guard.stdout and "slot at" in guard.stdout.readline()
            flown = fly(wire, wire, library, tmp_path / "bag", "--guard", slot)
        finally:
            guard.terminate()
    assert flown == reference and device.stat().st_size > 0


#: What is no frame (a stream needs the zero last, to find its next frame): noise, a zero byte alone, a frame of another version, and one of an unknown kind (both with a right CRC).
STORM = (
    bytes(random.Random(1).randbytes(200)),
    b"\0",
    bytes.fromhex("21 05 03 02 01 00 68 69") + frame_crc(bytes.fromhex("21 05 03 02 01 00 68 69")),
    bytes.fromhex("1F 05 03 02 01 00 68 69") + frame_crc(bytes.fromhex("1F 05 03 02 01 00 68 69")),
)


class Line(threading.Thread):
    """Carries what comes in at one descriptor to the other one. Loses and damages some of it, or adds a storm of others'."""

    def __init__(self, ends: tuple[int, int], lossy: bool = False, storm: int = 0) -> None:
        super().__init__(daemon=True)
        self._to = {ends[0]: ends[1], ends[1]: ends[0]}
        self._random = random.Random(7)
        self._lossy, self._storm = lossy, storm
        self.lost = self.damaged = 0
        self._wake, self._over = os.pipe()

    def run(self) -> None:
        with selectors.DefaultSelector() as selector:
            for end in (*self._to, self._wake):
                selector.register(end, selectors.EVENT_READ)
            while True:
                for key, _ in selector.select():
                    if key.fd == self._wake:
                        return
                    self._carry(int(key.fd))

    def _carry(self, end: int) -> None:
        try:
            data = os.read(end, 2048)
        except OSError:  # a datagram came back, or nobody has the terminal open
            return
        luck = self._random.random() if self._lossy else 1.0
        if luck < DROPPED:
            self.lost += 1
            return
        if luck < DROPPED + DAMAGED:
            self.damaged += 1
            at = self._random.randrange(len(data))
            data = data[:at] + bytes([data[at] ^ 1 << self._random.randrange(8)]) + data[at + 1 :]
        with contextlib.suppress(OSError):
            for number in range(self._storm):
                os.write(self._to[end], STORM[number % len(STORM)])
            os.write(self._to[end], data)

    def stop(self) -> None:
        os.write(self._over, b".")
        self.join()
        os.close(self._wake)
        os.close(self._over)


@contextlib.contextmanager
def running(line: Line) -> Iterator[Line]:
    line.start()
    try:
        yield line
    finally:
        line.stop()


def fly_relayed(library: Path, folder: Path, **line: Any) -> tuple[str, Line]:
    """Over UDP, with a line between the two programs; the digest, and the line."""
    ours, theirs = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sim_side,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as fc_side,
    ):
        sim_side.connect(("127.0.0.1", ours))
        fc_side.bind(("127.0.0.1", theirs))
        fc_side.settimeout(60)
        sim_side.setblocking(False)  # a write may take the error for which select() found it ready to be read
        found: list[str] = []
        flight = threading.Thread(
            target=lambda: found.append(
                fly(f"wire:udp:127.0.0.1:{ours}", f"wire:udp:127.0.0.1:{theirs}", library, folder / "bag")
            )
        )
        flight.start()
        fc_side.connect(fc_side.recvfrom(2048)[1])  # its first hello is lost, too
        with running(Line((sim_side.fileno(), fc_side.fileno()), **line)) as between:
            flight.join(120)
    return found[0], between


def test_network_that_loses_and_damages(reference: str, library: Path, tmp_path: Path) -> None:
    """10 % of the frames are lost, 5 % are damaged: the reliable port repeats them."""
    flown, line = fly_relayed(library, tmp_path, lossy=True)
    assert flown == reference
    assert line.lost > 50 and line.damaged > 20


def summary(folder: Path) -> dict[str, Any]:
    """What the flight program left."""
    left: dict[str, Any] = json.loads((folder / "bag.json").read_text())
    return left


def test_a_storm_of_others_frames(reference: str, library: Path, tmp_path: Path) -> None:
    """Twenty datagrams of others come with every frame, both ways: they are dropped and counted, and nothing is lost."""
    flown, _ = fly_relayed(library, tmp_path, storm=20)
    counted = summary(tmp_path)["hal"]
    assert flown == reference
    assert counted["link.other_version"] > 1000 and counted["link.malformed"] > 3000
    assert counted["messages_dropped"] == 0 and counted["commands_dropped"] == 0


@pytest.mark.parametrize("trouble", [{}, {"lossy": True}, {"storm": 6}])
def test_serial_line(trouble: dict[str, Any], reference: str, library: Path, tmp_path: Path) -> None:
    """Two pseudo-terminals; what is lost, damaged or added to the stream costs a frame or two."""
    (a, ours), (b, theirs) = pty.openpty(), pty.openpty()
    names = [os.ttyname(end) for end in (ours, theirs)]
    with running(Line((a, b), **trouble)) as line:
        flown = fly(f"wire:uart:{names[0]}:921600", f"wire:uart:{names[1]}:921600", library, tmp_path / "bag")
    for end in (a, b, ours, theirs):
        os.close(end)
    assert flown == reference
    assert not trouble.get("lossy") or line.lost > 50
    assert not trouble.get("storm") or summary(tmp_path)["hal"]["link.garbage"] > 100


def test_a_serial_line_that_never_stops(library: Path, tmp_path: Path) -> None:
    """Nobody is there but noise, as fast as the line takes it: the flight program gives up in its time."""
    master, slave = pty.openpty()
    stop = threading.Event()

    def babble() -> None:
        numbers = random.Random(2)
        while not stop.is_set():
            with contextlib.suppress(OSError):
                os.write(master, numbers.randbytes(512))

    os.set_blocking(master, False)
    thread = threading.Thread(target=babble)
    thread.start()
    begun = time.monotonic()
    hal = f"wire:uart:{os.ttyname(slave)}:115200"
    done = subprocess.run(
        ["fcsl-fc", str(library), "--hal", hal, "--timeout", "0.5"], capture_output=True, text=True, check=False
    )
    stop.set()
    thread.join()
    os.close(master)
    os.close(slave)
    assert (done.returncode, done.stderr) == (1, "fcsl-fc: no handshake from the simulator within 500 ms\n")
    assert time.monotonic() - begun < 20


# ---- the model serial_link ---------------------------------------------------------------------------------------------

SERIAL = SIM.with_name("lander_serial.sim.json")


def simulate(bag: Path, *sets: str, seed: int = 1) -> dict[str, Any]:
    """The summary of the whole flight with these parameters of the line."""
    options = [word for text in sets for word in ("--set", f"line.parameters.{text}")]
    line = ["fcsl-sim", "run", SERIAL, "--seed", str(seed), "--record", bag, "--json", *options]
    summary: dict[str, Any] = json.loads(run(*line))
    return summary


def test_a_lossy_link_while_time_halts(tmp_path: Path) -> None:
    """10 % of the frames are lost and 5 % damaged: the digest is that of the flight without a link."""
    summary = simulate(tmp_path / "serial")
    run("fcsl-sim", "run", SIM, "--record", tmp_path / "direct")
    assert summary["truth"]["line.outputs.dropped"] > 500 and summary["truth"]["line.outputs.repeated"] > 500
    assert digest(tmp_path / "serial") == digest(tmp_path / "direct")


def test_the_page_of_testing_names_the_digests(tmp_path: Path) -> None:
    page = (SIM.parents[3] / "docs/guide/testing.md").read_text()
    named = dict(re.findall(r"^- ([AB]): `(\w{64})`$", page, re.MULTILINE))
    run("fcsl-sim", "run", SIM, "--record", tmp_path / "A")
    simulate(tmp_path / "B", "halts=false", "reliable=false", "delay_s=0.02", "baud=115200")
    assert {name: digest(tmp_path / name) for name in "AB"} == named


@pytest.mark.parametrize(
    "sets",
    [("halts=false", "reliable=false"), ("halts=false", "reliable=false", "delay_s=0.02", "baud=115200")],
)
def test_where_time_passes_the_lander_still_lands(sets: tuple[str, ...], tmp_path: Path) -> None:
    """Another flight than over a link that takes no time, and the same one from the same seed."""
    first, again, other = (simulate(tmp_path / str(seed_bag), *sets, seed=1 + seed_bag // 2) for seed_bag in range(3))
    for summary in (first, other):
        assert summary["truth"]["lander.outputs.landed"] and summary["truth"]["lander.outputs.touchdown_speed"] < 2.0
    digests = [digest(tmp_path / str(number)) for number in range(3)]
    assert digests[0] == digests[1] != digests[2] and first["truth"] == again["truth"]
    run("fcsl-sim", "run", SIM, "--record", tmp_path / "direct")
    assert digest(tmp_path / "direct") not in digests


def test_hil_over_the_simulated_line(library: Path, tmp_path: Path) -> None:
    """The flight program in a process of its own, behind the line that loses and damages: the same bits."""
    wire = f"unix:{tmp_path / 'wire'}"
    with subprocess.Popen(
        ["fcsl-sim", "run", str(SERIAL), "--external", f"wire:{wire}"], stdout=subprocess.DEVNULL
    ) as simulator:
        run("fcsl-fc", library, "--hal", f"wire:{wire}", "--timeout", "60", "--record", tmp_path / "own")
        assert simulator.wait(60) == 0
    run("fcsl-sim", "run", SIM, "--record", tmp_path / "direct")
    assert digest(tmp_path / "own") == digest(tmp_path / "direct")
