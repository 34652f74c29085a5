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
from collections.abc import Callable

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

from fcsl_msgs.srv import Step

from .polled import SERVE_PERIOD_S, Housekeeping

#: A simulation that is later than this, in s, does not catch up.
_CATCH_UP_S = 0.1
_NS = 1_000_000_000


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


class Pace:
    """When a tick may begin at a given speed. Times: monotonic seconds, simulated nanoseconds."""

    def __init__(self, speed: float):
        self.speed = speed
        self._wall_s = self._time_ns = 0.0

    def anchor(self, now_s: float, time_ns: int) -> None:
        """Starts the pacing at this time."""
        self._wall_s, self._time_ns = now_s, time_ns

    def left_s(self, now_s: float, time_ns: int) -> float:
        """Seconds until the tick at time_ns may begin; zero or less: now."""
        if not self.speed:
            return 0.0
        left_s = self._wall_s + (time_ns - self._time_ns) / _NS / self.speed - now_s
        if left_s < -_CATCH_UP_S:
            self.anchor(now_s, time_ns)
        return left_s


class Control:
    """Decides before every tick whether it may begin. Everything runs in the calling thread."""

    def __init__(self, node: Node, housekeeping: Housekeeping, speed: float, paused: bool):
        self._node, self._housekeeping = node, housekeeping
        self.paused = paused
        self._pace = Pace(speed)
        self._anchored = self._reset = False
        self._budget = self._tick = 0  # ticks allowed while paused; ticks completed
        self._stepped: Future | None = None
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

    def wait_for_turn(self, tick: int, time_ns: int, alive: Callable[[], None]) -> None:
        """Returns when tick `tick`, at time_ns, may begin; calls `alive` while it waits. Raises Stopped and Reset."""
        self._tick = tick
        while True:
            self.serve()
            if self.paused and not self._budget:
                self._anchored = False
                self._end_step("")
                self._housekeeping.idle(SERVE_PERIOD_S)
            else:
                now = time.monotonic()
                if not self._anchored:
                    self._anchored = True
                    self._pace.anchor(now, time_ns)
                left_s = self._pace.left_s(now, time_ns)
                if left_s <= 0:
                    break
                time.sleep(min(left_s, SERVE_PERIOD_S))
            alive()
        self._budget -= self._budget > 0

    def begin_run(self) -> None:
        """The next tick is tick 0 of a new run."""
        self._anchored, self._budget = False, 0
        self._end_step("the simulation was reset")

    @property
    def speed(self) -> float:
        return self._pace.speed

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
            self._stepped.set_result(problem)
            self._stepped = None

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._reset = response.success = True
        response.message = f"a new run begins after {self._tick} ticks"
        return response

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        problem = next((speed_problem(p.value) for p in parameters if p.name == "speed"), "")
        return SetParametersResult(successful=not problem, reason=problem)

    def _take_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "speed":
                self._pace.speed = parameter.value
                self._anchored = False
            elif parameter.name == "paused":
                self.paused, self._budget = parameter.value, 0
                self._end_step("`paused` was set meanwhile")

    def end(self) -> None:
        """Ends the simulation: answers a pending ~/step."""
        self._end_step("the simulation is over")
        self._housekeeping.idle(SERVE_PERIOD_S)
