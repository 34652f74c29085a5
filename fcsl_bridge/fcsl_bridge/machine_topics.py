# SPDX-License-Identifier: Apache-2.0
"""A hosted machine as ROS 2 topics. The bytes come ready from the runtime, the same that it records; this file only hands
them on, at the ticks at which they are due.

Topics below the node's namespace, all stamped with the time of the tick:
    <machine>/<instance>      its generated message       each tick, or each n-th with decimation
    <machine>/state           fcsl_msgs/MachineState      at the start and on change; transient local
    <machine>/transitions     fcsl_msgs/TransitionEvent   each one
    <machine>/health          fcsl_msgs/InstanceHealth    at the start and on change; transient local
    <machine>/faults          fcsl_msgs/FaultCounters     at the start and on change; transient local
"""

from __future__ import annotations

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message

from fcsl_msgs.msg import FaultCounters, InstanceHealth, MachineState, TransitionEvent
from simclient.run import Run

from . import qos
from .interfaces import instance_class

#: Topics that say what holds until it changes, and their types.
_LATCHED = {"state": MachineState, "health": InstanceHealth, "faults": FaultCounters}
#: Encapsulation, stamp, empty frame_id and tick: what differs between two messages that say the same.
_HEAD_BYTES = 4 + 8 + 8 + 8


class MachineTopics:
    """Publishes what a run has to show. Raises BridgeError when a message type is missing or another than the machine's."""

    def __init__(self, node: Node, run: Run, decimation: int):
        self._run, self._decimation = run, decimation
        machine = run.machine
        self.outputs: list[Publisher] = [
            qos.publisher(node, instance_class(instance), f"{machine.name}/{instance.name}", qos.STREAM)
            for instance in machine.instances
        ]
        self._latched = {
            topic: qos.publisher(node, kind, f"{machine.name}/{topic}", qos.LATCHED) for topic, kind in _LATCHED.items()
        }
        self._transitions = qos.publisher(node, TransitionEvent, f"{machine.name}/transitions", qos.EVENT)
        self._said = dict.fromkeys(_LATCHED, b"")

    @property
    def all(self) -> list[Publisher]:
        return [*self.outputs, *self._latched.values(), self._transitions]

    def publish_changes(self) -> TransitionEvent | None:
        """Publishes what differs from what was said last; returns the transition that the last tick latched, if any."""
        for topic, publisher in self._latched.items():
            data = self._run.telemetry(topic)
            if data[_HEAD_BYTES:] != self._said[topic]:
                self._said[topic] = data[_HEAD_BYTES:]
                publisher.publish(data)
        event = self._run.telemetry("transitions")
        if not event:
            return None
        self._transitions.publish(event)
        return deserialize_message(event, TransitionEvent)

    def publish_outputs(self, tick: int) -> None:
        """Publishes the outputs of `tick`, the last completed one, unless decimation leaves it out."""
        if tick % self._decimation == 0:
            for index, publisher in enumerate(self.outputs):
                publisher.publish(self._run.message(index))
