# SPDX-License-Identifier: Apache-2.0
"""Quality of service of every topic of the bridge, and how its endpoints are made."""

from __future__ import annotations

from typing import Any

from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy


def _keep_last(depth: int, durability: DurabilityPolicy, reliability: ReliabilityPolicy) -> QoSProfile:
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=reliability, durability=durability)


def _reliable(depth: int, durability: DurabilityPolicy) -> QoSProfile:
    return _keep_last(depth, durability, ReliabilityPolicy.RELIABLE)


#: Streams: outputs, truth, clock. The depth bridges a subscriber that lags (reliable + keep-last drops beyond it).
STREAM = _reliable(2000, DurabilityPolicy.VOLATILE)
#: Latched topics: a late subscriber gets the last message.
LATCHED = _reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)
#: The same of a publisher that lives while its loop says so, and sends its message again (machine_topics.py): whoever asks
#: for this lease or this deadline learns of a dead controller.
WATCHED = _reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)
WATCHED.liveliness = LivelinessPolicy.MANUAL_BY_TOPIC
WATCHED.liveliness_lease_duration = Duration(seconds=2)
WATCHED.deadline = Duration(seconds=2)
#: Latched topics, for a subscriber that needs every change.
LATCHED_HISTORY = _reliable(100, DurabilityPolicy.TRANSIENT_LOCAL)
#: Sensors of a robot, subscribed: best effort matches every publisher, and a retransmitted message would be too old.
#: The depth covers the messages between two ticks.
SENSOR = _keep_last(10, DurabilityPolicy.VOLATILE, ReliabilityPolicy.BEST_EFFORT)
#: /tf, as tf2's broadcaster has it.
TF = _reliable(100, DurabilityPolicy.VOLATILE)
#: Commands to actuators: only the newest are used.
COMMAND = _reliable(10, DurabilityPolicy.VOLATILE)
#: Single events.
EVENT = _reliable(100, DurabilityPolicy.VOLATILE)


def publisher(node: Node, kind: Any, topic: str, profile: QoSProfile) -> Publisher:
    """Without event handlers: every wait would include them (the handlers of 20 topics halve the speed)."""
    return node.create_publisher(
        kind, topic, profile, event_callbacks=PublisherEventCallbacks(use_default_callbacks=False)
    )
