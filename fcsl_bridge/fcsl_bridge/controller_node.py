# SPDX-License-Identifier: Apache-2.0
"""A compiled machine as a ROS 2 node: steps tick k exactly when the sensor bundle stamped k has arrived, answers stamped k.

Nothing else makes a tick: no timer, no /clock. Topics, below the node's namespace (and machine_topics.py, diagnostics.py):
    <machine>/lockstep/sensors    fcsl_msgs/TickBundle     subscribed: sensor channels of tick k (lockstep.py)
    <machine>/lockstep/actuators  fcsl_msgs/TickBundle     the answer to tick k
The bag is written by the runtime in this process, tick by tick, never by a subscriber.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from rclpy.node import Node

from simclient.errors import TwinError
from simclient.run import Run, open_run

from .diagnostics import Diagnostics
from .errors import BridgeError, Stopped
from .lockstep import ControllerEnd
from .machine_index import find_machine
from .machine_topics import MachineTopics
from .node_main import Option, Stop, not_negative, positive, read_options, run_node, wait_for_subscribers
from .polled import Housekeeping

OPTIONS = (
    Option("machine", str, None, "package/machine, or the path of a machine library"),
    Option("record", str, "", "the path of a new bag directory"),
    Option("decimate", int, 1, "a whole number n: outputs are published each n-th tick"),
    Option("timeout_s", float, 5.0, "seconds to wait for the simulator's next bundle"),
    Option("start_timeout_s", float, 60.0, "seconds to wait for the simulator's first bundle"),
    Option("wait_for_subscribers", int, 0, "how many subscribers each topic needs before the first tick"),
)


class Controller:
    """Hosts a run behind the two bundle topics."""

    def __init__(self, node: Node, run: Run, lockstep: ControllerEnd, options: dict[str, Any]):
        self._run, self._lockstep, self._options = run, lockstep, options
        self.topics = MachineTopics(node, run, options["decimate"])
        self._diagnostics = Diagnostics(node, run)

    def host(self) -> None:
        """Serves ticks to the end of the run. Raises BridgeError with the tick that did not come in time, and Stopped."""
        self.topics.publish_changes()
        timeout_s = self._options["start_timeout_s"]
        while (sensors := self._lockstep.next(timeout_s)) is not None:
            if sensors.first and sensors.tick != self._run.tick:
                raise BridgeError(f"the simulator was reset at tick {self._run.tick}; start this node again")
            try:
                self._run.sense(sensors.frame)
            except TwinError as error:
                raise BridgeError(f"tick {sensors.tick}: {error}") from None
            self._run.step(1)
            self._lockstep.answer(self._run.actuate())  # first of all, so that the simulator goes on meanwhile
            self._show(sensors.tick)
            timeout_s = self._options["timeout_s"]

    def _show(self, tick: int) -> None:
        event = self.topics.publish_changes()
        if event is not None:
            cause = f" ({event.request} by {event.instance})" if event.request else ""
            time_s = self._run.machine.time_ns(tick + 1) / 1e9
            print(f"{time_s:10.3f} s  {event.from_state} -> {event.to_state}{cause}", flush=True)
        self.topics.publish_outputs(tick)
        self._diagnostics.publish(tick)


def _host(node: Node, stop: Stop, run: Run, options: dict[str, Any]) -> int:
    run.attach()
    housekeeping = Housekeeping(node, stop)
    lockstep = ControllerEnd(node, run.machine, housekeeping.serve)
    controller = Controller(node, run, lockstep, options)
    if options["record"]:
        run.record(Path(options["record"]), node.get_namespace().strip("/"), lossless=True)
    try:
        print(f"{run.machine.name}: waiting for a simulator", flush=True)
        wait_for_subscribers(controller.topics.all, options["wait_for_subscribers"], options["start_timeout_s"], stop)
        controller.host()
        end = "the simulator ended the run"
    except Stopped:
        lockstep.end()
        end = "interrupted"
    finally:
        housekeeping.close()
    ticks = run.tick
    run.close()
    bag = f"; recorded to {options['record']}" if options["record"] else ""
    print(f"{end}: {ticks} ticks, {run.machine.time_ns(ticks) / 1e9:.3f} s{bag}")
    return 0


def _body(node: Node, stop: Stop) -> int:
    options = read_options(node, OPTIONS)
    if not options["machine"]:
        raise BridgeError("parameter `machine` is missing: -p machine:=<package>/<machine>")
    positive(options, "decimate", "timeout_s", "start_timeout_s")
    not_negative(options, "wait_for_subscribers")
    run = open_run(*find_machine(options["machine"]))
    try:
        return _host(node, stop, run, options)
    finally:
        run.close()


def main() -> None:
    sys.exit(run_node("controller_node", OPTIONS, _body))
