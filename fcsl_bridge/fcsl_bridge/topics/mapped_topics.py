# SPDX-License-Identifier: Apache-2.0
"""The channels of a machine that the JSON maps onto messages: subscribed topics, read at each tick, and
published topics.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node

from simclient.clock_offsets import named_offset
from simclient.ros import frame_names
from simclient.ros.publish_queue import RunTopics
from simclient.ros.topics import RosTopic, SampleInput, composer_of, sources_of, topics_of
from simclient.run import Run

from ..base.node_main import wait_for_receivers
from ..base.polling import PolledSubscription
from . import qos, tf
from .interfaces import mapped_class, message_class
from .queue_publisher import QueuePublisher

#: For all receivers together to have the last commands.
_SAFE_WAIT_S = 0.2


#: A topic that many publish by design: a receiver picks what it needs by frame.
_SHARED = "tf2_msgs/msg/TFMessage"
#: Stamps that lie this far from ROS time are of another clock, in ns.
_OTHER_CLOCK_NS = 60_000_000_000


class Inputs:
    """Sensor topics, polled. Of several messages since the last tick the newest is used; if it is refused, the one
    before."""

    def __init__(self, node: Node, run: Run):
        self._node = node
        topics = [topic for topic in topics_of(run.machine) if topic.direction == "sensor"]
        ready = [(topic, SampleInput(run, topic), mapped_class(topic.type, topic.type_hash)) for topic in topics]
        self._inputs = [
            _Input(node, t, sample_input, PolledSubscription(node, kind, t.name, qos.SENSOR))
            for t, sample_input, kind in ready
        ]

    def poll(self, now_ns: int, missing: frozenset[str]) -> None:
        """Delivers received messages for the next tick. now_ns: ROS time. Channels in `missing` get nothing."""
        for one in self._inputs:
            one.poll(now_ns, missing)

    def forget(self) -> None:
        """Drops all received messages, which are too old."""
        for one in self._inputs:
            one.forget()

    def figures(self) -> dict[str, int]:
        """Numbers of messages that became samples, and of messages superseded by newer ones."""
        return self._counts(lambda reason: reason in _HARMLESS)

    def troubles(self) -> dict[str, int]:
        """Numbers of refused messages, by reason; and how often a topic was found to have several publishers."""
        for one in self._inputs:
            one.look_at_publishers()
        contested = {f"hal.{one.topic.name} has several publishers": one.contested for one in self._inputs}
        return self._counts(lambda reason: reason not in _HARMLESS) | contested

    def warn_of_other_clocks(self, clock: str) -> None:
        """Logs once for each topic whose stamps are far from ROS time, which is that of `clock`, or as far as one time scale
        from another, at two calls in succession: a clock may have been set between them."""
        for one in self._inputs:
            scales = named_offset(one.behind_ns)
            one.odd = one.odd + 1 if scales or abs(one.behind_ns) > _OTHER_CLOCK_NS else 0
            if one.odd == 2 and not one.warned:
                one.warned = True
                direction = "before" if one.behind_ns > 0 else "after"
                named = f" ({scales.partition(' (')[0]} are so far apart)" if scales else ""
                self._node.get_logger().warning(
                    f"{one.name}: stamped {abs(one.behind_ns) / 1e9:.0f} s {direction} the time of this node, which is "
                    f"that of {clock}: its sender has another clock{named}"
                )

    def _counts(self, wanted: Callable[[str], bool]) -> dict[str, int]:
        return {
            f"hal.{one.topic.name} {reason}": count
            for one in self._inputs
            for reason, count in one.counts().items()
            if wanted(reason)
        }

    def close(self) -> None:
        for one in self._inputs:
            one.close()


#: Counts of a sample input that do not indicate a problem.
_HARMLESS = ("taken", "superseded")


class _Input:
    def __init__(self, node: Node, topic: RosTopic, sample_input: SampleInput, polled: PolledSubscription):
        self._node, self.topic, self._samples, self._polled = node, topic, sample_input, polled
        self._frame_reported = False
        self._foreign = False  # whether a publisher has another definition of the message
        self._superseded = self._misread = self.contested = 0
        self.odd, self.warned = 0, False

    @property
    def name(self) -> str:
        """The topic's full name, remapped."""
        return self._polled.topic

    @property
    def behind_ns(self) -> int:
        """How far the newest stamp lay behind ROS time."""
        return self._samples.behind_ns

    def poll(self, now_ns: int, missing: frozenset[str]) -> None:
        waiting = self._polled.take_all()
        if self._foreign:  # a message does not say whose it is
            self._misread += len(waiting)
            return
        while waiting:
            message = waiting.pop()
            if self._samples.deliver(message, now_ns, missing):
                break
            if not self._frame_reported and "frame" in self._samples.counts():
                self._frame_reported = True
                self._report_frame(message)
        self._superseded += len(waiting)

    def look_at_publishers(self) -> None:
        """Takes no messages while one publisher has another definition of them, which would be misread."""
        found = self._node.get_publishers_info_by_topic(self.name)
        self.contested += self.topic.type != _SHARED and len(found) > 1
        alike = [p for p in found if p.topic_type == self.topic.type and p.topic_type_hash.version]
        others = {str(p.topic_type_hash) for p in alike} - {self.topic.type_hash}
        if others and not self._foreign:
            self._node.get_logger().error(
                f"{self.name}: refused: a publisher has another definition of {self.topic.type} ({min(others)} instead "
                f"of {self.topic.type_hash}); build both sides with the same one"
            )
        self._foreign = bool(others)

    def _report_frame(self, data: bytes) -> None:
        """Logs the frames of the first message that was refused for them."""
        came, wanted = frame_names.differing(data, self.topic.frame, self.topic.child_frame)
        self._node.get_logger().warning(f"{self.name}: refused: its frame is {came}, that of its channels {wanted}")

    def forget(self) -> None:
        while self._polled.take_all():
            pass

    def counts(self) -> dict[str, int]:
        counts = self._samples.counts()
        misread = {"definition": self._misread} if self._misread else {}
        return counts | {"superseded": counts.get("superseded", 0) + self._superseded} | misread

    def close(self) -> None:
        self._polled.close()


