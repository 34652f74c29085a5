# SPDX-License-Identifier: Apache-2.0
"""Lock-step with nodes that stop or run twice, and with subscribers that stall."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Callable
from pathlib import Path

from bridge_harness import MACHINE, SIM, Domain, Process
from rosgraph_msgs.msg import Clock

from fcsl_bridge.topics import qos
from simclient.bag import Bag
from simclient.bag.digest import digest

SEED = 7
DURATION = "8.0"
Reference = Callable[[int, str], Path]


def start(domain: Domain, timeout_s: float, speed: float) -> tuple[Process, Process, Path]:
    """Controller and simulator during a flight."""
    bag = domain.folder / "bag"
    controller = domain.start("controller_node", machine=MACHINE, record=bag, timeout_s=timeout_s)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, duration=DURATION, speed=speed, timeout_s=timeout_s)
    controller.wait_for("ASCENT -> COAST")
    return controller, sim, bag


# ---- a node that stops -------------------------------------------------------------------------------------------------


def test_a_simulator_that_stops_is_named_by_tick(domain: Domain) -> None:
    """Within the second after which the bus takes a silent peer for dead, and what the controller then waits for another one."""
    controller, sim, bag = start(domain, timeout_s=1.5, speed=8.0)
    sim.signal(signal.SIGSTOP)
    assert controller.finish() == 1
    found = re.search(r"the simulator went away before (?:actuator message of )?tick (\d+)", controller.err)
    assert found and Bag(bag).topics["/lander_control/engine"].count == int(found[1]), controller.err
    sim.signal(signal.SIGCONT)
    assert sim.finish() == 1 and re.search(r"tick \d+: no actuator message from the controller|is gone", sim.err), (
        sim.err
    )


def test_a_controller_that_stops_is_named_by_tick(domain: Domain) -> None:
    controller, sim, bag = start(domain, timeout_s=1.5, speed=8.0)
    controller.signal(signal.SIGSTOP)
    assert sim.finish() == 1
    assert re.search(r"tick \d+: .*the controller (went away|is gone)", sim.err), sim.err
    controller.signal(signal.SIGCONT)
    status = controller.finish()
    assert status == (0 if "the simulator ended the run" in controller.out else 1), controller.err
    assert not Bag(bag).truncated


def test_who_stops_for_a_moment_flies_on(domain: Domain, reference: Reference) -> None:
    controller, sim, bag = start(domain, timeout_s=60.0, speed=8.0)
    for process in (sim, controller):
        process.signal(signal.SIGSTOP)
        time.sleep(0.2)
        process.signal(signal.SIGCONT)
    assert (sim.finish(), controller.finish()) == (0, 0), sim.err + controller.err
    assert digest(bag) == digest(reference(SEED, DURATION))


# ---- a second controller -------------------------------------------------------------------------------------------------


def test_a_second_controller_finds_no_simulator(domain: Domain) -> None:
    controller = domain.start("controller_node", machine=MACHINE, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, speed=0.1, timeout_s=60.0)
    listener = domain.listener()
    listener.subscribe(Clock, "/clock", qos.STREAM)
    listener.until(lambda: bool(listener.received["/clock"]))
    late = domain.start("controller_node", "-r", "__node:=late", machine=MACHINE, start_timeout_s=1.0)
    assert late.finish() == 1 and "has another controller" in late.err
    sim.signal(signal.SIGINT)
    assert (sim.finish(), controller.finish()) == (128 + signal.SIGINT, 0), sim.err
    assert "the simulator ended the run" in controller.out


# ---- a subscriber that stalls --------------------------------------------------------------------------------------------


def test_a_stalled_subscriber_does_not_hold_the_flight_up(domain: Domain, reference: Reference) -> None:
    """It stops forever; at the end the simulator waits five seconds for it to receive the last /clock."""
    counter = domain.start("topic_count", topics="[/clock, /lander_control/engine, /lander_control/state]")
    counter.wait_for("waiting for topics")
    controller, sim, bag = start(domain, timeout_s=3.0, speed=8.0)
    counter.signal(signal.SIGSTOP)
    assert (sim.finish(), controller.finish()) == (0, 0), sim.err + controller.err
    assert digest(bag) == digest(reference(SEED, DURATION))
