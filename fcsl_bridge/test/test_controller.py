# SPDX-License-Identifier: Apache-2.0
"""The controller's lifecycle and services, in lock-step with the test as simulator, and alone."""

from __future__ import annotations

import os
import re
import signal
import struct
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import rig
from bridge_harness import MACHINE, Domain, HandSimulator, Process
from controller_client import (
    ACTIVATE,
    CLEANUP,
    CONFIGURE,
    DEACTIVATE,
    SHUTDOWN,
    ControllerClient,
    figures,
)
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.serialization import deserialize_message

from fcsl_bridge.topics import qos
from fcsl_bridge.topics.interfaces import instance_class
from fcsl_msgs.msg import Checkpoint, MachineState
from fcsl_msgs.srv import InjectFault, Restore, Save, SetState
from simclient import AlgTwin
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.replay import replay

#: `make verify EFFORT=full` runs more cycles.
CYCLES = 20 if os.environ.get("FCSL_VERIFY", "") in ("", "0") else 1000
FAULT, OVERRUN, DROPOUT = InjectFault.Request.FAULT, InjectFault.Request.OVERRUN, InjectFault.Request.DROPOUT


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.build(tmp_path_factory.mktemp("rig"))


def locked(domain: Domain, **parameters: Any) -> tuple[Process, ControllerClient, HandSimulator]:
    """A lander's controller, and the test as its simulator."""
    listener = domain.listener()
    sim = domain.simulator(listener)
    process = domain.start("controller_node", machine=MACHINE, record=domain.folder / "bag", **parameters)
    return process, ControllerClient(listener, "/lander_control"), sim


def free(domain: Domain, library: Path, **parameters: Any) -> tuple[Process, ControllerClient]:
    process = domain.start("controller_node", machine=library, mode="realtime", **parameters)
    return process, ControllerClient(domain.listener())


# ---- lifecycle -------------------------------------------------------------------------------------------------------


def test_a_manager_leads_the_node_through_its_states(domain: Domain) -> None:
    process, client, sim = locked(domain, autostart=False)
    assert client.state == "unconfigured"
    assert not client.change(ACTIVATE), "a transition that the state does not have is refused"
    assert client.change(CONFIGURE) and client.state == "inactive"
    assert not sim.sim.accept(300), "an inactive node does not tick"
    assert client.change(ACTIVATE) and client.state == "active"
    for _ in range(51):
        sim.tick()
    assert client.change(DEACTIVATE) and client.change(ACTIVATE), "it continues at the next tick"
    for _ in range(50):
        sim.tick()
    sim.end()
    sim.listener.until(lambda: client.state == "inactive")
    assert client.change(CLEANUP) and client.state == "unconfigured"
    assert Bag(domain.folder / "bag").topics["/lander_control/engine"].count == 101
    assert client.change(SHUTDOWN["unconfigured"])
    assert process.finish() == 0


def test_a_node_that_is_started_again_begins_the_next_bag(domain: Domain, library: Path) -> None:
    """A robot's controller flies on, whoever starts it again; what exists is left alone."""
    bag = domain.folder / "bag"
    bag.write_text("mine")
    for name in ("bag_2", "bag_3", "bag_4"):
        process, client = free(domain, library, record=bag)
        client.diagnosed()
        number = signal.SIGKILL if name == "bag_2" else signal.SIGINT
        process.signal(number)
        assert process.finish() == (-number if number == signal.SIGKILL else 0)
        assert sorted(path.name for path in domain.folder.glob("bag*"))[-1] == name
    assert bag.read_text() == "mine"


def test_a_bag_that_cannot_be_begun(domain: Domain, library: Path) -> None:
    """The node stays inactive, and may be activated later."""
    bag = domain.folder / "later" / "bag"
    process, client = free(domain, library, autostart=False, record=bag)
    assert client.change(CONFIGURE)
    for _ in range(2):
        assert not client.change(ACTIVATE) and client.state == "inactive"
    bag.parent.mkdir()
    assert client.change(ACTIVATE) and bag.is_dir()
    process.signal(signal.SIGINT)
    assert process.finish() == 0


def test_a_folder_of_checkpoints_must_be_there(domain: Domain, library: Path) -> None:
    process = domain.start("controller_node", machine=library, mode="realtime", checkpoints=domain.folder / "none")
    assert process.finish() == 1
    assert f"parameter `checkpoints`: there is no folder {domain.folder / 'none'}" in process.err


