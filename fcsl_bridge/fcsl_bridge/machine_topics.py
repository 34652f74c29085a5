# SPDX-License-Identifier: Apache-2.0
"""A hosted machine as ROS 2 topics. The runtime makes the bytes, the same that it records; this file publishes
them at the ticks at which they are due.

Topics below the node's namespace, all stamped with the time of the tick (time_ns below; in lock-step the machine's own time):
    <machine>/<instance>      its generated message       each tick, or each n-th with decimation; of published instances
    <machine>/state           fcsl_msgs/MachineState      at the start and on change; transient local
    <machine>/transitions     fcsl_msgs/TransitionEvent   each one
    <machine>/health          fcsl_msgs/InstanceHealth    at the start and on change; transient local
    <machine>/faults          fcsl_msgs/FaultCounters     at the start and on change; transient local
"""

from __future__ import annotations

import struct
import time

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message

from fcsl_msgs.msg import FaultCounters, InstanceHealth, MachineState, TransitionEvent
from simclient.run import Run

from . import qos
from .interfaces import instance_class
from .node_main import wait_for_receivers

#: Latched topics, and their types.
_LATCHED = {"state": MachineState, "health": InstanceHealth, "faults": FaultCounters}
_STAMP = struct.Struct("<iI")
_STAMP_OFFSET = 4
_NS = 1_000_000_000
#: Of the lease that qos.WATCHED has, several.
_ALIVE_PERIOD_S = 0.4
#: For the receivers of the last messages of a run, in s.
_END_S = 5.0
#: Encapsulation, stamp, empty frame_id and tick: the part that differs between messages with equal content.
_HEAD_BYTES = 4 + 8 + 8 + 8


class MachineTopics:
    """Publishes the topics of a run. Raises BridgeError if a message type is missing or differs from the machine's."""

    def __init__(self, node: Node, run: Run, decimation: int):
        self._node, self._run, self._decimation = node, run, decimation
        machine = run.machine
        kinds = [(instance, instance_class(instance)) for instance in machine.instances if instance.published]
        self._outputs = [
            (instance.index, qos.publisher(node, kind, f"{machine.name}/{instance.name}", qos.STREAM))
            for instance, kind in kinds
        ]
        self._latched = {
            topic: qos.publisher(
                node, kind, f"{machine.name}/{topic}", qos.WATCHED if topic == "state" else qos.LATCHED
            )
            for topic, kind in _LATCHED.items()
        }
        self._lived_s = 0.0
        self._transitions = qos.publisher(node, TransitionEvent, f"{machine.name}/transitions", qos.EVENT)
        self._said = dict.fromkeys(_LATCHED, b"")

    @property
    def all(self) -> list[Publisher]:
        return [*(publisher for _, publisher in self._outputs), *self._latched.values(), self._transitions]

    def say_alive(self) -> None:
        """Keeps the publisher of the state alive; call it often."""
        if time.monotonic() - self._lived_s > _ALIVE_PERIOD_S:
            self._lived_s = time.monotonic()
            self._latched["state"].assert_liveliness()

    def publish_latched(self, time_ns: int) -> None:
        """Publishes latched topics whose content has changed."""
        for topic, publisher in self._latched.items():
            data = self._run.tick_message(topic)
            if data[_HEAD_BYTES:] != self._said[topic]:
                self._said[topic] = data[_HEAD_BYTES:]
                publisher.publish(_stamped(data, time_ns))

    def publish_changes(self, time_ns: int) -> TransitionEvent | None:
        """As publish_latched, after a tick; also publishes and returns the transition that the tick latched, if any."""
        self.publish_latched(time_ns)
        event = self._run.tick_message("transitions")
        if not event:
            return None
        self._transitions.publish(_stamped(event, time_ns))
        return deserialize_message(event, TransitionEvent)

    def publish_outputs(self, tick: int, time_ns: int) -> None:
        """Publishes the outputs of `tick`, the last completed one, unless decimation leaves it out."""
        if tick % self._decimation == 0:
            for index, publisher in self._outputs:
                publisher.publish(_stamped(self._run.message(index), time_ns))

    def wait_for_receivers(self) -> None:
        """Returns when all have what was published, or after a time: a publisher that is destroyed sends nothing again."""
        wait_for_receivers(self.all, _END_S)

    def close(self) -> None:
        for publisher in self.all:
            self._node.destroy_publisher(publisher)


def _stamped(data: bytes, time_ns: int) -> bytes:
    """The message with another stamp: the runtime stamps with the machine's time only."""
    return data[:_STAMP_OFFSET] + _STAMP.pack(*divmod(time_ns, _NS)) + data[_STAMP_OFFSET + _STAMP.size :]
