# SPDX-License-Identifier: Apache-2.0
"""Control of a simulation: pause, step, reset, speed; several vehicles; controllers that start and stop."""

from __future__ import annotations

import math
import re
import signal
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from bridge_harness import MACHINE, SIM, Domain, Process
from controller_client import ControllerClient, figures
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from fcsl_bridge.simulator.sim_control import Control
from fcsl_bridge.simulator.sim_progress import verdict
from fcsl_bridge.topics import qos
from fcsl_msgs.msg import PlantTruth
from fcsl_msgs.srv import Step
from simclient.bag import Bag
from simclient.bag.digest import digest

SEED = 7
Reference = Callable[[int, str], Path]


def start(domain: Domain, **parameters: Any) -> tuple[Process, Process, ControllerClient]:
    """A recording controller, a simulator, and a client of the simulator's."""
    bag = domain.folder / "bag"
    controller = domain.start("controller_node", machine=MACHINE, record=bag, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, seed=SEED, timeout_s=60.0, **parameters)
    return controller, sim, ControllerClient(domain.listener(), "/sim_node")


def trigger(client: ControllerClient, name: str) -> str:
    answer = client.call(Trigger, name)
    assert answer.success
    return str(answer.message)


def clock_times(domain: Domain, client: ControllerClient) -> list[float]:
    """A list that collects the times of /clock in s, from now on."""
    times: list[float] = []
    listener = client._listener
    listener.node.create_subscription(
        Clock, "/clock", lambda m: times.append(m.clock.sec + m.clock.nanosec / 1e9), qos.STREAM
    )
    return times


def diagnosed(client: ControllerClient) -> DiagnosticStatus:
    """The simulator's next status on /diagnostics after its controller has started."""
    while True:
        status = client.diagnosed()[0].get("sim_node")
        if status is not None and status.message != "waiting":
            return status


# ---- pause, step, reset, speed ---------------------------------------------------------------------------------------------


def test_pauses_steps_and_speeds_change_no_bit(domain: Domain, reference: Reference) -> None:
    controller, sim, client = start(domain, duration="8.0", paused="true", wait_for_subscribers=1)
    times = clock_times(domain, client)
    client._listener.subscribe(PlantTruth, "/sim/truth", qos.STREAM)
    assert "running" not in trigger(client, "pause")
    answer = client.call(Step, "step", ticks=10)
    assert (answer.success, answer.tick) == (True, 10)
    answer = client.call(Step, "step", ticks=3)
    assert (answer.success, answer.tick, answer.message) == (True, 13, "")
    client._listener.until(lambda: bool(times) and times[-1] >= 0.12)
    assert times[-1] == 0.12
    assert not client.call(Step, "step", ticks=0).success
    assert client.set(speed=1).successful and client.get("speed") == 1.0, "as `ros2 param set` sends it"
    assert trigger(client, "resume") == "running, 13 ticks are done" and client.get("paused") is False
    answer = client.call(Step, "step", ticks=1)
    assert not answer.success and "pause it first" in answer.message
    assert client.set(paused=True).successful and client.set(speed=0.0).successful
    assert not client.set(speed=-1.0).successful and not client.set(speed=math.inf).successful
    assert not client.set(seed=8).successful
    trigger(client, "resume")
    assert (sim.finish(), controller.finish()) == (0, 0)
    assert digest(domain.folder / "bag") == digest(reference(SEED, "8.0"))


def test_a_paused_simulation_does_not_time_out_its_controller(domain: Domain) -> None:
    controller = domain.start("controller_node", machine=MACHINE, timeout_s=1.0)
    sim = domain.start("sim_node", sim=SIM, duration="0.2", speed=0.005, timeout_s=60.0)
    client = ControllerClient(domain.listener(), "/sim_node")
    controller.wait_for("waiting for a simulator")
    assert client.set(paused=True).successful
    time.sleep(2.5)
    assert controller.process.poll() is None
    assert client.set(paused=False).successful
    time.sleep(2.5)  # one tick in two seconds
    assert controller.process.poll() is None
    assert client.set(speed=0.0).successful
    assert (sim.finish(), controller.finish()) == (0, 0)


def test_a_killed_paused_simulator_is_noticed(domain: Domain) -> None:
    bag = domain.folder / "bag"
    controller = domain.start("controller_node", machine=MACHINE, record=bag, timeout_s=2.0)
    sim = domain.start("sim_node", sim=SIM, paused="true")
    client = ControllerClient(domain.listener(), "/sim_node")
    assert client.call(Step, "step", ticks=17).tick == 17
    sim.signal(signal.SIGKILL)
    assert controller.finish() == 1
    assert "the simulator went away before tick 17" in controller.err
    assert Bag(bag).topics["/lander_control/engine"].count == 17 and not Bag(bag).truncated