@pytest.mark.parametrize("state", list(SHUTDOWN))
def test_shutdown_from_any_state(domain: Domain, library: Path, state: str) -> None:
    bag = domain.folder / "bag"
    process, client = free(domain, library, autostart=False, record=bag)
    for transition in {"unconfigured": (), "inactive": (CONFIGURE,), "active": (CONFIGURE, ACTIVATE)}[state]:
        assert client.change(transition)
    assert client.state == state
    if state == "active":
        client.diagnosed()
    assert client.change(SHUTDOWN[state])
    assert process.finish() == 0
    if state == "active":
        assert replay(bag, library=str(library)).identical


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("state", ["inactive", "active"])
def test_a_signal_closes_the_bag(domain: Domain, library: Path, state: str, number: int) -> None:
    bag = domain.folder / "bag"
    process, client = free(domain, library, autostart=False, record=bag)
    assert client.change(CONFIGURE) and client.change(ACTIVATE)
    client.diagnosed()
    if state == "inactive":
        assert client.change(DEACTIVATE)
    process.signal(number)
    assert process.finish() == 0
    assert "interrupted: " in process.out and f"recorded to {bag}" in process.out
    assert replay(bag, library=str(library)).identical


def test_a_signal_at_any_moment_leaves_a_bag_or_none(domain: Domain, library: Path) -> None:
    """From process start on, before ROS is imported."""
    for number, delay_s in enumerate((0.05, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2)):
        bag = domain.folder / f"bag{number}"
        process = domain.start("controller_node", machine=library, mode="realtime", record=bag)
        time.sleep(delay_s)
        process.signal(signal.SIGTERM)
        status = process.finish()
        if bag.exists():
            assert status == 0 and (bag / "metadata.yaml").is_file(), delay_s


def test_what_fails_leads_back_to_unconfigured(domain: Domain, library: Path) -> None:
    later = domain.folder / "later" / library.name
    process = domain.start("controller_node", machine=later, autostart=False, start_timeout_s=0.3)
    client = ControllerClient(domain.listener(), "/controller_node")
    assert not client.change(CONFIGURE) and client.state == "unconfigured"
    process.wait_for(f"no such library: {later}")
    later.parent.symlink_to(library.parent)
    for _ in range(2):
        assert client.change(CONFIGURE) and client.change(ACTIVATE)
        process.wait_for("no simulator within 0.3 s")
        client._listener.until(lambda: client.state == "unconfigured")
    process.signal(signal.SIGINT)
    assert process.finish() == 0


def test_a_machine_without_its_messages_is_refused(domain: Domain, tmp_path: Path) -> None:
    """Before any of its entities is in the graph."""
    process, client = free(domain, rig.build(tmp_path, publish=("pilot",)), autostart=False)
    assert not client.change(CONFIGURE) and client.state == "unconfigured"
    process.wait_for("message rig/msg/RigPilot: package `rig` has no ROS 2 messages in this environment")
    assert not any("." in name for name in client.names())
    process.signal(signal.SIGINT)
    assert process.finish() == 0


def test_topics_and_services_come_and_go(domain: Domain, library: Path) -> None:
    """Configure creates them: after cleanup the graph is as before."""
    _, client = free(domain, library, autostart=False)

    def graph() -> set[str]:
        node = client._listener.node
        if "rig" not in node.get_node_names():
            return set()  # not discovered yet
        services = node.get_service_names_and_types_by_node("rig", "/")
        topics = node.get_publisher_names_and_types_by_node("rig", "/")
        taken = node.get_subscriber_names_and_types_by_node("rig", "/")
        return {name for name, _ in (*services, *topics, *taken)}

    lifecycle = (
        "change_state get_available_states get_available_transitions get_state get_transition_graph transition_event"
    )
    parameters = "describe_parameters get_parameter_types get_parameters list_parameters set_parameters"
    own = f"{lifecycle} {parameters} set_parameters_atomically".split()
    before = {"/rosout", "/parameter_events", *(f"/rig/{name}" for name in own)}
    assert client.state == "unconfigured"
    client._listener.until(lambda: graph() == before)
    assert client.change(CONFIGURE)
    made = {
        "/motor/torque",
        "/imu/data",
        "/rig/state",
        "/rig/health",
        "/rig/faults",
        "/rig/transitions",
        "/diagnostics",
    }
    made |= {f"/rig/{name}" for name in ("describe", "set_state", "save", "restore", "inject_fault")}
    client._listener.until(lambda: graph() == before | made)
    assert client.change(CLEANUP)
    client._listener.until(lambda: graph() == before)


