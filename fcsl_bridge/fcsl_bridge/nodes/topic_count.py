# SPDX-License-Identifier: Apache-2.0
"""Counts messages as an ordinary subscriber, and prints the counts as one JSON object when it ends.

Subscribes to /clock, to every topic of a machine and its simulator, and to further topics given by name; also to topics
that appear later. Ends on SIGINT or SIGTERM, at most 3 s later if messages flow on, or when nothing was received for `idle_s` since the first message.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ..base.node_main import Option, Stop, positive, read_options, run_node
from ..errors import BridgeError
from ..topics.interfaces import message_class

OPTIONS = (
    Option(
        "machine", str, "", "a machine's name: its topics and the simulator's, below the node's namespace, are counted"
    ),
    Option("topics", list, None, "a list of more topics to count"),
    Option("idle_s", float, None, "seconds without a message after which the count ends; by default never"),
)
_DISCOVERY_PERIOD_S = 0.1
#: Period of checking for signals, in s.
_POLL_S = 0.1
#: Deeper than any backlog of a lock-step run: received messages are counted even after the run.
_DEPTH = 100_000
#: After a signal, messages that have arrived are still counted, until none was received for this long, in s; where they flow
#: on, not longer than the second one.
_QUIET_S, _DRAIN_S = 0.3, 3.0


class Counter:
    """Subscriptions and what they received. `counts` maps topic to number of messages."""

    def __init__(self, node: Node, prefixes: tuple[str, ...], names: list[str]):
        self._node, self._prefixes, self._names = node, prefixes, set(names)
        self._refused: set[str] = set()
        self.counts: dict[str, int] = {}
        self.last = 0.0

    def join(self) -> None:
        """Subscribes to new topics that are to be counted."""
        for topic, types in self._node.get_topic_names_and_types():
            wanted = topic in self._names or topic.startswith(self._prefixes)
            if not wanted or topic in self.counts or topic in self._refused:
                continue
            publishers = self._node.get_publishers_info_by_topic(topic)
            if publishers:
                self._subscribe(topic, types, publishers)

    def _subscribe(self, topic: str, types: list[str], publishers: list[Any]) -> None:
        try:
            kind = message_class(types[0])
        except BridgeError as error:
            self._refused.add(topic)
            print(f"topic_count: {topic} is not counted: {error}", file=sys.stderr, flush=True)
            return
        self.counts[topic] = 0
        self._node.create_subscription(kind, topic, lambda data: self._take(topic), _matching(publishers), raw=True)
        print(f"counting {topic}", file=sys.stderr, flush=True)

    def _take(self, topic: str) -> None:
        self.counts[topic] += 1
        self.last = time.monotonic()


def _matching(publishers: list[Any]) -> QoSProfile:
    """The strongest quality of service that all publishers offer."""
    reliable = all(p.qos_profile.reliability == ReliabilityPolicy.RELIABLE for p in publishers)
    latched = all(p.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in publishers)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _count(counter: Counter, executor: SingleThreadedExecutor, stop: Stop, idle_s: float | None) -> None:
    checked = signalled = 0.0
    while True:
        now = time.monotonic()
        quiet_s = now - counter.last if counter.last else 0.0
        signalled = signalled or (now if stop.signal else 0.0)
        if signalled and (not counter.last or quiet_s > _QUIET_S or now - signalled > _DRAIN_S):
            return
        if idle_s is not None and quiet_s > idle_s:
            return
        if now - checked > _DISCOVERY_PERIOD_S and not stop.signal:
            checked = now
            counter.join()
        executor.spin_once(timeout_sec=_POLL_S)


def _body(node: Node, stop: Stop) -> int:
    options = read_options(node, OPTIONS)
    positive(options, "idle_s")
    base = node.get_namespace().rstrip("/")
    prefixes = (f"{base}/{options['machine']}/", f"{base}/sim/") if options["machine"] else ()
    counter = Counter(node, prefixes, ["/clock", *(options["topics"] or [])])
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    print("waiting for topics", file=sys.stderr, flush=True)
    try:
        _count(counter, executor, stop, options["idle_s"])
    finally:
        executor.shutdown(timeout_sec=1.0)
    print(json.dumps(dict(sorted(counter.counts.items()))))
    return 0


def main() -> None:
    sys.exit(run_node("topic_count", OPTIONS, _body))