def test_reset_starts_everything_over(domain: Domain, reference: Reference) -> None:
    """Clock and machine go back to tick 0; then follows a complete flight, in a new bag."""
    controller, sim, client = start(domain, duration="8.0", speed=0.5)
    times = clock_times(domain, client)
    node = Node(
        "late",
        context=client._listener.context,
        parameter_overrides=[Parameter("use_sim_time", value=True)],
    )
    client._listener._executor.add_node(node)
    client._listener.until(lambda: len(times) > 50 and node.get_clock().now().nanoseconds > 0)
    assert client.set(paused=True).successful
    before = node.get_clock().now()
    assert "a new run begins" in trigger(client, "reset")
    client._listener.until(lambda: node.get_clock().now() < before)  # though no tick is made yet
    assert client.set(speed=0.0).successful and client.set(paused=False).successful
    assert (sim.finish(), controller.finish()) == (0, 0)
    node.destroy_node()
    assert sorted(times) != times and "reset: a new run begins" in sim.out
    assert digest(domain.folder / "bag_2") == digest(reference(SEED, "8.0")) != digest(domain.folder / "bag")


def test_no_faster_than_its_speed_and_says_how_fast(domain: Domain) -> None:
    controller, sim, client = start(domain, duration="8.0", speed=2.0)
    controller.wait_for("waiting for a simulator")
    shown = figures(diagnosed(client))
    assert set(shown) == {"real time factor", "speed", "tick", "messages dropped"}
    assert float(shown["real time factor"]) < 2.2 and shown["speed"] == "2.0"
    assert (sim.finish(), controller.finish()) == (0, 0)
    assert float(sim.out.rsplit("ticks/s, ", 1)[1].split()[0]) <= 2.1


@pytest.mark.parametrize(
    ("paused", "speed", "tick", "level", "text"),
    [
        (False, 2.0, 9, DiagnosticStatus.WARN, "slower than the speed of 2 that was asked for"),
        (False, 1.0, 9, DiagnosticStatus.OK, "running"),
        (False, 0.0, 9, DiagnosticStatus.OK, "running"),
        (False, 2.0, 0, DiagnosticStatus.OK, "waiting"),
        (True, 2.0, 9, DiagnosticStatus.OK, "paused"),
    ],
)
def test_a_speed_that_is_not_reached_is_a_warning(
    paused: bool, speed: float, tick: int, level: bytes, text: str
) -> None:
    control: Any = SimpleNamespace(paused=paused, speed=speed)
    assert verdict(control, tick, 1.0) == (level, text)


def test_ticks_that_may_run() -> None:
    """All while it runs; while it is paused those that were asked for. A new speed, and the end of a pause, set the pace anew."""
    node = Mock()
    control = Control(node, Mock(), speed=10.0, paused=False)
    (changed,) = node.add_post_set_parameters_callback.call_args.args
    assert control.allowed() > 10**15 and control.pace_changed
    control.pace_changed = False
    changed([Parameter("speed", value=1.0)])
    assert control.pace_changed and control.speed == 1.0
    control.pace_changed = False
    changed([Parameter("paused", value=True)])
    assert control.allowed() == 0 and control.pace_changed


# ---- controllers and simulators that come and go ------------------------------------------------------------------------------


def test_a_killed_controller_ends_the_flight_at_once(domain: Domain) -> None:
    controller, sim, client = start(domain, speed=5.0)
    times = clock_times(domain, client)
    client._listener.until(lambda: len(times) > 20)
    controller.signal(signal.SIGKILL)
    assert sim.finish() == 1 and re.search(r"tick \d+: .*the controller (went away|is gone)", sim.err)


def test_another_simulator_takes_the_place_of_a_killed_one(domain: Domain, reference: Reference) -> None:
    controller, sim, client = start(domain, speed=5.0)
    times = clock_times(domain, client)
    client._listener.until(lambda: len(times) > 20)
    sim.signal(signal.SIGKILL)
    second = domain.start("sim_node", sim=SIM, seed=SEED, duration="8.0", timeout_s=60.0)
    assert (second.finish(), controller.finish()) == (0, 0), second.err + controller.err
    assert digest(domain.folder / "bag_2") == digest(reference(SEED, "8.0"))


def test_two_simulators_at_once(domain: Domain) -> None:
    """The later one finds the address taken."""
    controller, sim, _ = start(domain, speed=1.0)
    sim.wait_for("waiting for a controller")
    other = domain.start("sim_node", "-r", "__node:=other", sim=SIM, seed=SEED, timeout_s=60.0)
    assert other.finish() == 1 and "cannot listen on tcp:127.0.0.1:" in other.err
    assert sim.process.poll() is None and controller.process.poll() is None


def test_a_controller_that_leaves_ends_the_flight_at_once(domain: Domain) -> None:
    controller, sim, client = start(domain, speed=5.0)
    times = clock_times(domain, client)
    client._listener.until(lambda: len(times) > 20)
    controller.signal(signal.SIGINT)
    assert sim.finish() == 1 and re.search(r"tick \d+: .*the controller (ended its run|is gone)", sim.err)
    assert controller.finish() == 0