def test_two_of_one_name_say_so(domain: Domain, library: Path) -> None:
    """A node is called like its machine, or as the user says; a machine that cannot be found names none."""
    one, client = free(domain, library)
    assert client.state == "active"
    other = domain.start("controller_node", "-r", "__node:=other", machine=library, mode="realtime")
    assert ControllerClient(domain.listener(), "/other").state == "active"
    assert domain.start("controller_node", machine="none/none").finish() == 1
    two = domain.start("controller_node", machine=library, mode="realtime")
    for process in (one, two):
        process.wait_for("another node is called /rig, too: parameters and services reach either")
    assert "is called" not in other.err


def grown(process: Process) -> tuple[int, int]:
    """Resident kilobytes and open files."""
    status = Path(f"/proc/{process.process.pid}/status").read_text()
    (resident,) = (int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))
    return resident, len(list(Path(f"/proc/{process.process.pid}/fd").iterdir()))


def test_cycles_leave_nothing_behind(domain: Domain, library: Path) -> None:
    process, client = free(domain, library, autostart=False)

    def cycle(count: int) -> None:
        for _ in range(count):
            assert all(client.change(transition) for transition in (CONFIGURE, ACTIVATE, DEACTIVATE, CLEANUP))

    cycle(20)  # pools fill
    found = [grown(process)]
    for _ in range(3):  # what leaks grows each time; allocators, which fetch a MiB now and then, do not
        cycle(CYCLES)
        found.append(grown(process))
    assert all(files <= found[0][1] for _, files in found)
    growth = [later - memory for (memory, _), (later, _) in pairwise(found)]
    assert min(growth) < 500 + 4 * CYCLES, f"{growth} kB"


class Watcher:
    """Asks the publisher of a state for signs of life, and collects its messages and events."""

    def __init__(self, client: ControllerClient, topic: str):
        self.alive: list[int] = []  #: numbers of live publishers
        self.missed: list[int] = []  #: numbers of deadlines missed
        self.states: list[bytes] = []
        client._listener.node.create_subscription(
            MachineState,
            topic,
            self.states.append,
            qos.WATCHED,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=lambda event: self.alive.append(event.alive_count),
                deadline=lambda event: self.missed.append(event.total_count),
            ),
        )


def test_a_watcher_learns_of_a_dead_controller(domain: Domain) -> None:
    """By liveliness and by deadline, within seconds and not DDS's 20 s; a flight that pauses is not dead."""
    process, client, sim = locked(domain, timeout_s=60.0)
    watcher = Watcher(client, "/lander_control/state")
    sim.tick()
    client._listener.until(lambda: watcher.alive[-1:] == [1] and bool(watcher.states))
    count, paused_until_s = len(watcher.states), time.monotonic() + 5.0
    client._listener.until(lambda: sim.sim.keep_alive() or time.monotonic() > paused_until_s)
    assert watcher.alive[-1:] == [1] and not watcher.missed
    assert len(watcher.states) - count >= 5, "the state is sent again at least once a second"
    assert len({bytes(state[: state.rindex(b"\0")]) for state in watcher.states[count:]}) == 1, "the same one"
    for number, dead in ((signal.SIGSTOP, True), (signal.SIGCONT, False), (signal.SIGKILL, True)):
        begun, missed = time.monotonic(), len(watcher.missed)
        process.signal(number)
        client._listener.until(lambda dead=dead: watcher.alive[-1:] == [0 if dead else 1])
        client._listener.until(lambda dead=dead, missed=missed: not dead or len(watcher.missed) > missed)
        assert time.monotonic() - begun < 12.0


