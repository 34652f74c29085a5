# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 messages of a machine's channels, with their conversions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from ..model.machine import Channel, RosMapping
from ..model.types import Scalar, Type, count_of, scalar_of
from .choices import resolve
from .composer import Source, composer_conversion
from .conversion import ComposerConversion, ReaderConversion
from .interfaces import STANDARD_INTERFACES, Interfaces
from .message_fields import select
from .reader import Pick, reader_conversion
from .standard_messages import STANDARD, full_name
from .type_hash import type_hash

#: The message of std_msgs for one scalar of a type; of arrays its …MultiArray. There is no array of bools.
_SCALAR = {"bool": "Bool", "i32": "Int32", "i64": "Int64", "u32": "UInt32", "u64": "UInt64"}
_SCALAR |= {"f32": "Float32", "f64": "Float64", "Health": "Int32", "TransitionRequest": "Int32"}
_ARRAY = {**_SCALAR, "bool": "UInt8"}
#: That of a blob: its bytes are no values of a conversion.
BLOB = "std_msgs/UInt8MultiArray"


@dataclass(frozen=True)
class Message:
    """A message of channels of one direction. In `composer` the field of channels[i] is memory i, at offset 0; in
    `reader` it is value i."""

    channels: tuple[Channel, ...]
    type: str  # full name
    type_hash: str
    composer: ComposerConversion
    reader: ReaderConversion


def by_topic(channels: Iterable[Channel]) -> list[list[Channel]]:
    """The mapped channels, those of one message together, in the order of the JSON."""
    topics: dict[str, list[Channel]] = {}
    for channel in channels:
        if channel.ros.type:
            topics.setdefault(channel.ros.topic, []).append(channel)
    return list(topics.values())


def message_of(channels: Sequence[Channel]) -> Message:
    """The message of checked channels, which are parts of one. Raises ConversionError where it would be too large."""
    ros = channels[0].ros
    message, found = full_name(ros.type), interfaces_of(ros)
    sources, picks = [], []
    for i, c in enumerate(channels):
        type_, count = scalar_of(c.port.type).name, count_of(c.port.type)
        choices = resolve(found, message, c.ros.field, c.ros.choices)
        sources.append(Source(c.ros.field, type_, count, 0, c.ros.axes, memory=i, name=c.name, choices=choices))
        picks.append(Pick(c.name, (c.ros.field,), type_, count, c.ros.axes, null_refused=True, choices=choices))
    composer = composer_conversion(found.members, message, sources, ros.frame, ros.child_frame)
    reader = reader_conversion(found.members, message, picks, ros.frame, ros.child_frame)
    return Message(tuple(channels), message, type_hash(found.members, message), composer, reader)


def interfaces_of(ros: RosMapping) -> Interfaces:
    """The definition of the message of a mapping."""
    return STANDARD_INTERFACES if ros.interfaces is None else ros.interfaces


def definitions_used(channels: Iterable[Channel]) -> dict[str, Sequence[str]]:
    """The definitions that the messages of channels consist of and that are not standard, by full name."""
    texts: dict[str, Sequence[str]] = {}
    for channel in channels:
        texts |= interfaces_of(channel.ros).texts
    return {name: texts[name] for name in sorted(texts)}


def payload_of(channel: Channel) -> Message:
    """The message of a channel alone, as it lies on the bus: that of its `ros` block, if it is standard, else one of
    std_msgs.

    A NaN and a quaternion of length zero are values there, as they are without a message.
    """
    if channel.kind == "blob":
        blob = full_name(BLOB)
        reader = reader_conversion(STANDARD, blob, [])
        return Message((channel,), blob, type_hash(STANDARD, blob), composer_conversion(STANDARD, blob, []), reader)
    ros = channel.ros if _stands_alone(channel.ros) else standard_mapping(channel.port.type)
    message = message_of([replace(channel, ros=ros)])
    return replace(message, reader=replace(message.reader, nan_allowed=True))


def _stands_alone(ros: RosMapping) -> bool:
    """Whether a receiver that knows the standard messages can read the message of this channel alone."""
    message = full_name(ros.type)
    return message in STANDARD and not ros.choices and not select(STANDARD, message, ros.field).is_length


def standard_mapping(type_: Type) -> RosMapping:
    """The mapping of a value of this type that has no `ros` block."""
    names = _SCALAR if isinstance(type_, Scalar) else _ARRAY
    array = "" if isinstance(type_, Scalar) else "MultiArray"
    return RosMapping(f"std_msgs/{names[scalar_of(type_).name]}{array}", "data", "", "", "", "")
