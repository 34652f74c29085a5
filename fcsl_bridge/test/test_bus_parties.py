# SPDX-License-Identifier: Apache-2.0
"""Nodes and native programs meet on the bus: any two of them, beside a ROS graph and under load, fly the flight of one process;
and a node that is killed or frozen at a random moment makes the other one say so, and leaves a readable bag."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bridge_harness import MACHINE, SIM, Domain, Process

from fcsl_compiler.driver.cache import build_machine
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.replay import replay

SEED = 7
#: Long enough for the first change of state.
DURATION = "8.0"
#: `make verify EFFORT=full` flies more.
FULL = os.environ.get("FCSL_VERIFY", "") not in ("", "0")
RUNS, MOMENTS = (20, 40) if FULL else (1, 2)
#: test_lockstep.py flies two nodes in each run of the tests.
PAIRS = (
    ("sim_node", "fcsl-fc"),
    ("fcsl-sim", "controller_node"),
    *((("sim_node", "controller_node"),) if FULL else ()),
)
CONFIG = Path(SIM).parent.parent / "fc" / "lander_control.json"
Reference = Callable[[int, str], Path]


@pytest.fixture
def load() -> Iterator[None]:
    """Two processes that keep the processors busy."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    yield
    for process in busy:
        process.kill()
        process.wait()


def start(domain: Domain, party: str, speed: float = 0.0) -> Process:
    """At the address that the nodes of the domain use. A controller records into `bag`."""
    place = f"zenoh:tcp:127.0.0.1:{7500 + domain.number}"
    bag = domain.folder / "bag"
    if party == "sim_node":
        return domain.start(party, sim=SIM, seed=SEED, duration=DURATION, speed=speed, timeout_s=60.0)
    if party == "controller_node":
        return domain.start(party, machine=MACHINE, record=bag, timeout_s=1.5)
    if party == "fcsl-sim":
        options = ["--seed", str(SEED), "--duration", DURATION, "--external", place, "--timeout", "60"]
        return domain.run(["fcsl-sim", "run", SIM, *options, *(["--speed", str(speed)] if speed else [])])
    library = build_machine(CONFIG).library
    return domain.run(["fcsl-fc", library, "--hal", place, "--timeout", "60", "--record", bag])


@pytest.mark.parametrize("number", range(RUNS))
@pytest.mark.parametrize("pair", PAIRS, ids=" and ".join)
def test_any_two_fly_alike(
    number: int, pair: tuple[str, str], domain: Domain, reference: Reference, load: None
) -> None:
    """With a subscriber, who takes what it can."""
    counter = domain.start("topic_count", topics="[/clock, /lander_control/engine, /lander_control/state]")
    simulator, controller = [start(domain, party) for party in pair]
    statuses = simulator.finish(), controller.finish()
    # fcsl-sim: 1, because `until` did not hold in so short a flight.
    assert statuses == (1 if pair[0] == "fcsl-sim" else 0, 0), simulator.err + controller.err
    assert counter.process.poll() is None
    assert digest(domain.folder / "bag") == digest(reference(SEED, DURATION))


@pytest.mark.parametrize("seed", range(MOMENTS))
def test_a_node_is_killed_or_frozen(seed: int, domain: Domain) -> None:
    """The other one does not wait for its time-out of 60 s. A frozen one ends when it goes on. Bags replay."""
    numbers = random.Random(seed)
    number = (signal.SIGKILL, signal.SIGSTOP)[seed % 2]
    pair = numbers.choice(PAIRS)
    parties = [start(domain, party, speed=8.0) for party in pair]
    victim = numbers.choice([party for party in parties if "_node" in party.command[0]])
    other = next(party for party in parties if party is not victim)
    parties[1].wait_for("COAST" if pair[1] == "controller_node" else "armed")
    time.sleep(numbers.uniform(0.0, 0.1))
    victim.signal(number)
    begun = time.monotonic()
    assert other.finish() in (1, 2) and time.monotonic() - begun < 30.0
    assert re.search(r"tick \d+", other.err), other.err
    killed = number == signal.SIGKILL
    if not killed:
        victim.signal(signal.SIGCONT)
        assert victim.finish() in (0, 1) and re.search(r"tick \d+|the simulator ended", victim.err + victim.out)
    bag = domain.folder / "bag"
    assert not Bag(bag).truncated or (killed and victim is parties[1])
    verdict = replay(bag, library=str(build_machine(CONFIG).library))
    assert verdict.divergence is None and verdict.ticks > 0
