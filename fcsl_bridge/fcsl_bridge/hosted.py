# SPDX-License-Identifier: Apache-2.0
"""A machine that a node has configured: the run, its bag, and its ROS 2 interfaces.

lockstep_loop.py or realtime_loop.py runs the ticks.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from rclpy.node import Node

from simclient.errors import TwinError
from simclient.run import open_run

from .diagnostics import Diagnostics, Source
from .dropouts import Dropouts
from .machine_index import find_machine
from .machine_topics import MachineTopics
from .mapped_topics import Outputs
from .parameters import MachineParameters
from .services import Allowed, MachineServices


class BagNames:
    """Names of the bags of a process: `flight`, then `flight_2`, `flight_3`, …, skipping existing ones."""

    def __init__(self) -> None:
        self._used: dict[str, int] = {}

    def next(self, record: str) -> Path:
        """The next name, the same until it is `taken`. The first name is not skipped if it exists."""
        number = self._used.get(record, 0) + 1
        while number > 1 and self._name(record, number).exists():
            number += 1
        return self._name(record, number)

    def taken(self, record: str) -> None:
        """Marks the last name of `next` as used."""
        self._used[record] = self._used.get(record, 0) + 1

    def _name(self, record: str, number: int) -> Path:
        return Path(record if number == 1 else f"{record}_{number}")


class Hosted:
    """Exists from configure to cleanup. `given`: machine parameters from the node's start. Raises BridgeError and
    TwinError, and then leaves nothing behind."""

    def __init__(
        self, node: Node, options: Mapping[str, Any], given: Mapping[str, Any], bags: BagNames, allowed: Allowed
    ):
        self._node, self._record, self._bags = node, options["record"], bags
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
        self.run = open_run(*find_machine(options["machine"]))
        self._stack.callback(self.run.close)
        self.run.attach()
        self._initial = self.run.save()
        self.topics = MachineTopics(node, self.run, options["decimate"])
        self._stack.callback(self.topics.close)
        self.outputs = Outputs(node, self.run)
        self._stack.callback(self.outputs.close)
        self.parameters = MachineParameters(node, self.run, given)
        self._stack.callback(self.parameters.close)
        self.dropouts = Dropouts(self.run.machine)
        self._services = MachineServices(node, self.run, self.dropouts, self.parameters.refresh, allowed)
        self._stack.callback(self._services.close)
        #: Sources of diagnostics; the object that runs the ticks adds itself.
        self.sources: list[Source] = [self, self.outputs]
        self.diagnostics = Diagnostics(node, self.run, self.sources)
        self._stack.callback(self.diagnostics.close)

    def record(self) -> None:
        """Begins the bag of this run, if one is wanted and none is open."""
        if not self._record or self._recording:
            return
        bag = self._bags.next(self._record)
        self.run.record(bag, self._node.get_namespace().strip("/"), lossless=self._lossless)
        self._bags.taken(self._record)
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

    def show(self, tick: int, time_ns: int) -> None:
        """Publishes the results of `tick`, the last completed one, stamped time_ns; also prints a transition."""
        self.outputs.publish(time_ns)
        event = self.topics.publish_changes(time_ns)
        if event is not None:
            cause = f" ({event.request} by {event.instance})" if event.request else ""
            time_s = self.run.machine.time_ns(tick + 1) / 1e9
            print(f"{time_s:10.3f} s  {event.from_state} -> {event.to_state}{cause}", flush=True)
        self.topics.publish_outputs(tick, time_ns)

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
        return {"records dropped": self.run.record_dropped(), "hardware failures": self.run.hardware_failures()}

    def close(self) -> None:
        """Completes the bag and releases everything; idempotent."""
        with self._stack:
            self.end_record()
