# SPDX-License-Identifier: Apache-2.0
"""Mapped poses on /tf, and the frames of a machine's views on /tf_static, as tf2's broadcasters send them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node

from fcsl_compiler.api.ros import STANDARD, short_name
from simclient.errors import did_you_mean
from simclient.ros.composer import Composer, Source
from simclient.view.views import Frame, views_or_remark

from ..base.node_main import Option
from ..errors import BridgeError
from . import qos
from .interfaces import message_class

#: Absolute, as tf2 has them; `-r /tf:=tf` puts one below the namespace.
TOPIC, _STATIC_TOPIC = "/tf", "/tf_static"
MESSAGE = "tf2_msgs/msg/TFMessage"
OPTION = Option("tf", list, None, "a list of mapped topics whose poses go to /tf, too: odom, or pose=base_link")
#: Where a message has position and orientation.
_POSES = {
    "geometry_msgs/msg/PoseStamped": ("pose.position", "pose.orientation"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("pose.pose.position", "pose.pose.orientation"),
    "geometry_msgs/msg/TransformStamped": ("transform.translation", "transform.rotation"),
    "nav_msgs/msg/Odometry": ("pose.pose.position", "pose.pose.orientation"),
}
_STAMPED = "transforms[0]."
_TARGETS = (f"{_STAMPED}transform.translation", f"{_STAMPED}transform.rotation")


@dataclass(frozen=True)
class Chosen:
    """The parameter `tf`, and the topic that the transforms go to."""

    topics: tuple[str, ...]
    tf_topic: str


@dataclass(frozen=True)
class Posed:
    """A topic that the node publishes: full name of its type, frames, and what fills its message."""

    name: str
    type: str
    frame: str
    child_frame: str
    sources: Sequence[Source]


def broadcasts(chosen: Iterable[str], topics: Sequence[Posed]) -> dict[str, Composer]:
    """Composers of messages for /tf, each with one transform, by the name of their topic. `chosen`: values of the
    parameter `tf`. Raises BridgeError."""
    found: dict[str, Composer] = {}
    children: dict[str, str] = {}
    for text in chosen:
        name, _, child = text.partition("=")
        topic = next((topic for topic in topics if topic.name == name), None)
        if topic is None:
            names = [topic.name for topic in topics if topic.type in _POSES]
            hint = did_you_mean(name, names) or f"; there are {', '.join(names) or 'none'}"
            raise BridgeError(f"parameter `tf`: this node publishes no pose on `{name}`{hint}")
        posed = replace(topic, child_frame=child or topic.child_frame)
        _check(text, posed)
        if name in found:
            raise BridgeError(f"parameter `tf`: `{name}` is named twice")
        if posed.child_frame in children:
            raise BridgeError(
                f"parameter `tf`: `{children[posed.child_frame]}` and `{text}` both place `{posed.child_frame}`"
            )
        children[posed.child_frame] = text
        found[name] = _composer(text, posed)
    return found


def _check(text: str, topic: Posed) -> None:
    if topic.type not in _POSES:
        names = ", ".join(map(short_name, _POSES))
        raise BridgeError(f"parameter `tf`: `{topic.name}` is a {short_name(topic.type)}; poses are in {names}")
    if not topic.frame:
        raise BridgeError(f"parameter `tf`: `{topic.name}` has no frame; write `frame` into its `ros` block")
    if not topic.child_frame:
        raise BridgeError(
            f"parameter `tf`: `{topic.name}` names no child frame; write {topic.name}=base_link, for example"
        )
    if topic.frame == topic.child_frame:
        raise BridgeError(f"parameter `tf`: `{text}` places `{topic.frame}` in itself")
    for frame in (topic.frame, topic.child_frame):
        if frame.startswith("/"):
            raise BridgeError(f"parameter `tf`: frame `{frame}` of `{topic.name}`: tf2 takes none with a leading slash")


def _composer(text: str, topic: Posed) -> Composer:
    """Of a message with the parts of the pose that the topic has; other parts are those of the identity."""
    sources = []
    for source in topic.sources:
        for pose, target in zip(_POSES[topic.type], _TARGETS, strict=True):
            if source.field == pose or source.field.startswith(f"{pose}."):
                sources.append(replace(source, field=target + source.field.removeprefix(pose)))
    if not sources:
        raise BridgeError(f"parameter `tf`: nothing fills the pose of `{text}`")
    return Composer(STANDARD, MESSAGE, sources, topic.frame, topic.child_frame, _STAMPED)


class StaticFrames:
    """Publishes the frames of `views` (a machine's, as text) once, for all who come. Without tf2_msgs it only says so: the
    machine runs without them. Stamp 0, since they hold at all times."""

    def __init__(self, node: Node, views: str):
        self._node, self._publisher = node, None
        shown, _ = views_or_remark(views)
        if shown is None or not shown.frames:
            return
        try:
            kind = message_class(MESSAGE)
        except BridgeError as error:
            node.get_logger().warning(f"the machine's frames are not on {_STATIC_TOPIC}: {error}")
            return
        self._publisher = qos.publisher(node, kind, _STATIC_TOPIC, qos.LATCHED)
        self._publisher.publish(kind(transforms=[_transform(frame) for frame in shown.frames]))

    def close(self) -> None:
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)


def _transform(frame: Frame) -> TransformStamped:
    message = TransformStamped(child_frame_id=frame.frame)
    message.header.frame_id = frame.parent
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = frame.position
    rotation.w, rotation.x, rotation.y, rotation.z = frame.rotation
    return message
