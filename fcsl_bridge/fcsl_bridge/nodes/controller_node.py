# SPDX-License-Identifier: Apache-2.0
"""A compiled machine as a ROS 2 lifecycle node.

    configure    finds and loads the machine, checks its messages, creates topics, parameters and services
    activate     ticks: in lock-step with a simulator (lockstep_loop.py), at tick_hz (realtime_loop.py), or as /clock goes
                 (clock_loop.py)
    deactivate   stops ticking; outputs, parameters and services stay; activate continues at the next tick
    cleanup      completes the bag, closes the machine, removes topics, parameters and services
With `autostart`, the default, the node configures and activates itself, and ends with the run or with an error. Without
it a lifecycle manager does that, and an error leads to unconfigured. Everything runs in one thread.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy._rclpy_pybind11 import RCLError
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter

from simclient.run import open_run

from ..base import bus_address
from ..base.machine_index import find_machine
from ..base.name_clash import NameClash
from ..base.node_main import (
    BAD_INPUT,
    Option,
    Stop,
    not_negative,
    positive,
    read_options,
    run_node,
    take_dotted,
    wait_for_subscribers,
)
from ..base.polling import SERVE_PERIOD_S, Housekeeping
from ..errors import BridgeError, Stopped
from ..loops.clock_loop import ClockLoop
from ..loops.configured_machine import ConfiguredMachine
from ..loops.lockstep_loop import LockstepLoop
from ..loops.realtime_loop import RealtimeLoop
from ..services.machine_services import Allowed
from ..topics import tf

OPTIONS = (  # all read-only: callers of the node's services must not load libraries or write bags elsewhere
    Option("machine", str, "", "package/machine, or the path of a machine library"),
    Option(
        "mode", str, "lockstep", "what triggers the ticks: lockstep (a simulator), realtime (time) or clock (/clock)"
    ),
    Option("record", str, "", "the path of a new bag directory; if it exists, <record>_2, ..."),
    Option("record_split", str, "", "how the bag is split: some of seconds=60,megabytes=100,files=10,around=30"),
    Option("decimate", int, 1, "a whole number n: outputs are published each n-th tick"),
    bus_address.OPTION,
    Option("timeout_s", float, 5.0, "lockstep: seconds to wait for the simulator's next tick"),
    Option("start_timeout_s", float, 60.0, "seconds to wait for the simulator"),
    Option("max_ticks_per_clock", int, 100, "clock: how many ticks one message of /clock makes at most"),
    Option("wait_for_subscribers", int, 0, "how many subscribers each topic needs before the first tick"),
    tf.OPTION,
    Option("autostart", bool, True, "whether the node configures and activates itself"),
    Option("allow_set_state", bool, False, "whether ~/set_state and ~/restore may be used"),
    Option("checkpoints", str, "", "folder of the files of ~/save and ~/restore; empty: no files"),
)
MODES: dict[str, type[LockstepLoop | RealtimeLoop | ClockLoop]] = {
    "lockstep": LockstepLoop,
    "realtime": RealtimeLoop,
    "clock": ClockLoop,
}
_NAME = "controller_node"
_SUCCESS, _FAILURE, _ERROR = (
    TransitionCallbackReturn.SUCCESS,
    TransitionCallbackReturn.FAILURE,
    TransitionCallbackReturn.ERROR,
)


class _Inactive(Exception):
    """The node was deactivated, cleaned up or shut down while ticking."""


class ControllerNode(LifecycleNode):
    """`serve` runs it until its end."""

    def __init__(self, name: str, **arguments: Any):
        super().__init__(name, **arguments)
        self._configured: ConfiguredMachine | None = None
        self._mode: LockstepLoop | RealtimeLoop | ClockLoop | None = None
        self._active = self._finalized = self._starting = False
        self._failure: Exception | None = None
        self._ending = "shut down"
        self._given: dict[str, Any] = {}
        self._namesake = NameClash(self)
        for service in self.services:
            if service.srv_type is ChangeState:
                service.callback = _refusing(service.callback)

    # ---- transitions -------------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._attempt(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._attempt(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._end_ticking()
        return _SUCCESS if self._failure is None else _ERROR

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._attempt(lambda: self._release("cleaned up"))

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._end_ticking()
        self._finalized = True
        self._attempt(lambda: self._release(self._ending))
        return _SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The error was logged; goes back to unconfigured."""
        self._close()
        self._failure = None
        return _SUCCESS

    def _attempt(self, transition: Callable[[], None]) -> TransitionCallbackReturn:
        """Reports exceptions of a transition, which rclpy would drop."""
        self._failure = None
        try:
            transition()
        except Exception as error:
            self._fail(error)
            return _FAILURE
        return _SUCCESS

    def _fail(self, error: Exception) -> None:
        """During autostart the node ends with the error; later the error is logged."""
        self._failure = error
        if not self._starting:
            self.get_logger().error(str(error) or type(error).__name__)

    def _configure(self) -> None:
        options = self._options
        locked = options["mode"] == "lockstep"
        faults = options["mode"] != "realtime" or bool(self.get_parameter("use_sim_time").value)
        allowed = Allowed(
            options["allow_set_state"], leaving_tick=not locked, faults=faults, folder=options["checkpoints"]
        )
        try:
            self._configured = ConfiguredMachine(self, options, self._given, allowed)
            self._mode = MODES[options["mode"]](self, self._configured, self._serve_active, options)
        except Exception:
            self._close()
            raise

    def _activate(self) -> None:
        assert self._configured is not None and self._mode is not None
        count, limit_s = self._options["wait_for_subscribers"], self._options["start_timeout_s"]
        wait_for_subscribers(self._configured.topics.all, count, limit_s, self._waiting)
        self._mode.activate()
        self._active, self._ending = True, "shut down"

    def _waiting(self) -> None:
        self._stop.check()
        assert self._configured is not None
        self._configured.topics.keep_alive()

    def _end_ticking(self) -> None:
        """The actuators on topics get their safe values: no command follows."""
        ended, self._active = self._active, False
        if ended and self._configured is not None and self._mode is not None:
            self._configured.queue_publisher.all()  # what the last ticks put; commands come before safe values
            self._configured.outputs.make_safe(self._mode.now_ns())

    def _release(self, why: str) -> None:
        if self._configured is None or self._mode is None:
            return
        run, bag = self._configured.run, self._configured.bag
        record = f"; recorded to {bag}" if bag else ""
        text = f"{why}: {run.tick} ticks, {run.machine.time_ns(run.tick) / 1e9:.3f} s{record}"
        self._close()
        print(text, flush=True)

    def _close(self) -> None:
        """Leaves the simulator, completes the bag and removes everything that configure created."""
        try:
            self._end_ticking()
        finally:
            mode, configured, self._mode, self._configured = self._mode, self._configured, None, None
            if mode is not None:
                mode.leave()
                mode.close()
            if configured is not None:
                configured.close()

    # ---- running --------------------------------------------------------------------------------------------------

    def serve(self, stop: Stop) -> int:
        """Runs until SIGINT, SIGTERM, the shutdown transition, or, with autostart, the end of the run.

        Raises errors of a node that started itself.
        """
        self._options = read_options(self, OPTIONS, dotted=True)
        _check(self._options)
        self._given = take_dotted(self)
        self._stop, self._housekeeping = stop, Housekeeping(self, stop)
        try:
            self._starting = self._options["autostart"]
            if self._starting:
                self._require(self.trigger_configure())
                self._require(self.trigger_activate())
                self._starting = False
            self._live()
        except Stopped:
            self._ending = "interrupted"
        except BaseException:
            self._close()
            raise
        finally:
            if not self._finalized:
                self.trigger_shutdown()
            self._housekeeping.close()
        self._require(_SUCCESS if self._failure is None else _FAILURE)
        return 0

    def _require(self, result: TransitionCallbackReturn) -> None:
        if result != _SUCCESS:
            assert self._failure is not None
            raise self._failure

    def _live(self) -> None:
        while not self._finalized:
            if not self._active:
                self._housekeeping.idle(SERVE_PERIOD_S)
                self._rest()
                continue
            assert self._mode is not None and self._configured is not None
            try:
                self._mode.run()
                self._ending = "the simulator ended the run"
                self._configured.topics.wait_for_receivers()
                if self._options["autostart"]:
                    return
                self._configured.end_record()
            except _Inactive:
                continue
            except BAD_INPUT as error:
                if self._options["autostart"]:
                    raise
                self._fail(error)
            self.trigger_deactivate()

    def _rest(self) -> None:
        """Not active."""
        if self._configured is None or self._mode is None or self._active:
            return
        self._mode.rest()
        self._namesake.check()
        self._configured.topics.keep_alive()
        if self._configured.diagnostics.due(active=False):
            self._configured.diagnostics.publish(self._mode.now_ns(), active=False)

    def _serve_active(self) -> None:
        self._housekeeping.serve()
        if not self._active or self._configured is None:
            raise _Inactive
        self._namesake.check()
        self._configured.topics.keep_alive()