class Outputs:
    """Topics of actuators and reports, published at every tick: of actuators their safe values while the machine is
    disarmed. `chosen`: those whose poses go to /tf, too."""

    def __init__(
        self, node: Node, run: Run, queue_publisher: QueuePublisher, messages: RunTopics, chosen: Sequence[str]
    ):
        self._node, self._run, self._messages = node, run, messages
        topics = [topic for topic in topics_of(run.machine) if topic.direction != "sensor"]
        ready = [(t, composer_of(t), mapped_class(t.type, t.type_hash)) for t in topics]
        self._outlets: list[tuple[RosTopic, Any, Any]] = [
            (topic, composer, qos.publisher(node, kind, topic.name, qos.COMMAND)) for topic, composer, kind in ready
        ]
        self._contested = dict.fromkeys((t.name for t in topics), 0)
        self._numbers = {topic.name: queue_publisher.add(publisher) for topic, _, publisher in self._outlets}
        for topic, composer, _ in self._outlets:
            messages.add_channels(self._numbers[topic.name], topic.direction, composer)
        directions = {topic.name: topic.direction for topic in topics}
        posed = [tf.Posed(t.name, t.type, t.frame, t.child_frame, sources_of(t)) for t in topics]
        transforms = tf.broadcasts(chosen, posed)
        self._tf = qos.publisher(node, message_class(tf.MESSAGE), tf.TOPIC, qos.TF) if transforms else None
        for name, composer in transforms.items():
            messages.add_channels(queue_publisher.add(self._tf), directions[name], composer)

    def make_safe(self, time_ns: int) -> None:
        """Publishes the safe values of a machine that something arms, stamped time_ns, and waits a moment for their
        receivers. For the end of ticking: no command follows."""
        if self._run.safe_address is None:
            return
        actuators = [(c, publisher) for topic, c, publisher in self._outlets if topic.direction == "actuator"]
        for composer, publisher in actuators:
            data = composer.compose([self._run.safe_address], time_ns)
            if data is not None:
                publisher.publish(data)
        wait_for_receivers((publisher for _, publisher in actuators), _SAFE_WAIT_S)

    def figures(self) -> dict[str, int]:
        return {}

    def troubles(self) -> dict[str, int]:
        """Numbers of messages that could not be composed, because a value does not fit its field; and how often
        another node was found to publish the same topic."""
        for topic, _, publisher in self._outlets:
            self._contested[topic.name] += self._node.count_publishers(publisher.topic_name) > 1
        contested = {f"hal.{name} published by others": count for name, count in self._contested.items()}
        refused = {
            f"hal.{topic.name} does not fit": composer.refused + self._messages.refused(self._numbers[topic.name])
            for topic, composer, _ in self._outlets
        }
        return refused | contested

    def close(self) -> None:
        for _, _, publisher in self._outlets:
            self._node.destroy_publisher(publisher)
        if self._tf is not None:
            self._node.destroy_publisher(self._tf)
