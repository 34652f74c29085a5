# SPDX-License-Identifier: Apache-2.0
"""A compiled machine as a ROS 2 node: steps tick k exactly when the sensor bundle stamped k has arrived, answers stamped k.

Nothing else makes a tick: no timer, no /clock. Topics, below the node's namespace (and machine_topics.py, diagnostics.py):
    <machine>/lockstep/sensors    fcsl_msgs/TickBundle     subscribed: sensor channels of tick k; an empty frame ends the run
    <machine>/lockstep/actuators  fcsl_msgs/TickBundle     the answer to tick k
The bag is written by the runtime in this process, tick by tick, never by a subscriber.
"""

from __future__ import annotations

import sys
import time
from array import array
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.node import Node

from fcsl_msgs.msg import TickBundle
from simclient.errors import TwinError
from simclient.run import Run, open_run

from . import qos
from .diagnostics import Diagnostics
from .errors import BridgeError, Stopped
from .machine_index import find_machine
from .machine_topics import MachineTopics
from .node_main import Option, Spinner, Stop, not_negative, positive, read_options, run_node, wait_for_subscribers

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

    def __init__(self, node: Node, run: Run, options: dict[str, Any]):
        self._run, self._options = run, options
        self.ended = False
        self.topics = MachineTopics(node, run, options["decimate"])
        self._diagnostics = Diagnostics(node, run)
        self._answer = TickBundle()
        self._actuators = qos.publisher(node, TickBundle, f"{run.machine.name}/lockstep/actuators", qos.LOCKSTEP)
        self._node = node

    def begin(self) -> None:
        """Says what holds before the first tick, and listens for it."""
        self.topics.publish_changes()
        topic = f"{self._run.machine.name}/lockstep/sensors"
        qos.subscribe(self._node, TickBundle, topic, self._take, qos.LOCKSTEP)

    def _take(self, bundle: TickBundle) -> None:
        due = self._run.tick
        if self.ended:
            raise BridgeError(f"the sensor bundle of tick {bundle.tick} arrived after the end of the run at tick {due}")
        if bundle.tick < due:
            raise BridgeError(
                f"the sensor bundle of tick {bundle.tick} arrived a second time: tick {due} is due; is more than one "
                f"simulator running?"
            )
        if bundle.tick > due:
            raise BridgeError(f"no sensor bundle of tick {due}: that of tick {bundle.tick} came instead")
        if len(bundle.frame) == 0:
            self.ended = True
            return
        try:
            self._run.sense(bytes(bundle.frame))
        except TwinError as error:
            raise BridgeError(f"tick {due}: {error}") from None
        self._run.step(1)
        self._reply(bundle)
        self._show(due)

    def _reply(self, bundle: TickBundle) -> None:
        """First of all that is published, so that the simulator goes on while this process shows the tick."""
        self._answer.header = bundle.header
        self._answer.tick = bundle.tick
        self._answer.frame = array("B", self._run.actuate())
        self._actuators.publish(self._answer)

    def _show(self, tick: int) -> None:
        event = self.topics.publish_changes()
        if event is not None:
            cause = f" ({event.request} by {event.instance})" if event.request else ""
            time_s = self._run.machine.time_ns(tick + 1) / 1e9
            print(f"{time_s:10.3f} s  {event.from_state} -> {event.to_state}{cause}", flush=True)
        self.topics.publish_outputs(tick)
        self._diagnostics.publish(tick)

    def host(self, spinner: Spinner) -> None:
        """Serves ticks to the end of the run. Raises BridgeError with the tick that did not come in time, and Stopped."""
        timeout_s = self._options["start_timeout_s"]
        while not self.ended:
            if not spinner.until(partial(self._served, self._run.tick), time.monotonic() + timeout_s):
                raise BridgeError(f"no sensor bundle of tick {self._run.tick} from the simulator within {timeout_s} s")
            timeout_s = self._options["timeout_s"]

    def _served(self, tick: int) -> bool:
        return self.ended or self._run.tick > tick


def _host(node: Node, stop: Stop, run: Run, options: dict[str, Any]) -> int:
    run.attach()
    controller = Controller(node, run, options)
    spinner = Spinner(node, stop)
    if options["record"]:
        run.record(Path(options["record"]), node.get_namespace().strip("/"), lossless=True)
    try:
        print(f"{run.machine.name}: waiting for a simulator", flush=True)
        wait_for_subscribers(controller.topics.all, options["wait_for_subscribers"], options["start_timeout_s"], stop)
        controller.begin()
        controller.host(spinner)
        end = "the simulator ended the run"
    except Stopped:
        end = "interrupted"
    finally:
        spinner.close()
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
