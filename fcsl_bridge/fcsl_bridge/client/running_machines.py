# SPDX-License-Identifier: Apache-2.0
"""Machines that run on the ROS graph, as a client sees them: who is there, in which state, and what they are."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import rclpy
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.signals import SignalHandlerOptions

from fcsl_msgs.msg import MachineState
from fcsl_msgs.srv import Describe, SetState
from simclient.errors import did_you_mean

from ..errors import BridgeError
from ..loopback import loopback_environment
from ..topics import qos

_DESCRIBE = "fcsl_msgs/srv/Describe"
_STATE = "fcsl_msgs/msg/MachineState"
#: The longest single wait, in s: the graph is looked at again.
_POLL_S = 0.05
#: How long another machine of the same name may take to be found, in s: a command must not go to the wrong one.
_ANOTHER_S = 1.0


@dataclass(frozen=True, order=True)
class Running:
    """A machine by its topics (`/one/lander_control`), and the full name of its node."""

    path: str
    node: str

    @property
    def name(self) -> str:
        return self.path.rpartition("/")[2]


class Watch:
    """The states that a machine publishes. `dead` is called when its controller gave no sign of life for its lease."""

    def __init__(self, node: Node, machine: Running, dead: Callable[[], None] | None = None):
        self._dead = dead
        self.states: list[Any] = []  #: changes only, oldest first
        alive = None if dead is None else SubscriptionEventCallbacks(liveliness=self._lives)
        profile = qos.LATCHED if dead is None else qos.WATCHED
        node.create_subscription(MachineState, f"{machine.path}/state", self._take, profile, event_callbacks=alive)

    def _take(self, message: Any) -> None:
        if not self.states or message != self.states[-1]:  # the node sends it again, as a sign of life
            self.states.append(message)

    def _lives(self, event: Any) -> None:
        if event.alive_count == 0 and event.alive_count_change < 0 and self._dead is not None:
            self._dead()


class _LifeCycle:
    """Whether the node of a machine ticks, as it was when this looked first."""

    def __init__(self, node: Node, machine: Running):
        self._client = node.create_client(GetState, f"{machine.node}/get_state")
        self._answer: Any = None

    def request_state(self) -> None:
        if self._answer is None and self._client.service_is_ready():
            self._answer = self._client.call_async(GetState.Request())

    @property
    def is_active(self) -> bool:
        """Also of a node that has not answered."""
        reported = self._answer.result() if self._answer is not None and self._answer.done() else None
        return reported is None or reported.current_state.id == State.PRIMARY_STATE_ACTIVE


class Graph:
    """A hidden node that looks for machines. Raises BridgeError: each message says what to do."""

    def __init__(self, context: Context):
        self._node = Node(f"_fcsl_{os.getpid()}", context=context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)

    def machines(self) -> list[Running]:
        """Those known by now."""
        found = []
        for service, kinds in self._node.get_service_names_and_types():
            if _DESCRIBE in kinds:
                node = service.rpartition("/")[0]
                found += [Running(path, node) for path in self._paths(node)]
        return sorted(found)

    def _paths(self, node: str) -> list[str]:
        return [topic.removesuffix("/state") for topic, kinds in self.topics(node) if _STATE in kinds]

    def topics(self, node: str) -> list[tuple[str, list[str]]]:
        """What a node publishes: topics and their types. Nothing of a node that is not known yet, or not any more."""
        space, _, name = node.rpartition("/")
        try:
            return sorted(self._node.get_publisher_names_and_types_by_node(name, space or "/"))
        except NodeNameNonExistentError:
            return []

    def states(self, seconds: float) -> dict[Running, str]:
        """The machines that are found within this time, and their states; "" for one that has published none. One that
        does not tick is `inactive`: the state that it published last is that of its last tick.
        """
        watches: dict[Running, Watch] = {}
        cycles = {}

        def poll() -> bool:
            for machine in self.machines():
                if machine not in watches:
                    watches[machine] = Watch(self._node, machine)
                    cycles[machine] = _LifeCycle(self._node, machine)
                cycles[machine].request_state()
            return False

        self.until(poll, seconds)
        states = {m: watch.states[-1].state if watch.states else "" for m, watch in sorted(watches.items())}
        return {
            m: state if cycles[m].is_active else " ".join((state or "-", "(inactive)")) for m, state in states.items()
        }

    def find(self, text: str, timeout_s: float) -> Running:
        """The machine of this name, or of this path where several have the name."""

        def fitting() -> list[Running]:
            return [machine for machine in self.machines() if text in (machine.name, machine.path)]

        self.until(lambda: bool(fitting()), timeout_s)
        if not text.startswith("/"):
            self.until(lambda: len(fitting()) > 1, _ANOTHER_S)
        found = fitting()
        if len(found) > 1:
            raise BridgeError(f"several machines are `{text}`; name one of {', '.join(m.path for m in found)}")
        if not found:
            others = [machine.path for machine in self.machines()]
            close = did_you_mean(text, [*others, *(path.rpartition("/")[2] for path in others)])
            raise BridgeError(f"no machine `{text}` runs{close or _there_are(others)}")
        return found[0]

    def watch(self, machine: Running, dead: Callable[[], None] | None = None) -> Watch:
        return Watch(self._node, machine, dead)

    def state(self, machine: Running, timeout_s: float) -> Any:
        """Its last MachineState."""
        watch = self.watch(machine)
        if not self.until(lambda: bool(watch.states), timeout_s):
            raise BridgeError(
                f"{machine.path} has published no state within {timeout_s:g} s: its controller is inactive, or hangs; "
                f"see `ros2 lifecycle get {machine.node}`"
            )
        return watch.states[-1]

    def describe(self, machine: Running, timeout_s: float) -> Any:
        return self._call(Describe, f"{machine.node}/describe", Describe.Request(), timeout_s)

    def set_state(self, machine: Running, state: str, timeout_s: float) -> None:
        answer = self._call(SetState, f"{machine.node}/set_state", SetState.Request(state=state), timeout_s)
        if not answer.success:
            raise BridgeError(f"{machine.path}: {answer.message}")

    def _call(self, kind: Any, service: str, request: Any, timeout_s: float) -> Any:
        client = self._node.create_client(kind, service)
        deadline = time.monotonic() + timeout_s
        if self.until(client.service_is_ready, timeout_s):
            future = client.call_async(request)
            if self.until(future.done, deadline - time.monotonic()):
                return future.result()
        raise BridgeError(f"{service} did not answer within {timeout_s:g} s: its node is dead, or hangs")

    def until(self, done: Callable[[], bool], timeout_s: float) -> bool:
        """Serves the node until `done` or the time is over; whether it is done."""
        deadline = time.monotonic() + timeout_s
        while not done():
            if time.monotonic() >= deadline:
                return False
            self._executor.spin_once(timeout_sec=_POLL_S)
        return True

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()


def _there_are(paths: list[str]) -> str:
    if paths:
        return f"; there are {', '.join(paths)}"
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    return f"; no controller_node runs in ROS_DOMAIN_ID {domain} on the network that this shell is set to"


@contextmanager
def graph() -> Iterator[Graph]:
    """A graph of this process's domain, with the network settings of the nodes."""
    os.environ.update(loopback_environment(os.environ))
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        opened = Graph(context)
        try:
            yield opened
        finally:
            opened.close()
    finally:
        rclpy.try_shutdown(context=context)
