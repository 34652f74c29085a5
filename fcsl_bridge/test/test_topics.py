# SPDX-License-Identifier: Apache-2.0
"""The topics of a controller: names, types, stamps, quality of service, the recorded bytes."""

from __future__ import annotations

import functools
import math
import struct
from typing import Any

import pytest
from bridge_harness import MACHINE, Domain, HandSimulator, Listener
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock

from fcsl_bridge.base.machine_index import find_machine
from fcsl_bridge.errors import BridgeError
from fcsl_bridge.topics import qos
from fcsl_bridge.topics.interfaces import instance_class, message_class
from fcsl_msgs.msg import FaultCounters, InstanceHealth, MachineState, TransitionEvent
from simclient.bag import Bag
from simclient.c_machine import TYPE_FORMATS
from simclient.descriptor import Instance
from simclient.run import Run, open_run


def open_lander() -> Run:
    return open_run(*find_machine(MACHINE))


@functools.cache
def instances() -> list[str]:
    run = open_lander()
    names = [instance.name for instance in run.machine.instances]
    run.close()
    return names


def field_values(run: Run, instance: Instance) -> dict[str, list[Any]]:
    """Outputs by name, read from the machine struct."""
    values = {}
    for field in run.machine.fields.values():
        if field.role == "output" and field.instance == instance.name:
            data = run.read(field.offset, field.size)
            values[field.path.split(".outputs.")[1]] = list(
                struct.unpack(f"={field.count}{TYPE_FORMATS[field.type]}", data)
            )
    return values


def test_messages_hold_what_the_machine_holds() -> None:
    run = open_lander()
    altitude = run.machine.fields["sensors.outputs.pos_z"].index
    for step in range(5):
        run.set(altitude, 0, struct.pack("=d", 0.1 * step))
        run.step(1)
    for instance in run.machine.instances:
        message = deserialize_message(run.message(instance.index), instance_class(instance))
        assert message.tick == 4
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (0, 40_000_000)
        assert message.header.frame_id == ""
        values = field_values(run, instance)
        shown = set(message.get_fields_and_field_types()) - {"header", "tick"}
        assert set(values) - shown <= {"transition_request"}  # published only by instances that make requests
        for name in shown:
            expected = values[name]
            found = getattr(message, name)
            found = list(found) if hasattr(found, "__len__") else [found]
            assert len(found) == len(expected)
            for a, b in zip(found, expected, strict=True):
                assert a == b or (math.isnan(a) and math.isnan(b)), f"{instance.name}.{name}"
    run.close()


def test_tick_messages_before_the_first_tick() -> None:
    run = open_lander()
    state = deserialize_message(run.tick_message("state"), MachineState)
    assert (state.tick, state.state, state.next_state) == (0, "ASCENT", "ASCENT")
    health = deserialize_message(run.tick_message("health"), InstanceHealth)
    assert list(health.instance) == instances() and len(health.health) == len(instances())
    assert run.tick_message("transitions") == b""
    run.close()


@pytest.mark.parametrize(
    ("type_name", "message"),
    [("no_such_package/msg/Thing", "has no ROS 2 messages"), ("fcsl_msgs/msg/NoSuchThing", "does not exist")],
)
def test_missing_message(type_name: str, message: str) -> None:
    with pytest.raises(BridgeError, match=message):
        message_class(type_name)


def test_message_of_another_build_is_refused() -> None:
    run = open_lander()
    engine = next(i for i in run.machine.instances if i.name == "engine")
    other = Instance(**{**engine.__dict__, "message_text": engine.message_text + "float64 added\n"})
    with pytest.raises(BridgeError, match="is not the one that instance `engine` was compiled with"):
        instance_class(other)
    run.close()


def start(domain: Domain, **parameters: Any) -> tuple[Listener, HandSimulator, Any]:
    """A controller with the test as simulator; it runs no tick before the test's subscriptions are matched."""
    listener = domain.listener()
    sim = domain.simulator(listener)
    run = open_lander()
    for instance in run.machine.instances:
        listener.subscribe(instance_class(instance), f"/lander_control/{instance.name}", qos.STREAM)
    run.close()
    for topic, kind in (("state", MachineState), ("health", InstanceHealth), ("faults", FaultCounters)):
        listener.subscribe(kind, f"/lander_control/{topic}", qos.LATCHED)
    listener.subscribe(TransitionEvent, "/lander_control/transitions", qos.EVENT)
    limits = {"wait_for_subscribers": 1, "timeout_s": 60.0}
    bag = domain.folder / "bag"
    controller = domain.start("controller_node", machine=MACHINE, record=bag, **limits, **parameters)
    return listener, sim, controller


