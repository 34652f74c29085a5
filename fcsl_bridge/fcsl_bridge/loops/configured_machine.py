# SPDX-License-Identifier: Apache-2.0
"""A machine that a node has configured: the run, its bag, and its ROS 2 interfaces.

lockstep_loop.py or realtime_loop.py runs the ticks.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from itertools import count
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.serialization import deserialize_message

from fcsl_msgs.msg import Event, TransitionEvent
from simclient.errors import TwinError
from simclient.parameters import read_parameters
from simclient.ros.publish_queue import RunTopics
from simclient.run import open_run

from ..base.machine_index import find_machine
from ..diagnostics.machine_status import Diagnostics, Source
from ..services.dropouts import Dropouts
from ..services.machine_services import Allowed, MachineServices
from ..services.parameters import MachineParameters
from ..topics.machine_topics import MachineTopics
from ..topics.mapped_topics import Outputs
from ..topics.queue_publisher import QueuePublisher
from ..topics.tf import StaticFrames


def next_bag(record: str) -> Path:
    """The first of `flight`, `flight_2`, `flight_3`, … that does not exist."""
    first = Path(record)
    names = (first if number == 1 else first.with_name(f"{first.name}_{number}") for number in count(1))
    return next(name for name in names if not os.path.lexists(name))


class ConfiguredMachine:
    """Exists from configure to cleanup. `given`: machine parameters from the node's start. Raises BridgeError and
    TwinError, and then leaves nothing behind."""

    def __init__(self, node: Node, options: Mapping[str, Any], given: Mapping[str, Any], allowed: Allowed):
        self._node, self._record, self._split = node, options["record"], options["record_split"]
        self._lossless = options["mode"] == "lockstep"
        self.bag: Path | None = None  #: the newest one, unless it failed
        self._recording = False
        self._stack = ExitStack()
        try:
            self._open(node, options, given, allowed)
        except BaseException:
            self._stack.close()
            raise

    def _open(self, node: Node, options: Mapping[str, Any], given: Mapping[str, Any], allowed: Allowed) -> None:
        library, machine = find_machine(options["machine"])
        self.run = open_run(library, machine, read_parameters(given))
        self._stack.callback(self.run.close)
        self.run.attach()
        self._initial = self.run.save()
        # Outside lock-step one thread puts and publishes: it must not wait for itself.
        self.queue_publisher = QueuePublisher(lossless=self._lossless and options["wait_for_subscribers"] > 0)
        self._stack.callback(self.queue_publisher.close)
        self.messages = RunTopics(self.run, self.queue_publisher.queue)
        self._stack.callback(self.messages.close)
        self.outputs = Outputs(node, self.run, self.queue_publisher, self.messages, options["tf"] or ())
        self._stack.callback(self.outputs.close)
        self._stack.callback(StaticFrames(node, self.run.machine.views).close)
        parts = (self.queue_publisher, self.messages, self._log_transition, self._log_event)
        self.topics = MachineTopics(node, self.run, options["decimate"], *parts)
        self._stack.callback(self.topics.close)
        self.parameters = MachineParameters(node, self.run)
        self._stack.callback(self.parameters.close)
        self.dropouts = Dropouts(self.run.machine)
        self._services = MachineServices(node, library, self.run, self.dropouts, self.parameters.refresh, allowed)
        self._stack.callback(self._services.close)
        #: Sources of diagnostics; the object that runs the ticks adds itself.
        self.sources: list[Source] = [self, self.outputs]
        self.diagnostics = Diagnostics(node, self.run, self.sources)
        self._stack.callback(self.diagnostics.close)

    def record(self) -> None:
        """Begins the bag of this run, if one is wanted and none is open."""
        if not self._record or self._recording:
            return
        bag = next_bag(self._record)
        name_space = self._node.get_namespace().strip("/")
        self.run.record(bag, name_space, lossless=self._lossless, split=self._split)
        self.bag, self._recording = bag, True

    def end_record(self) -> None:
        """Completes the bag, if one is open."""
        if self._recording:
            self._recording = False
            self.run.record_stop()

    def check_record(self) -> None:
        """Ends a recording that cannot be written; the machine continues without it."""
        if not self._recording:
            return
        try:
            self.run.record_check()
        except TwinError as error:
            self.bag = None
            self._node.get_logger().error(f"{error}; flying on without a record")
            with suppress(TwinError):  # raises the same error
                self.end_record()

    def show(self, time_ns: int) -> None:
        """Publishes the results of the last completed tick, stamped time_ns."""
        self.messages.put(time_ns)
        self.queue_publisher.all()

    def show_changes(self, time_ns: int) -> None:
        """Publishes the latched topics whose content has changed, stamped time_ns."""
        self.messages.put_changes(time_ns)
        self.queue_publisher.all()

    def _log_transition(self, message: bytes) -> None:
        event = deserialize_message(message, TransitionEvent)
        cause = f" ({event.request} by {event.instance})" if event.request else ""
        time_s = self.run.machine.time_ns(event.tick + 1) / 1e9
        self._node.get_logger().info(f"{time_s:.3f} s  {event.from_state} -> {event.to_state}{cause}")

    def _log_event(self, message: bytes) -> None:
        event = deserialize_message(message, Event)
        text = " ".join((event.text, *event.values))
        more = f" ({event.suppressed} before it suppressed)" if event.suppressed else ""
        line = f"{self.run.machine.time_ns(event.tick) / 1e9:.3f} s  {event.instance}: {text}{more}"
        self._node.get_logger().report(event.severity, line, event.file, event.instance, event.line)

    def start_over(self) -> None:
        """Begins a new run at tick 0, with the current parameters and a new bag."""
        self.end_record()
        self.run.restore(self._initial)
        self.parameters.reapply()
        self.dropouts.clear()
        self.record()

    def figures(self) -> dict[str, int | float | str]:
        return {}

    def troubles(self) -> dict[str, int]:
        return {
            "records dropped": self.run.record_dropped(),
            "messages dropped": self.queue_publisher.queue.dropped,
            "hardware failures": self.run.hardware_failures(),
        }

    def close(self) -> None:
        """Completes the bag and releases everything; idempotent."""
        with self._stack:
            self.end_record()