def test_a_controller_that_waits_for_subscribers_or_is_inactive_is_alive(domain: Domain, library: Path) -> None:
    _, client = free(domain, library, wait_for_subscribers=9)
    waiting = Watcher(client, "/rig/state")
    client._listener.until(lambda: waiting.alive[-1:] == [1])
    domain.start("controller_node", "-r", "__ns:=/b", machine=library, mode="realtime", autostart=False)
    client = ControllerClient(domain.listener(), "/b/rig")
    inactive = Watcher(client, "/b/rig/state")
    assert client.change(CONFIGURE)
    client._listener.until(lambda: inactive.alive[-1:] == [1])
    assert client.change(ACTIVATE) and client.change(DEACTIVATE)
    client._listener.until(lambda: bool(inactive.states))
    count = len(inactive.states)
    client._listener.until(lambda: len(inactive.states) >= count + 3)
    assert not inactive.missed


def test_rosout_has_transitions_and_what_ended_the_node(domain: Domain, library: Path) -> None:
    """Its last words reach whoever has had an earlier one."""
    process, _, sim = locked(domain, timeout_s=10.0)
    sim.listener.subscribe(Log, "/rosout", qos.LATCHED_HISTORY)
    said = sim.listener.received["/rosout"]

    def until_said(text: str) -> None:
        sim.listener.until(lambda: any(text in deserialize_message(message, Log).msg for message in said))

    ticks = 0
    while not said:
        sim.tick()
        ticks += 1
    until_said(f"no time message of tick {ticks} within 10000 ms")
    assert process.finish() == 1
    domain.start("controller_node", machine=library, mode="realtime")
    until_said("IDLE -> FLY")


# ---- a new run -------------------------------------------------------------------------------------------------------


def test_a_new_run_starts_over_with_the_parameters_that_hold(domain: Domain) -> None:
    """Also during a run: initial state, the next bag."""
    process, client, sim = locked(domain, timeout_s=60.0)
    for _ in range(20):
        sim.tick()
    assert client.set(ascent__gain=2.0).successful
    bag = domain.folder / "bag"
    for _ in range(2):
        sim.end(another_follows=True)
        sim = domain.simulator(domain.listener())
        for _ in range(30):
            sim.tick()
    assert client.get("ascent.gain") == 2.0
    sim.end()
    assert process.finish() == 0
    assert f"30 ticks, 0.300 s; recorded to {bag}_3" in process.out
    assert Bag(bag).topics["/lander_control/engine"].count == 20
    assert digest(Path(f"{bag}_2")) == digest(Path(f"{bag}_3"))


# ---- services --------------------------------------------------------------------------------------------------------


def test_states_are_forced_only_where_that_is_allowed(domain: Domain, library: Path) -> None:
    _, client = free(domain, library)
    for kind, service, fields in ((SetState, "set_state", {"state": "FLY"}), (Restore, "restore", {"file": "x"})):
        answer = client.call(kind, service, **fields)
        assert not answer.success and "allow_set_state:=true" in answer.message
    answer = client.call(Save, "save", file="x")
    assert not answer.success and "checkpoints:=<folder>" in answer.message


def test_set_state(domain: Domain, library: Path) -> None:
    bag = domain.folder / "bag"
    process, client = free(domain, library, allow_set_state=True, record=bag)
    client._listener.subscribe(MachineState, "/rig/state", qos.LATCHED)
    states = client._listener.received["/rig/state"]
    answer = client.call(SetState, "set_state", state="FLI")
    assert not answer.success and answer.message == "no state `FLI`; did you mean `FLY`?"
    assert client.call(SetState, "set_state", state="FLY").success
    client._listener.until(lambda: bool(states) and deserialize_message(states[-1], MachineState).state == "FLY")
    process.signal(signal.SIGINT)
    assert process.finish() == 0
    assert "s  IDLE -> FLY" in process.err, "it logs its transitions"
    assert replay(bag, library=str(library)).identical


