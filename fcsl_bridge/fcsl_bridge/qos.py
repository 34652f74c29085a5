# SPDX-License-Identifier: Apache-2.0
"""Quality of service of every topic of the bridge, and how its endpoints are made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def _reliable(depth: int, durability: DurabilityPolicy) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability
    )


#: Bundles. At most one is unanswered, so the last one kept for a late joiner is the one that it must answer: whichever node
#: starts first, none is lost. The depth is for those who listen in.
LOCKSTEP = _reliable(100, DurabilityPolicy.TRANSIENT_LOCAL)
#: Streams: outputs, truth, clock. The depth bridges a subscriber that lags (reliable + keep-last drops beyond it).
STREAM = _reliable(2000, DurabilityPolicy.VOLATILE)
#: What holds until it changes: a late subscriber gets the last word.
LATCHED = _reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)
#: Single events.
EVENT = _reliable(100, DurabilityPolicy.VOLATILE)


def publisher(node: Node, kind: Any, topic: str, profile: QoSProfile) -> Publisher:
    """Without event handlers: each would be waited for in every tick (and the handlers of 20 topics halve the speed)."""
    return node.create_publisher(
        kind, topic, profile, event_callbacks=PublisherEventCallbacks(use_default_callbacks=False)
    )


def subscribe(node: Node, kind: Any, topic: str, take: Callable[[Any], None], profile: QoSProfile) -> None:
    """Likewise."""
    events = SubscriptionEventCallbacks(use_default_callbacks=False)
    node.create_subscription(kind, topic, take, profile, event_callbacks=events)
