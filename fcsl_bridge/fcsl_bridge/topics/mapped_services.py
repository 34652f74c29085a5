# SPDX-License-Identifier: Apache-2.0
"""The channels of a machine that the JSON maps onto services: calls are taken before a tick, and answered after one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from simclient.ros.services import Answer, ServiceInput
from simclient.run import Run

from ..base.polling import PolledService

_KINDS = {"std_srvs/srv/Trigger": Trigger, "std_srvs/srv/SetBool": SetBool}
#: Requests of a service that are looked at before a tick.
_AT_ONCE = 10
_INACTIVE = Answer(False, "the node is inactive: no tick is made")


class Services:
    """One call of each waits at a time. now_ns: ROS time."""

    def __init__(self, node: Node, run: Run):
        """Raises TwinError."""
        channels = run.machine.channels
        self._services = [
            _Service(channels[s.channel].name, ServiceInput(run, s), PolledService(node, _KINDS[s.type], s.name))
            for s in run.machine.services
        ]

    def begin(self, now_ns: int) -> None:
        """Ticks follow."""
        for one in self._services:
            one.input.begin(now_ns)

    def take(self, now_ns: int, missing: frozenset[str]) -> None:
        """Before a tick. Calls for channels in `missing` wait untaken."""
        for one in self._services:
            if one.channel not in missing:
                one.take(now_ns)

    def answer(self) -> None:
        """After a tick."""
        for one in self._services:
            one.answer(one.input.poll())

    def refuse(self) -> None:
        """Answers calls while no tick is made."""
        for one in self._services:
            one.refuse()

    def close(self) -> None:
        for one in self._services:
            one.service.close()


class _Service:
    def __init__(self, channel: str, input_: ServiceInput, service: PolledService):
        self.channel, self.input, self.service = channel, input_, service
        self._header: Any = None  # of the call that waits

    def take(self, now_ns: int) -> None:
        if not self.input.prepare(now_ns):
            return
        for request, header in self._requests():
            refused = self.input.call(getattr(request, "data", True), now_ns)
            if refused is None:
                self._header = header
            else:
                self.service.answer(refused, header)

    def answer(self, answer: Answer | None) -> None:
        if answer is not None:
            self.service.answer(answer, self._header)

    def refuse(self) -> None:
        self.answer(self.input.end())
        for _, header in self._requests():
            self.service.answer(_INACTIVE, header)

    def _requests(self) -> Iterator[tuple[Any, Any]]:
        """Those that are there, a few: whoever sends without an end must not hold up the tick."""
        for _ in range(_AT_ONCE):
            taken = self.service.take()
            if taken is None:
                return
            yield taken
