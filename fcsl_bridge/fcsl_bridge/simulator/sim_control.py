# SPDX-License-Identifier: Apache-2.0
"""Control of simulated time: pause, step, reset and speed.

~/pause, ~/resume   std_srvs/Trigger     the same as parameter `paused`
~/step              fcsl_msgs/Step       runs this number of ticks of a paused simulation; answered when they are done
~/reset             std_srvs/Trigger     tick 0 of a new run; pause and speed stay
paused              parameter            no tick begins while it is true
speed               parameter            limit on simulated seconds per second; 0: as fast as the participants allow
"""

from __future__ import annotations

import math
import time

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

from fcsl_msgs.srv import Step

from ..base.polling import SERVE_PERIOD_S, Housekeeping

#: More ticks than any simulation has.
_ALL = 2**63
#: How long an answer may take to reach who asked, in s: a node that has ended sends nothing again.
_ANSWER_S = 0.5


class Reset(Exception):
    """A client requested a new run."""


def speed_problem(speed: float) -> str:
    """The reason why the speed is invalid; empty if it is valid."""
    return "" if math.isfinite(speed) and speed >= 0 else f"`speed` must be zero or above and finite, got {speed}"


def _adopt(parameters: list[Parameter]) -> list[Parameter]:
    """Converts an integer `speed`, which `ros2 param set` sends for a whole number, to a double."""
    return [
        Parameter(p.name, value=float(p.value)) if p.name == "speed" and p.type_ is Parameter.Type.INTEGER else p
        for p in parameters
    ]


class Control:
    """Decides how many ticks may run. Everything runs in the calling thread."""

    def __init__(self, node: Node, housekeeping: Housekeeping, speed: float, paused: bool):
        self._node, self._housekeeping = node, housekeeping
        self.paused, self.speed = paused, speed
        self.pace_changed = True  #: a new speed, or the end of a pause
        self._reset = False
        self._budget = self._tick = 0  # ticks allowed while paused; ticks completed
        self._stepped: Future | None = None
        self._requested_s = -_ANSWER_S  # when somebody asked last
        group = ReentrantCallbackGroup()  # ~/step is answered later, and must not keep the others waiting
        for name, kind, callback in (
            ("pause", Trigger, self._on_pause),
            ("resume", Trigger, self._on_resume),
            ("step", Step, self._on_step),
            ("reset", Trigger, self._on_reset),
        ):
            node.create_service(kind, f"~/{name}", callback, callback_group=group)
        node.add_pre_set_parameters_callback(_adopt)
        node.add_on_set_parameters_callback(self._check_parameters)
        node.add_post_set_parameters_callback(self._take_parameters)

    # ---- the loop's side ------------------------------------------------------------------------------------------------

    def serve(self) -> None:
        """Serves requests between and during ticks. Raises Stopped and Reset."""
        self._housekeeping.serve()
        self._raise_reset()

    def allowed(self) -> int:
        """How many ticks may run now. Raises Stopped and Reset."""
        self.serve()
        if self.paused and not self._budget:
            self.pace_changed = True
            self._end_step("")
        return self._budget if self.paused else _ALL

    def done(self, ticks: int, tick: int) -> None:
        """So many ticks have run; the next one is number `tick`."""
        self._tick = tick
        self._budget = max(self._budget - ticks, 0)

    def idle(self) -> None:
        """Waits a while, in which no tick may run, for requests. Raises Stopped and Reset."""
        self._housekeeping.idle(SERVE_PERIOD_S)
        self._raise_reset()

    def begin_run(self) -> None:
        """The next tick is tick 0 of a new run."""
        self.pace_changed, self._budget, self._tick = True, 0, 0
        self._end_step("the simulation was reset")

    # ---- the callers' side ----------------------------------------------------------------------------------------------

    def _raise_reset(self) -> None:
        if self._reset:
            self._reset = False
            raise Reset

    def _on_pause(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._pause(True, response)

    def _on_resume(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._pause(False, response)

    def _pause(self, paused: bool, response: Trigger.Response) -> Trigger.Response:
        self._node.set_parameters([Parameter("paused", value=paused)])
        response.success = True
        response.message = f"{'paused' if paused else 'running'}, {self._tick} ticks are done"
        return response

    async def _on_step(self, request: Step.Request, response: Step.Response) -> Step.Response:
        if not self.paused:
            response.message = "the simulation runs: pause it first"
        elif self._stepped is not None:
            response.message = "an earlier step is not done yet"
        elif request.ticks < 1:
            response.message = "`ticks` must be at least 1"
        else:
            self._budget, self._stepped = request.ticks, Future()
            response.message = await self._stepped
            response.success = response.message == ""
        response.tick = self._tick
        return response

    def _end_step(self, problem: str) -> None:
        if self._stepped is not None:
            self._requested_s = time.monotonic()
            self._stepped.set_result(problem)
            self._stepped = None

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._requested_s = time.monotonic()
        self._reset = response.success = True
        response.message = f"a new run begins after {self._tick} ticks"
        return response

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        problem = next((speed_problem(p.value) for p in parameters if p.name == "speed"), "")
        return SetParametersResult(successful=not problem, reason=problem)

    def _take_parameters(self, parameters: list[Parameter]) -> None:
        self._requested_s = time.monotonic()
        for parameter in parameters:
            if parameter.name == "speed":
                self.speed, self.pace_changed = parameter.value, True
            elif parameter.name == "paused":
                self.paused, self._budget = parameter.value, 0
                self._end_step("`paused` was set meanwhile")

    def end(self) -> None:
        """Ends the simulation: answers a pending ~/step, and gives the last answers time to arrive."""
        self._end_step("the simulation is over")
        self._housekeeping.idle(SERVE_PERIOD_S)
        until_s = self._requested_s + _ANSWER_S
        while time.monotonic() < until_s:
            self._housekeeping.idle(SERVE_PERIOD_S)
