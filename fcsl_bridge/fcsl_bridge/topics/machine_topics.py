# SPDX-License-Identifier: Apache-2.0
"""A configured machine as ROS 2 topics. The runtime makes the messages, the same that it records, at the ticks at which they are
due, and puts them into the publish queue.

Topics below the node's namespace, all stamped with the time of the tick (time_ns below; in lock-step the machine's own time):
    <machine>/<instance>      its generated message       each tick, or each n-th with decimation; of published instances
    <machine>/state           fcsl_msgs/MachineState      at the start and on change, and again as a sign of life; transient local
    <machine>/transitions     fcsl_msgs/TransitionEvent   each one
    <machine>/health          fcsl_msgs/InstanceHealth    at the start and on change; transient local
    <machine>/faults          fcsl_msgs/FaultCounters     at the start and on change; transient local
    <machine>/events          fcsl_msgs/Event             each one, of a machine whose algorithms report any
"""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.publisher import Publisher

from fcsl_msgs.msg import Event, FaultCounters, InstanceHealth, MachineState, TransitionEvent
from simclient.ros.publish_queue import RunTopics
from simclient.run import Run

from ..base.node_main import wait_for_receivers
from . import qos
from .interfaces import instance_class
from .queue_publisher import QueuePublisher

#: Latched topics, and their types.
_LATCHED = {"state": MachineState, "health": InstanceHealth, "faults": FaultCounters}
#: Of the lease and the deadline that qos.WATCHED has, several.
_KEEP_ALIVE_S = 0.5
#: For the receivers of the last messages of a run, in s.
_END_S = 5.0


class MachineTopics:
    """The publishers of a run's topics, each n-th tick with decimation n. `transition` gets the transitions' messages (CDR), `event`
    those of events.

    Raises BridgeError if a message type is missing or differs from the machine's.
    """

    def __init__(
        self,
        node: Node,
        run: Run,
        decimation: int,
        queue_publisher: QueuePublisher,
        messages: RunTopics,
        transition: Callable[[bytes], None],
        event: Callable[[bytes], None],
    ):
        self._node = node
        machine = run.machine
        kinds = [(instance, instance_class(instance)) for instance in machine.instances if instance.published]
        self._latched = {
            topic: qos.publisher(
                node, kind, f"{machine.name}/{topic}", qos.WATCHED if topic == "state" else qos.LATCHED
            )
            for topic, kind in _LATCHED.items()
        }
        self._transitions = qos.publisher(node, TransitionEvent, f"{machine.name}/transitions", qos.EVENT)
        self._events = [qos.publisher(node, Event, f"{machine.name}/events", qos.EVENT)] if machine.event_sites else []
        self._outputs = [
            (instance.index, qos.publisher(node, kind, f"{machine.name}/{instance.topic}", qos.STREAM))
            for instance, kind in kinds
        ]
        self._lived_s = 0.0
        self._state = b""  # the last message
        for topic, publisher in self._latched.items():
            messages.add_tick_message(queue_publisher.add(publisher, self._keep if topic == "state" else None), topic)
        messages.add_tick_message(queue_publisher.add(self._transitions, transition), "transitions")
        for publisher in self._events:
            messages.add_events(queue_publisher.add(publisher, event))
        for index, publisher in self._outputs:
            messages.add_instance(queue_publisher.add(publisher), index, decimation)

    @property
    def all(self) -> list[Publisher]:
        outputs = (publisher for _, publisher in self._outputs)
        return [*outputs, *self._latched.values(), self._transitions, *self._events]

    def _keep(self, state: bytes) -> None:
        self._state = state

    def keep_alive(self) -> None:
        """Sends the last state again, the same bytes; before the first one, a bare sign of life. Call it often."""
        if time.monotonic() - self._lived_s < _KEEP_ALIVE_S:
            return
        self._lived_s = time.monotonic()
        if self._state:
            self._latched["state"].publish(self._state)
        else:
            self._latched["state"].assert_liveliness()

    def wait_for_receivers(self) -> None:
        """Returns when all have what was published, or after a time: a publisher that is destroyed sends nothing again."""
        wait_for_receivers(self.all, _END_S)

    def close(self) -> None:
        for publisher in self.all:
            self._node.destroy_publisher(publisher)