@pytest.mark.parametrize("delay_s", [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.5])
def test_shutdown_at_any_moment(domain: Domain, delay_s: float) -> None:
    """No traceback, no remaining process."""
    controller, sim, _ = start(domain, speed=1.0)
    time.sleep(delay_s)
    for process in (sim, controller):
        process.signal(signal.SIGTERM)
    # before Python has installed its handlers a signal kills
    assert sim.finish() in (128 + signal.SIGTERM, -signal.SIGTERM, 1)
    assert controller.finish() in (0, -signal.SIGTERM)


# ---- several vehicles -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["bus", "unix"])
def test_several_vehicles_on_one_clock(domain: Domain, reference: Reference, place: str) -> None:
    """On the bus at one address, or each on its own socket beside the other's."""
    counter = domain.start("topic_count", topics="[/clock, /one/sim/truth, /two/sim/truth]")
    bags = {name: domain.folder / name for name in ("one", "two")}
    parameters = {"machine": MACHINE, "timeout_s": 60.0, "wait_for_subscribers": 0, **domain.meeting(place)}
    controllers = [
        domain.start("controller_node", "-r", f"__ns:=/{name}", record=bag, **parameters) for name, bag in bags.items()
    ]
    sim = domain.start(
        "sim_node",
        vehicles="[one, two]",
        sim=SIM,
        seed=SEED,
        duration="8.0",
        timeout_s=60.0,
        wait_for_subscribers=1,
        **domain.meeting(place),
    )
    assert sim.finish() == 0 and [c.finish() for c in controllers] == [0, 0], sim.err
    for number, bag in enumerate(bags.values()):
        assert digest(bag) == digest(reference(SEED + number, "8.0"))
    counter.signal(signal.SIGTERM)
    assert counter.finish() == 0
    assert '{"/clock": 800, "/one/sim/truth": 800, "/two/sim/truth": 800}' in counter.out


def test_a_controller_that_starts_late_takes_no_other_one_down(domain: Domain, reference: Reference) -> None:
    """The other one has answered, and is kept waiting for much longer than its timeout."""
    parameters = {"machine": MACHINE, "timeout_s": 2.5}
    bags = {name: domain.folder / name for name in ("one", "two")}
    two = domain.start("controller_node", "-r", "__ns:=/two", record=bags["two"], **parameters)
    sim = domain.start("sim_node", vehicles="[one, two]", sim=SIM, seed=SEED, duration="2.0", timeout_s=10.0)
    sim.wait_for("waiting for a controller")
    two.wait_for("waiting for a simulator")
    time.sleep(6.0)
    assert two.process.poll() is None, two.err
    one = domain.start("controller_node", "-r", "__ns:=/one", record=bags["one"], **parameters)
    assert [process.finish() for process in (sim, one, two)] == [0, 0, 0], sim.err + one.err + two.err
    for number, bag in enumerate(bags.values()):
        assert digest(bag) == digest(reference(SEED + number, "2.0"))


def test_the_vehicle_that_fails_is_named(domain: Domain) -> None:
    first = domain.start("controller_node", "-r", "__ns:=/one", machine=MACHINE)
    second = domain.start("controller_node", "-r", "__ns:=/two", machine=MACHINE, timeout_s=60.0)
    sim = domain.start("sim_node", vehicles="[one, two]", sim=SIM, timeout_s=2.0)
    for process in (first, second):
        process.wait_for("ASCENT -> COAST")
    second.signal(signal.SIGKILL)
    assert sim.finish() == 1 and re.search(r"two: tick \d+: .*the controller (went away|is gone)", sim.err)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"vehicles": "[one, one]"}, "names a namespace twice"),
        ({"vehicles": "[one, /]"}, "holds namespaces, such as [one, two]"),
        ({"vehicles": "['no space']"}, "ROS 2:"),
        ({"speed": -1.0}, "`speed` must be zero or above"),
        ({"speed": ".nan"}, "`speed` must be zero or above"),
        ({"speed": "fast"}, "parameter `speed` takes"),
        ({"paused": 1}, "parameter `paused` takes"),
        ({"decimate": 0}, "`decimate` must be above zero"),
    ],
)
def test_bad_parameters(domain: Domain, parameters: dict[str, Any], said: str) -> None:
    sim = domain.start("sim_node", sim=SIM, **parameters)
    assert sim.finish() == 1 and said in sim.err


def test_clock_is_its_cdr() -> None:
    from rclpy.serialization import deserialize_message

    from fcsl_bridge.nodes.sim_node import _CLOCK_ZERO

    clock = deserialize_message(_CLOCK_ZERO, Clock)
    assert (clock.clock.sec, clock.clock.nanosec) == (0, 0)
