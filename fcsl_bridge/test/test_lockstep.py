# SPDX-License-Identifier: Apache-2.0
"""Two nodes in lock-step give the results of one process, and report the tick of a missing answer."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bridge_harness import MACHINE, SIM, Domain, Process

from simclient.bag import Bag
from simclient.bag.digest import digest

SEED = 7
#: Long enough for the first change of state (6.81 s).
DURATION = "8.0"
TICKS = 800
#: Time limit of those tests that let it expire.
PATIENCE_S = 4.0
#: Of a flight that is to be met under way, times real time: over a socket all of it takes a fraction of a second.
SLOW = 3.0


@pytest.fixture
def load() -> Iterator[None]:
    """Two processes that keep the processors busy."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    yield
    for process in busy:
        process.kill()
        process.wait()


def fly(domain: Domain, *remap: str, duration: str, place: str = "bus") -> tuple[Path, int, int]:
    """A whole flight; returns the bag and the exit statuses of simulator and controller."""
    bag, both = domain.folder / "bag", {"timeout_s": 60.0, **domain.meeting(place)}
    controller = domain.start("controller_node", *remap, machine=MACHINE, record=bag, **both)
    sim = domain.start("sim_node", *remap, sim=SIM, seed=SEED, duration=duration, **both)
    return bag, sim.finish(), controller.finish()


@pytest.mark.parametrize("place", ["bus", "unix"])
def test_flight_is_that_of_one_process(domain: Domain, reference: Callable[[int, str], Path], place: str) -> None:
    bag, sim, controller = fly(domain, duration=DURATION, place=place)
    assert (sim, controller) == (0, 0), [p.err for p in domain.processes]
    assert digest(bag) == digest(reference(SEED, DURATION)) != digest(reference(SEED + 1, DURATION))
    controller_node, sim_node = domain.processes
    assert f"{TICKS} ticks answered" in sim_node.out
    assert "6.810 s  ASCENT -> COAST (START_COAST by ascent)" in controller_node.err
    assert f"the simulator ended the run: {TICKS} ticks" in controller_node.out


@pytest.mark.parametrize("place", ["bus", "unix"])
def test_flight_under_load_and_in_a_namespace(
    domain: Domain, reference: Callable[[int, str], Path], load: None, place: str
) -> None:
    """With a change of state: load must not change requests and transitions either."""
    bag, sim, controller = fly(domain, "-r", "__ns:=/fleet/one", duration=DURATION, place=place)
    assert (sim, controller) == (0, 0), [p.err for p in domain.processes]
    assert "ASCENT -> COAST" in domain.processes[0].err
    assert digest(bag) == digest(reference(SEED, DURATION))
    assert "/fleet/one/lander_control/engine" in Bag(bag).topics


def test_exact_counts_for_an_independent_subscriber(domain: Domain) -> None:
    counter = domain.start("topic_count", machine="lander_control", topics="[/rosout]")
    controller = domain.start("controller_node", machine=MACHINE, wait_for_subscribers=1, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, duration="2.0", wait_for_subscribers=1, timeout_s=60.0)
    assert (sim.finish(), controller.finish()) == (0, 0)
    counter.signal(signal.SIGTERM)
    assert counter.finish() == 0
    counts = json.loads(counter.out)
    assert {counts[t] for t in ("/clock", "/sim/truth", "/lander_control/engine", "/lander_control/sensors")} == {200}
    assert "/rosout" in counts


@pytest.mark.parametrize("place", ["bus", "unix"])
def test_killed_controller(domain: Domain, place: str) -> None:
    controller = domain.start("controller_node", machine=MACHINE, **domain.meeting(place))
    sim = domain.start("sim_node", sim=SIM, seed=SEED, speed=SLOW, timeout_s=PATIENCE_S, **domain.meeting(place))
    controller.wait_for("ASCENT -> COAST")
    controller.signal(signal.SIGKILL)
    controller.finish()
    assert sim.finish() == 1
    found = re.search(r"tick (\d+): .*the controller (went away|is gone)", sim.err)
    assert found and int(found[1]) >= 675, sim.err


