# SPDX-License-Identifier: Apache-2.0
"""Observers on a bus of their own (docs/reference/transports.md): they see what is recorded, and frozen ones change nothing in a flight."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fcsl_sim import SimError, Simulation, load
from simclient import VarClient
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint
from simclient.bus.session import Session
from simclient.bus.ticks import Lost, TickReader

SIM = Path(__file__).resolve().parents[2] / "examples/lander/sim/lander.sim.json"
MACHINE = SIM.parent.parent / "fc/lander_control.json"
LONG_S = 60
SPEED = 5
#: Of the lander's 2951 ticks.
LAST_TOGETHER = 2500
#: Fewer than the history of the simulator has, so that none is lost.
TICKS = 50
#: Observes from its first message on. It tries to connect until somebody listens.
OBSERVER = """
import json, sys, time
import zenoh
config = zenoh.Config.from_json5('{mode: "client", scouting: {multicast: {enabled: false}}}')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("connect/timeout_ms", "30000")
config.insert_json5("transport/link/tx/lease", sys.argv[2])
with zenoh.open(config) as bus:
    came = bus.declare_subscriber("lander_control/*")
    came.recv()
    print("observing", flush=True)
    while True:
        came.recv()
"""


def run(*line: str | Path) -> str:
    done = subprocess.run([str(w) for w in line], capture_output=True, text=True, timeout=LONG_S, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def digest(bag: Path) -> str:
    return run("fcsl", "bag", "digest", bag).split()[0]


@contextlib.contextmanager
def started(*line: str | Path) -> Iterator[subprocess.Popen[str]]:
    pipe = subprocess.PIPE
    process = subprocess.Popen([str(w) for w in line], stdout=pipe, stderr=pipe, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_frozen_observers_change_nothing(tmp_path: Path) -> None:
    """Three of them are stopped while the lander flies in lock-step over the bus: two links are closed after a second, one
    stays open and full. A flight that waited for that one would not end in time."""
    run("fcslc", "build", MACHINE, "-o", tmp_path)
    run("fcsl-sim", "run", SIM, "--record", tmp_path / "alone")
    control, observed = free_endpoint(), free_endpoint()
    summary, bag = tmp_path / "summary.json", tmp_path / "bag"
    options = ["--hal", f"zenoh:{control}", "--timeout", "30", "--observers", observed]
    with contextlib.ExitStack() as stack:
        begin = lambda *line: stack.enter_context(started(*line))  # noqa: E731
        simulator = begin("fcsl-sim", "run", SIM, "--external", f"zenoh:{control}", "--speed", str(SPEED), "--json")
        observers = [
            begin(sys.executable, "-c", OBSERVER, zenoh_locator(observed), lease_ms)
            for lease_ms in ("1000", "1000", "600000")
        ]
        fc = begin("fcsl-fc", tmp_path / "liblander_control.so", *options, "--record", bag, "--summary", summary)
        for observer in observers:
            assert observer.stdout and observer.stdout.readline() == "observing\n"
            os.kill(observer.pid, signal.SIGSTOP)
        said, complaint = fc.communicate(timeout=LONG_S)
        ended, why = simulator.communicate(timeout=LONG_S)
    assert (fc.returncode, simulator.returncode) == (0, 0), complaint + why
    assert digest(bag) == digest(tmp_path / "alone")
    assert json.loads(summary.read_text())["ended"] == "closed by the HAL"
    assert json.loads(ended)["end"] == "until"
    (ticks,) = re.findall(r"observers (\d+) ticks, \d+ dropped", said)
    assert int(ticks) > 100


def test_two_simulations_at_one_address(tmp_path: Path) -> None:
    """One listens, and the other one is its client; each meets its own controller. Neither disturbs the other. Who listens
    ends last: its last ticks wait until the other flight is over."""
    run("fcslc", "build", MACHINE, "-o", tmp_path)
    run("fcsl-sim", "run", SIM, "--record", tmp_path / "alone")
    endpoint, config = free_endpoint(), load(SIM)
    with contextlib.ExitStack() as stack:
        begin = lambda *line: stack.enter_context(started(*line))  # noqa: E731

        def controller(name: str) -> subprocess.Popen[str]:
            where = ["--hal", f"zenoh:{endpoint}", "--namespace", name, "--timeout", str(LONG_S)]
            return begin("fcsl-fc", tmp_path / "liblander_control.so", *where, "--record", tmp_path / name)

        one = stack.enter_context(Simulation(config.plan, config.tables))
        one.set_speed(SPEED)
        one.listen(f"zenoh:{endpoint}", 1000 * LONG_S, "one")
        peer = ["--external", f"zenoh-client:{endpoint}", "--namespace", "two"]
        two = begin("fcsl-sim", "run", SIM, *peer, "--speed", str(4 * SPEED))
        controllers = [controller("one")]
        assert one.accept(1000 * LONG_S), one.problem
        controllers.append(controller("two"))
        ticks_together = 0
        while controllers[1].poll() is None:
            flies = (tmp_path / "two").exists()
            done = one.run(1) if one.tick < LAST_TOGETHER else 0
            ticks_together += done if flies else 0
            time.sleep(0.001)
        while one.status == "running":
            one.run(LAST_TOGETHER)
        one.close()
        for process in (*controllers, two):
            _, complaint = process.communicate(timeout=LONG_S)
            assert process.returncode == 0, complaint
    assert ticks_together > 0
    for name in ("one", "two"):
        assert digest(tmp_path / name) == digest(tmp_path / "alone")


class Observed:
    """What an observer saw: values by tick and channel, and what it lost."""

    def __init__(self) -> None:
        self.values: dict[tuple[int, str], Any] = {}
        self.lost = Lost()

    def follow(self, session: Session, ready: threading.Event) -> None:
        (machine,), _ = session.machines()
        reader = TickReader(machine)
        session.subscribe([machine])
        ready.set()
        for message in session.messages():
            tick = reader.take(message.key.rpartition("/")[2], message.data) if message else None
            for channel, data in tick.values if tick else ():
                self.values[tick.tick, channel.name] = channel.decode(data)
        self.lost = reader.lost


@contextlib.contextmanager
def observing(endpoint: str) -> Iterator[Observed]:
    """Complete after the block, in which the one that listens ends."""
    observed, ready = Observed(), threading.Event()
    with Session(endpoint) as session:
        thread = threading.Thread(target=observed.follow, args=(session, ready), daemon=True)
        thread.start()
        assert ready.wait(LONG_S)
        time.sleep(0.5)  # for the subscription to arrive
        yield observed
        thread.join(LONG_S)
    assert not thread.is_alive()


def test_the_bus_has_the_values_of_the_machine(open_sim: Callable[..., Simulation]) -> None:
    """Every tick, and of a slow sensor those in which it was sampled."""
    endpoint = free_endpoint()
    wanted: dict[tuple[int, str], Any] = {}
    slow = lambda sim: sim["rates"].update(altimeter=20)  # noqa: E731
    with open_sim(slow) as sim:
        sim.observers(endpoint, "/north/hill/")
        fields = {channel.name: channel.field.path for channel in sim.machine.channels}
        with observing(endpoint) as observed:
            for tick in range(TICKS):
                assert sim.run(1) == 1
                wanted.update({(tick, name): sim.machine_value(path) for name, path in fields.items()})
                time.sleep(0.001)
            counts = sim.observers_stop()
            sim.close()
    assert counts == {"ticks": TICKS, "dropped": 0} and not observed.lost
    seen = {(t, name): value for (t, name), value in wanted.items() if name != "altitude" or t % 5 == 0}
    assert observed.values == seen
    assert len({value for (_, name), value in seen.items() if name == "altitude"}) == TICKS / 5


def test_a_simulation_that_nobody_can_follow(open_sim: Callable[..., Simulation]) -> None:
    """Whole ticks are dropped and counted; what comes is right."""
    endpoint = free_endpoint()
    wanted: dict[tuple[int, str], Any] = {}
    longer = lambda sim: sim.update(duration=100.0)  # noqa: E731
    with open_sim(longer) as sim:
        fields = {channel.name: channel.field.path for channel in sim.machine.channels}
        while sim.status == "running":
            tick = sim.tick
            sim.run(1)
            wanted.update({(tick, name): sim.machine_value(path) for name, path in fields.items()})
        total = sim.tick
    with open_sim(longer) as sim:
        sim.observers(endpoint)
        with observing(endpoint) as observed:
            while sim.status == "running":
                sim.run(total)
            counts = sim.observers_stop()
            sim.close()
    assert counts["ticks"] + counts["dropped"] == total == 10_000
    assert counts["dropped"] > 0 and observed.lost.ticks > 0
    assert len(observed.values) > 0
    assert observed.values == {key: wanted[key] for key in observed.values}


def test_served_counts(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    with open_sim() as sim:
        sim.observers(free_endpoint())
        sim.serve(str(tmp_path / "socket"), None, paused=False)
        with VarClient(tmp_path / "socket") as client:
            sim.run(3)
            assert client.stats()["observers"] == {"ticks": 0, "dropped": 0}  # nobody observes


def test_what_is_refused(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with open_sim() as first, open_sim() as second:
        first.observers(endpoint)
        with pytest.raises(SimError, match=f"no observers: cannot listen on {endpoint}"):
            second.observers(endpoint)
        with pytest.raises(SimError, match="observers come before"):
            first.observers(free_endpoint())
    with open_sim() as sim:
        with pytest.raises(SimError, match="write tcp:HOST:PORT"):
            sim.observers("udp/127.0.0.1:7")
        with pytest.raises(SimError, match="longer than 255 bytes"):
            sim.observers(endpoint, "n" * 250)
    with open_sim() as sim:
        sim.listen(f"wire:unix:{tmp_path / 'wire'}", 100)
        with pytest.raises(SimError, match="with an external controller"):
            sim.observers(endpoint)