def _check(options: dict[str, Any]) -> None:
    if not options["machine"]:
        raise BridgeError("parameter `machine` is missing: -p machine:=<package>/<machine>")
    if options["mode"] not in MODES:
        raise BridgeError(f"parameter `mode` takes {', '.join(MODES)}, got `{options['mode']}`")
    positive(options, "decimate", "timeout_s", "start_timeout_s", "max_ticks_per_clock")
    not_negative(options, "wait_for_subscribers")
    if options["checkpoints"] and not Path(options["checkpoints"]).is_dir():
        raise BridgeError(f"parameter `checkpoints`: there is no folder {options['checkpoints']}")


def _refusing(change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Refuses transitions that are invalid in the current state; rclpy would end the node."""

    def callback(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except RCLError:
            response.success = False
            return response

    return callback


def _body(node: ControllerNode, stop: Stop) -> int:
    return node.serve(stop)


def _called_like_its_machine(node: Node) -> str:
    """Two machines of a namespace are two nodes. One that cannot be found yet is named when it is configured."""
    try:
        library, machine = find_machine(str(node.get_parameter_or("machine", Parameter("machine", value="")).value))
        run = open_run(library, machine)
    except BAD_INPUT:
        return _NAME
    try:
        return run.machine.name
    finally:
        run.close()


def main() -> None:
    sys.exit(
        run_node(_NAME, OPTIONS, _body, kind=ControllerNode, parameter_services=True, called=_called_like_its_machine)
    )