def test_outputs_are_the_recorded_bytes_at_every_tick(domain: Domain) -> None:
    listener, sim, controller = start(domain)
    for _ in range(120):
        sim.tick()
    listener.until(lambda: len(listener.received["/lander_control/engine"]) == 120)
    sim.end()
    assert controller.finish() == 0
    bag = Bag(domain.folder / "bag")
    recorded: dict[str, list[bytes]] = {}
    for topic, _, data in bag.messages():
        recorded.setdefault(topic, []).append(bytes(data))
    for topic in (f"/lander_control/{name}" for name in instances()):
        size = len(recorded[topic][0])  # the same in every tick; DDS pads a message to whole words
        assert [data[:size] for data in listener.received[topic]] == recorded[topic], topic
    stamps = [struct.unpack_from("<iI", data, 4) for data in listener.received["/lander_control/engine"]]
    assert stamps == [divmod(k * 10**9 // 100, 10**9) for k in range(120)]


def test_decimation_applies_to_outputs_only(domain: Domain) -> None:
    listener, sim, controller = start(domain, decimate=10)
    for _ in range(101):
        sim.tick()
    listener.until(lambda: len(listener.received["/lander_control/engine"]) == 11)
    sim.end()
    assert controller.finish() == 0
    ticks = [struct.unpack_from("<Q", data, 20)[0] for data in listener.received["/lander_control/engine"]]
    assert ticks == list(range(0, 101, 10))
    assert Bag(domain.folder / "bag").topics["/lander_control/engine"].count == 101


def test_state_reaches_a_late_subscriber_and_clock_makes_no_tick(domain: Domain) -> None:
    listener, sim, controller = start(domain)
    clock = listener.node.create_publisher(Clock, "/clock", qos.STREAM)
    for second in range(100):
        clock.publish(Clock(clock=Time(sec=second)))
    while sim.sim.tick < 690:
        sim.tick()
    late = domain.listener()
    late.subscribe(MachineState, "/lander_control/state", qos.LATCHED)
    late.subscribe(InstanceHealth, "/lander_control/health", qos.LATCHED)
    late.until(lambda: all(late.received.values()))
    state = deserialize_message(late.received["/lander_control/state"][-1], MachineState)
    assert (state.state, state.next_state) == ("COAST", "COAST")
    assert state.header.stamp.sec * 100 + state.header.stamp.nanosec // 10**7 == state.tick
    listener.until(lambda: bool(listener.received["/lander_control/transitions"]))
    event = deserialize_message(listener.received["/lander_control/transitions"][0], TransitionEvent)
    assert (event.from_state, event.to_state, event.request, event.instance) == (
        "ASCENT",
        "COAST",
        "START_COAST",
        "ascent",
    )
    assert state.tick == event.tick + 1
    sim.end()
    assert controller.finish() == 0


def test_quality_of_service(domain: Domain) -> None:
    listener, sim, controller = start(domain)

    def offered(topic: str) -> Any:
        listener.until(lambda: listener.node.count_publishers(f"/lander_control/{topic}") == 1)
        (publisher,) = listener.node.get_publishers_info_by_topic(f"/lander_control/{topic}")
        return publisher.qos_profile

    for topic in (*("state", "health", "faults"), "engine", "transitions"):
        assert offered(topic).reliability == ReliabilityPolicy.RELIABLE
        latched = topic in ("state", "health", "faults")
        wanted = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        assert offered(topic).durability == wanted, topic
    sim.meet()
    sim.end()
    assert controller.finish() == 0


def test_diagnostics_once_per_second(domain: Domain) -> None:
    listener, sim, controller = start(domain)
    listener.subscribe(DiagnosticArray, "/diagnostics", qos.EVENT)
    received = listener.received["/diagnostics"]
    listener.until(lambda: len(received) >= 1)  # the period is wall time: it passes without ticks, too
    before = len(received)
    for _ in range(3):
        sim.tick()
    listener.until(lambda: len(received) >= before + 3)  # one of these may have been sent before the first tick
    sim.end()
    assert controller.finish() == 0
    arrays = [deserialize_message(data, DiagnosticArray) for data in received]
    stamps = [(a.header.stamp.sec, a.header.stamp.nanosec) for a in arrays]
    assert stamps == sorted(stamps), "stamps are simulated time, though the period is wall time"
    assert arrays[0].status[0].level == DiagnosticStatus.STALE, "nothing has run before the first tick"
    machine, *others = arrays[-1].status
    assert machine.name == "lander_control" and machine.level == DiagnosticStatus.OK
    assert machine.message in ("ASCENT", "COAST", "DESCENT")
    assert [s.name for s in others] == [f"lander_control: {name}" for name in (*instances(), "requirements")]
    assert {pair.key: pair.value for pair in others[0].values} == {"faults": "0", "overruns": "0", "fault place": ""}