def test_save_and_restore(domain: Domain, library: Path) -> None:
    """Free-running, where the tick may go back; by file, by message, and into a twin."""
    bag = domain.folder / "bag"
    process, client = free(domain, library, allow_set_state=True, record=bag, checkpoints=domain.folder)
    assert client.call(SetState, "set_state", state="FLY").success
    file = domain.folder / "checkpoint"
    saved = client.call(Save, "save", file=file.name)
    assert saved.success and saved.checkpoint.machine == "rig" and saved.checkpoint.tick > 0
    with AlgTwin.from_library(library) as twin:
        twin.restore(file.read_bytes())
        assert twin.get_value("machine.tick") == saved.checkpoint.tick
        assert twin.get_value("machine.state") in ("IDLE", "FLY")
    again = client.call(Save, "save", file=file.name)
    assert not again.success and "File exists" in again.message
    assert client.call(Restore, "restore", file=file.name).success
    assert client.call(Restore, "restore", checkpoint=saved.checkpoint).success
    foreign = Checkpoint(layout_hash="0" * 64, data=saved.checkpoint.data)
    answer = client.call(Restore, "restore", checkpoint=foreign)
    assert not answer.success and "another layout than `rig`" in answer.message
    damaged = Checkpoint(layout_hash=saved.checkpoint.layout_hash, data=list(saved.checkpoint.data)[:-1])
    assert not client.call(Restore, "restore", checkpoint=damaged).success
    file.write_bytes(b"nonsense")
    assert "not a checkpoint" in client.call(Restore, "restore", file=file.name).message
    os.mkfifo(domain.folder / "fifo")
    assert "not a regular file" in client.call(Restore, "restore", file="fifo").message
    for path in (str(file), f"../{file.name}", ".."):
        assert "not a file's name" in client.call(Save, "save", file=path).message
    process.signal(signal.SIGINT)
    assert process.finish() == 0
    assert replay(bag, library=str(library)).identical


def test_in_lockstep_a_checkpoint_of_another_tick_is_refused(domain: Domain) -> None:
    process, client, sim = locked(domain, allow_set_state=True, timeout_s=60.0)
    for _ in range(10):
        sim.tick()
    saved = client.call(Save, "save").checkpoint
    assert saved.tick == 10 and client.call(Restore, "restore", checkpoint=saved).success
    sim.tick()
    answer = client.call(Restore, "restore", checkpoint=saved)
    assert not answer.success and "of tick 10, and the simulator is at tick 11" in answer.message
    sim.tick()
    sim.end()
    assert process.finish() == 0
    assert replay(domain.folder / "bag", library=str(lander_library())).identical


def lander_library() -> Path:
    from fcsl_bridge.base.machine_index import find_machine

    return find_machine(MACHINE)[0]


def test_injected_faults_are_seen_and_replay(domain: Domain) -> None:
    process, client, sim = locked(domain, timeout_s=60.0)
    client._listener.subscribe(instance_class(instance("sensors")), "/lander_control/sensors", qos.STREAM)
    client._listener.subscribe(DiagnosticArray, "/diagnostics", qos.EVENT)
    for _ in range(3):
        sim.tick()
    for fields, message in (
        ({"kind": 7, "name": "nav"}, "no kind 7; there are FAULT 0, OVERRUN 1, DROPOUT 2"),
        ({"kind": FAULT, "name": "sensros"}, "no instance `sensros`; did you mean `sensors`"),
        ({"kind": OVERRUN, "name": "sensors"}, "has no max_wcet_us"),
        ({"kind": DROPOUT, "name": "altimter"}, "no sensor channel `altimter`"),
    ):
        answer = client.call(InjectFault, "inject_fault", **fields)
        assert not answer.success and message in answer.message, answer
    assert client.call(InjectFault, "inject_fault", kind=FAULT, name="sensors").success
    channel = sim.sim.machine.channels[0].name
    assert client.call(InjectFault, "inject_fault", kind=DROPOUT, name=channel, ticks=5).success
    ticks = 0
    while ticks < 20 or not (told := _told_of_faults(client, "sensors")):
        sim.tick()
        time.sleep(0.02)  # diagnostics come once per second of wall time
        ticks += 1
    sim.end()
    assert process.finish() == 0
    assert told[0].endswith("; 1 faults; injected") and not any("injected" in message for message in told[1:])
    bag = Bag(domain.folder / "bag")
    counters = [bag.decode(t, data) for t, _, data in bag.messages(["/lander_control/faults"])]
    assert [(c.tick, c.fault_place[c.instance.index("sensors")]) for c in counters] == [(0, ""), (3, "injected")]
    writes = [
        bag.decode_own(topic, data, ("tick", "kind", "path", "element", "data"))
        for topic, _, data in bag.messages()
        if topic == "/lander_control/record/writes"
    ]
    assert [(w.tick, w.path) for w in writes if w.kind == 7] == [(3, "sensors")]
    sampled = [w.tick for w in writes if w.kind == 3 and w.path == channel]
    assert sampled == [*range(3), *range(8, 3 + ticks)]
    assert replay(domain.folder / "bag", library=str(lander_library())).identical


