# SPDX-License-Identifier: Apache-2.0
"""Lock-step with processes that stop, run twice, or send invalid messages."""

from __future__ import annotations

import random
import re
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from bridge_harness import MACHINE, SENSORS, SIM, Domain, HandSimulator, Process
from controller_client import ControllerClient

from fcsl_bridge.errors import BridgeError
from fcsl_bridge.lockstep import TICK, Bundle, pack, unpack
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


# ---- a clock that stops ------------------------------------------------------------------------------------------------


def test_a_simulator_that_stops_is_named_by_tick(domain: Domain) -> None:
    controller, sim, bag = start(domain, timeout_s=1.5, speed=8.0)
    sim.signal(signal.SIGSTOP)
    assert controller.finish() == 1
    found = re.search(r"no sensor bundle of tick (\d+) from the simulator within 1.5 s", controller.err)
    assert found and Bag(bag).topics["/lander_control/engine"].count == int(found[1])
    sim.signal(signal.SIGCONT)
    assert sim.finish() == 1
    missing = re.search(r"no actuator bundle of tick (\d+) from the controller", sim.err)
    # When it continues, the simulator may detect the controller's end before it reads the controller's last answer.
    # DDS then drops that answer.
    assert missing and int(found[1]) - int(missing[1]) in (0, 1), (controller.err, sim.err)


def test_a_controller_that_stops_is_named_by_tick(domain: Domain) -> None:
    controller, sim, bag = start(domain, timeout_s=1.5, speed=8.0)
    controller.signal(signal.SIGSTOP)
    assert sim.finish() == 1
    assert re.search(r"no actuator bundle of tick \d+ from the controller within 1.5 s", sim.err)
    controller.signal(signal.SIGCONT)
    assert controller.finish() == 1 and "no sensor bundle of tick" in controller.err
    assert not Bag(bag).truncated


def test_who_goes_on_in_time_flies_on(domain: Domain, reference: Reference) -> None:
    """First the simulator stops for a while, then the controller."""
    controller, sim, bag = start(domain, timeout_s=60.0, speed=8.0)
    sim.signal(signal.SIGSTOP)
    time.sleep(1.0)
    controller.signal(signal.SIGSTOP)
    sim.signal(signal.SIGCONT)
    time.sleep(1.0)
    controller.signal(signal.SIGCONT)
    assert (sim.finish(), controller.finish()) == (0, 0), sim.err + controller.err
    assert digest(bag) == digest(reference(SEED, DURATION))


def test_both_may_stop_for_as_long_as_they_like(domain: Domain, reference: Reference) -> None:
    """Ctrl-Z and fg: neither reports a timeout for the time in which it was stopped itself."""
    controller, sim, bag = start(domain, timeout_s=1.0, speed=8.0)
    for process in (sim, controller):
        process.signal(signal.SIGSTOP)
    time.sleep(2.0)
    for process in (controller, sim):
        process.signal(signal.SIGCONT)
    assert (sim.finish(), controller.finish()) == (0, 0), sim.err + controller.err
    assert digest(bag) == digest(reference(SEED, DURATION))


# ---- a second controller -------------------------------------------------------------------------------------------------


def test_a_second_controller_makes_no_difference(domain: Domain, reference: Reference) -> None:
    """The same machine gives the same answers: the second ones are dropped."""
    bags = [domain.folder / name for name in ("first", "second")]
    controllers = [
        domain.start("controller_node", "-r", f"__node:={bag.name}", machine=MACHINE, record=bag, timeout_s=60.0)
        for bag in bags
    ]
    for controller in controllers:
        controller.wait_for("waiting for a simulator")
    sim = domain.start("sim_node", sim=SIM, seed=SEED, duration="2.0", paused="true", timeout_s=60.0)
    for controller in controllers:
        controller.wait_for("the simulator is there")
    assert ControllerClient(domain.listener(), "/sim_node").set(paused=False).successful
    assert [process.finish() for process in (sim, *controllers)] == [0, 0, 0], sim.err
    assert digest(bags[0]) == digest(bags[1]) == digest(reference(SEED, "2.0"))


def test_a_controller_that_comes_too_late_disturbs_nobody(domain: Domain) -> None:
    controller = domain.start("controller_node", machine=MACHINE, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, speed=1.5, timeout_s=60.0)
    controller.wait_for("ASCENT -> COAST")
    late = domain.start("controller_node", "-r", "__node:=late", machine=MACHINE)
    late.wait_for("waiting for tick 0 from the simulator; it was at tick")
    late.signal(signal.SIGINT)
    assert late.finish() == 0
    sim.signal(signal.SIGINT)
    assert (sim.finish(), controller.finish()) == (128 + signal.SIGINT, 0), sim.err
    assert "the simulator ended the run" in controller.out


# ---- nonsense --------------------------------------------------------------------------------------------------------------


def test_whatever_a_bundle_holds_is_a_bundle_or_an_error() -> None:
    whole = pack(Bundle(17, 1, 2**63, TICK, b"message"), 170_000_000)
    noise = random.Random(4)
    for _ in range(3000):
        data = bytearray(whole[: noise.randrange(len(whole) + 1)])
        for _ in range(noise.randrange(4)):
            if data:
                data[noise.randrange(len(data))] = noise.randrange(256)
        try:
            bundle = unpack(bytes(data))
        except BridgeError:
            continue
        assert len(bundle.message) <= len(data)


@pytest.mark.parametrize("data", [b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + b"\xff" * 4096])
def test_nonsense_on_the_topic_ends_the_run(domain: Domain, data: bytes) -> None:
    sim = HandSimulator(domain.listener())
    controller = domain.start("controller_node", machine=MACHINE, record=domain.folder / "bag")
    for _ in range(3):
        sim.tick()
    sim.publisher.publish(data)
    assert controller.finish() == 1
    assert "a damaged bundle" in controller.err
    assert Bag(domain.folder / "bag").topics["/lander_control/engine"].count == 3
    assert SENSORS == sim.publisher.topic_name


# ---- a subscriber that stalls --------------------------------------------------------------------------------------------


def test_a_stalled_subscriber_does_not_hold_the_flight_up(domain: Domain, reference: Reference) -> None:
    """It stops forever; at the end the simulator waits five seconds for it to receive the last /clock."""
    counter = domain.start("topic_count", topics="[/clock, /lander_control/engine, /lander_control/state]")
    counter.wait_for("waiting for topics")
    controller, sim, bag = start(domain, timeout_s=3.0, speed=8.0)
    counter.signal(signal.SIGSTOP)
    assert (sim.finish(), controller.finish()) == (0, 0), sim.err + controller.err
    assert digest(bag) == digest(reference(SEED, DURATION))