@pytest.mark.parametrize("place", ["bus", "unix"])
def test_killed_simulator(domain: Domain, place: str) -> None:
    bag, both = domain.folder / "bag", domain.meeting(place)
    controller = domain.start("controller_node", machine=MACHINE, record=bag, timeout_s=PATIENCE_S, **both)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, speed=SLOW, **both)
    controller.wait_for("ASCENT -> COAST")
    sim.signal(signal.SIGKILL)
    sim.finish()
    assert controller.finish() == 1
    found = re.search(r"the simulator went away before (?:actuator message of )?tick (\d+)", controller.err)
    assert found and Bag(bag).topics["/lander_control/engine"].count == int(found[1])
    assert not Bag(bag).truncated


@pytest.mark.parametrize(
    ("number", "place"), [(signal.SIGINT, "bus"), (signal.SIGTERM, "bus"), (signal.SIGTERM, "unix")]
)
def test_interrupted_flight(domain: Domain, number: int, place: str) -> None:
    """The simulator shuts down cleanly, sends END to the controller, and its exit status reports unanswered ticks."""
    bag, both = domain.folder / "bag", {"timeout_s": 60.0, **domain.meeting(place)}
    controller = domain.start("controller_node", machine=MACHINE, record=bag, **both)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, speed=SLOW, **both)
    controller.wait_for("ASCENT -> COAST")
    sim.signal(number)
    assert sim.finish() == 128 + number
    assert "interrupted at tick" in sim.out and not sim.err
    assert controller.finish() == 0
    assert "the simulator ended the run" in controller.out
    assert not Bag(bag).truncated


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_controller(domain: Domain, number: int) -> None:
    bag = domain.folder / "bag"
    controller = domain.start("controller_node", machine=MACHINE, record=bag)
    domain.start("sim_node", sim=SIM, seed=SEED)
    controller.wait_for("ASCENT -> COAST")
    controller.signal(number)
    assert controller.finish() == 0
    said = re.search(r"interrupted: (\d+) ticks", controller.out)
    assert said and Bag(bag).topics["/lander_control/engine"].count == int(said[1])
    assert "ERROR" not in controller.err and not Bag(bag).truncated


@pytest.mark.parametrize("killed", ["sim_node", "controller_node"])
def test_interrupted_after_the_other_end_was_killed(domain: Domain, killed: str) -> None:
    """It does not wait for a node that is gone: DDS would for seconds."""
    controller = domain.start("controller_node", machine=MACHINE, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, timeout_s=60.0)
    controller.wait_for("ASCENT -> COAST")
    dead, other = (sim, controller) if killed == "sim_node" else (controller, sim)
    dead.signal(signal.SIGKILL)
    dead.finish()
    began, before = time.monotonic(), processor_s(other)
    other.signal(signal.SIGINT)
    last = before
    while other.process.poll() is None:
        last = max(last, processor_s(other))
        time.sleep(0.02)
    slept = time.monotonic() - began - (last - before)
    assert other.finish() == 0 if other is controller else other.finish() in (1, 128 + signal.SIGINT)
    assert slept < 4.0, "its main thread waited, and not for a processor"


def processor_s(process: Process) -> float:
    """Seconds in which its main thread has run or waited for a processor; 0 if it has ended."""
    try:
        ran, waited, _ = Path(f"/proc/{process.process.pid}/schedstat").read_text().split()
    except OSError:
        return 0.0
    return (int(ran) + int(waited)) / 1e9


def test_interrupted_after_the_flight(domain: Domain) -> None:
    """As launch does to all nodes when one ends: the flight was a success, and so is each node's end."""
    controller = domain.start("controller_node", machine=MACHINE, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, timeout_s=60.0, duration=1.0)
    controller.wait_for("the simulator ended the run")
    sim.wait_for("the duration is over")
    while any(node.process.poll() is None for node in (controller, sim)):
        for node in (controller, sim):
            node.signal(signal.SIGINT)
        time.sleep(0.002)
    assert (controller.finish(), sim.finish()) == (0, 0), controller.err + sim.err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("executable", ["controller_node", "topic_count"])
def test_interrupted_while_waiting(domain: Domain, executable: str, number: int) -> None:
    parameters = {"machine": MACHINE} if executable == "controller_node" else {"topics": "[/clock]"}
    process = domain.start(executable, **parameters)
    process.wait_for("waiting for a simulator" if executable == "controller_node" else "waiting for topics")
    process.signal(number)
    assert process.finish() == 0 and "error" not in process.err
