# SPDX-License-Identifier: Apache-2.0
"""Shows the board of a running flight program, fcsl-fc, on /diagnostics: its sensors and devices, once per second; and
requests that its machine has lost.

It asks the variable server of the program (`fcsl-fc --socket`). It waits for a program, and for the next one when that
has ended; the statuses are STALE meanwhile.
"""

from __future__ import annotations

import sys
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from simclient.instance_times import of_stats as times_of_stats
from simclient.requirements import of_stats as verdicts_of_stats
from simclient.vars.client import VarClient
from simclient.vars.wire import VarError

from ..base.node_main import Option, Stop, read_options, run_node
from ..diagnostics.board_status import BoardStatus
from ..diagnostics.lost_request_status import LostRequestStatus
from ..diagnostics.requirement_status import RequirementStatus
from ..diagnostics.time_status import TimeStatus
from ..errors import BridgeError, Stopped
from ..topics import qos

OPTIONS = (
    Option("socket", str, None, "that of the flight program: a path, or tcp:HOST:PORT"),
    Option("token", str, "", "the file with the token of a TCP server"),
)
_PERIOD_S, _POLL_S = 1.0, 0.05
#: How long the program may take to answer, in s.
_TIMEOUT_S = 1.0
#: Codes of a program that is not there, or hangs; any other error is one of the user.
_ABSENT = ("unreachable", "closed", "timeout")


class BoardWatch:
    """Publishes what the flight program at `address` says of its board and of lost requests. Raises BridgeError where
    waiting cannot help."""

    def __init__(self, node: Node, address: str, token: str):
        self._node, self._address, self._token = node, address, token or None
        self._publisher = qos.publisher(node, DiagnosticArray, "/diagnostics", qos.EVENT)
        self._client: VarClient | None = None
        self._flight: tuple[BoardStatus, LostRequestStatus, RequirementStatus, TimeStatus] | None = None
        self._statuses: list[DiagnosticStatus] = []
        print(f"waiting for a flight program at {address}", flush=True)

    def publish(self) -> None:
        try:
            self._poll()
        except VarError as error:
            if error.code not in _ABSENT:
                raise BridgeError(str(error)) from None
            self._lose(str(error))
        if self._statuses:
            message = DiagnosticArray(status=self._statuses)
            message.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(message)

    def _poll(self) -> None:
        if self._client is None:
            self._client = VarClient(self._address, self._token, _TIMEOUT_S)
        if self._flight is None:
            machine = self._client.describe()["machine"]
            if not self._client.list("hal.devices."):
                raise BridgeError(
                    f"the flight program at {self._address} has no board with devices: --hal linux:PLAN has one"
                )
            name = f"{self._node.get_namespace().rstrip('/')}/{machine}"[1:]
            self._flight = (
                BoardStatus(name, machine),
                LostRequestStatus(name, machine),
                RequirementStatus(name, machine),
                TimeStatus(name, machine),
            )
            print(f"{machine}: its board is on /diagnostics", flush=True)
        board, requests, requirements, times = self._flight
        counters, stats = self._client.get_value("hal"), self._client.stats()
        lost = stats.get("lost_requests", {})  # a program of an older version does not tell
        verdicts = verdicts_of_stats(stats.get("requirements", {}))
        self._statuses = requests.statuses(stats["state"], lost) + board.statuses(counters)
        self._statuses += requirements.statuses(verdicts)
        self._statuses += times.statuses(times_of_stats(stats.get("times", {})))

    def _lose(self, why: str) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
        if self._flight is not None:
            self._flight = None
            print(f"{why}; waiting for the next flight program", flush=True)
        for status in self._statuses:
            status.level, status.message = DiagnosticStatus.STALE, why


def _body(node: Node, stop: Stop) -> int:
    options = read_options(node, OPTIONS)
    if not options["socket"]:
        raise BridgeError("parameter `socket` is missing: -p socket:=<that of fcsl-fc>")
    watch, due = BoardWatch(node, options["socket"], options["token"]), 0.0
    try:
        while True:
            stop.check()
            if time.monotonic() >= due:
                due = time.monotonic() + _PERIOD_S
                watch.publish()
            time.sleep(_POLL_S)
    except Stopped:
        return 0


def main() -> None:
    sys.exit(run_node("diagnostics_node", OPTIONS, _body))