def _told_of_faults(client: Any, name: str) -> list[str]:
    """Messages of the instance's diagnostics from its first fault on."""
    arrays = [deserialize_message(data, DiagnosticArray) for data in client._listener.received["/diagnostics"]]
    found = [status for array in arrays for status in array.status if status.name.endswith(f": {name}")]
    return [s.message for s in found if {v.key: v.value for v in s.values}["fault place"]]


def instance(name: str) -> Any:
    from simclient.run import open_run

    run = open_run(lander_library(), "lander_control")
    found = next(i for i in run.machine.instances if i.name == name)
    run.close()
    return found


def test_faults_are_injected_in_a_simulation_only(domain: Domain, library: Path) -> None:
    process, client = free(domain, library)
    answer = client.call(InjectFault, "inject_fault", kind=FAULT, name="imu")
    assert (
        not answer.success and answer.message == "only where time is simulated: mode lockstep or clock, or use_sim_time"
    )
    process.signal(signal.SIGINT)
    assert process.finish() == 0
    _, client = free(domain, library, use_sim_time=True)
    assert client.call(InjectFault, "inject_fault", kind=FAULT, name="imu").success
    while figures((status := client.diagnosed()[0])["rig: imu"])["faults"] == "0":
        pass
    assert status["rig: imu"].level == DiagnosticStatus.ERROR


# ---- diagnostics -----------------------------------------------------------------------------------------------------


def test_diagnostics_follow_the_lifecycle(domain: Domain, library: Path) -> None:
    _, client = free(domain, library, autostart=False)
    assert client.change(CONFIGURE)
    (message,) = client.diagnosed()
    assert message["rig"].level == DiagnosticStatus.STALE and message["rig"].message == "inactive"
    assert client.change(ACTIVATE)
    while (status := client.diagnosed()[0])["rig"].message.startswith("inactive"):
        pass
    if status["rig"].message.startswith("IDLE"):  # it leaves it within the second
        assert status["rig: pilot"].level == DiagnosticStatus.STALE, "IDLE does not schedule it"
    # The mapped sensor has no publisher: its instance fails, and therefore the machine.
    while (status := client.diagnosed()[0])["rig: imu"].level != DiagnosticStatus.ERROR:
        pass
    assert status["rig"].level == DiagnosticStatus.ERROR
    assert re.fullmatch(
        r"failed; imu\.rate: waiting for its first sample, \d+ ticks so far", status["rig: imu"].message
    )
    shown = figures(status["rig"])
    assert {"state", "tick", "source hash", "deadlines missed", "records dropped", "hal.imu/data taken"} <= set(shown)
    with AlgTwin.from_library(library) as twin:
        assert shown["source hash"] == twin.machine.source_hash
    ticks = sum(int(count) for key, count in shown.items() if key.startswith(("lateness <", "lateness >")))
    assert ticks == int(shown["tick"])


def test_times_of_instances_are_diagnosed(domain: Domain, tmp_path: Path) -> None:
    _, client = free(domain, rig.build(tmp_path, times=True))
    while int(figures(client.diagnosed()[0]["rig: times"])["machine runs"]) == 0:
        pass
    status = client.diagnosed()[0]["rig: times"]
    assert status.level == DiagnosticStatus.OK and status.message.endswith(" % of the step")
    assert int(figures(status)["imu runs"]) <= int(figures(status)["machine runs"])


def test_diagnostics_come_each_second_however_time_goes_in_the_simulator(domain: Domain) -> None:
    """Also while waiting for it, and not more often when it is fast."""
    _, client, sim = locked(domain, timeout_s=60.0)
    before, after = client.diagnosed(2)
    for message in (before, after):
        assert figures(message["lander_control"])["tick"] == "0"
    arrays = client._listener.received["/diagnostics"]
    count, began = len(arrays), time.monotonic()
    while time.monotonic() - began < 2.5:
        sim.tick()
        time.sleep(0.005)  # otherwise the run would end too soon
    stamps = [struct.unpack_from("<iI", data, 4) for data in arrays[count:]]
    assert 1 <= len(stamps) <= 3 and stamps == sorted(stamps) and stamps[-1] > (0, 0)
    client.diagnosed(1)
