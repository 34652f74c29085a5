# SPDX-License-Identifier: Apache-2.0
"""Polled subscriptions and services, and a node's other callbacks in the slack between ticks.

rclpy's executors build a wait set of every entity of the node for each wait (0.5 ms with 20 topics). A loop that
waits for one topic a thousand times a second waits for that topic only, and serves the other entities occasionally.
"""

from __future__ import annotations

import time
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile

from .node_main import Stop

#: Period of checking services, parameters and signals, in s; also the longest single wait.
SERVE_PERIOD_S = 0.02
_NS = 1_000_000_000


class _NeverExecuted(CallbackGroup):
    """Hides its members from executors, so that only the poller takes their messages."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        raise AssertionError("no executor runs what is polled")


class PolledSubscription:
    """Raw messages of one topic, taken by the owner. Not thread-safe."""

    def __init__(self, node: Node, kind: Any, topic: str, profile: QoSProfile):
        self._node, self._kind, self._depth = node, kind, profile.depth
        self._group = _NeverExecuted()  # the node keeps only a weak reference
        self._subscription = node.create_subscription(
            kind,
            topic,
            _unused,
            profile,
            callback_group=self._group,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )
        self._handle = self._subscription.handle
        self._wait_set = _rclpy.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)

    @property
    def topic(self) -> str:
        """The topic's full name, remapped."""
        return str(self._subscription.topic_name)

    def take(self) -> bytes | None:
        """The oldest queued message as CDR; None if there is none. DDS may have padded its end to a whole word."""
        taken = self._handle.take_message(self._kind, True)
        return None if taken is None else taken[0]

    def take_all(self) -> list[bytes]:
        """All queued messages, oldest first; at most the queue's depth."""
        taken: list[bytes] = []
        while len(taken) < self._depth and (data := self.take()) is not None:
            taken.append(data)
        return taken

    def wait(self, timeout_s: float) -> None:
        """Returns when a message may be available, or after timeout_s."""
        self._wait_set.clear_entities()  # wait() leaves only ready entities
        self._wait_set.add_subscription(self._handle)
        self._wait_set.wait(max(0, int(timeout_s * _NS)))

    def close(self) -> None:
        self._wait_set.destroy_when_not_in_use()
        self._node.destroy_subscription(self._subscription)


class PolledService:
    """Requests of one service, taken by the owner, who answers them when it can. Not thread-safe."""

    def __init__(self, node: Node, kind: Any, name: str):
        self._node, self._kind = node, kind
        self._group = _NeverExecuted()  # the node keeps only a weak reference
        self._service = node.create_service(kind, name, _unused, callback_group=self._group)

    def take(self) -> tuple[Any, Any] | None:
        """The oldest request that waits, and what its answer needs; None if there is none."""
        request, header = self._service.handle.service_take_request(self._kind.Request)
        return None if header is None else (request, header)

    def answer(self, values: tuple[Any, ...], header: Any) -> None:
        """Sends a response with these values, in the order of its fields. A caller that is gone does not get it."""
        response = self._kind.Response()
        for name, value in zip(response.get_fields_and_field_types(), values, strict=True):
            setattr(response, name, value)
        self._service.send_response(response, header)

    def close(self) -> None:
        self._node.destroy_service(self._service)


def _unused(*_: Any) -> None:
    raise AssertionError("what is polled has no callback")


class Housekeeping:
    """Runs the callbacks of a node's services, parameters and timers in the calling thread, between two ticks."""

    def __init__(self, node: Node, stop: Stop):
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._stop = stop
        self._due = 0.0

    def serve(self) -> None:
        """Runs one ready callback, at most every SERVE_PERIOD_S. Raises Stopped once a signal has arrived."""
        now = time.monotonic()
        if now >= self._due:
            self._stop.check()
            self._executor.spin_once(timeout_sec=0)
            self._due = time.monotonic() + SERVE_PERIOD_S

    def idle(self, timeout_s: float) -> None:
        """Waits until timeout_s has passed or one callback has run. Raises Stopped."""
        self._stop.check()
        self._executor.spin_once(timeout_sec=min(timeout_s, SERVE_PERIOD_S))

    def close(self) -> None:
        self._executor.shutdown(timeout_sec=1.0)
