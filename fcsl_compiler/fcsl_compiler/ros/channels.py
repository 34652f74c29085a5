# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 messages of a machine's mapped channels, with their plans."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..model.machine import Channel
from ..model.types import count_of, scalar_of
from .composer import Source, composer_plan
from .plan import ComposerPlan, ReaderPlan
from .reader import Pick, reader_plan
from .standard_messages import STANDARD, full_name


@dataclass(frozen=True)
class Message:
    """A message of channels of one direction. In `composer` the field of channels[i] is memory i, at offset 0; in
    `reader` it is value i."""

    channels: tuple[Channel, ...]
    type: str  # full name
    composer: ComposerPlan
    reader: ReaderPlan


def by_topic(channels: Iterable[Channel]) -> list[list[Channel]]:
    """The mapped channels, those of one message together, in the order of the JSON."""
    topics: dict[str, list[Channel]] = {}
    for channel in channels:
        if channel.ros.type:
            topics.setdefault(channel.ros.topic, []).append(channel)
    return list(topics.values())


def message_of(channels: Sequence[Channel]) -> Message:
    """The message of checked channels, which are parts of one. Raises PlanError where it would be too large."""
    ros = channels[0].ros
    sources, picks = [], []
    for i, c in enumerate(channels):
        type_, count = scalar_of(c.port.type).name, count_of(c.port.type)
        sources.append(Source(c.ros.field, type_, count, 0, axes=c.ros.axes, memory=i, name=c.name))
        picks.append(Pick(c.name, (c.ros.field,), type_, count, axes=c.ros.axes))
    message = full_name(ros.type)
    composer = composer_plan(STANDARD, message, sources, ros.frame, ros.child_frame)
    reader = reader_plan(STANDARD, message, picks, ros.frame, ros.child_frame)
    return Message(tuple(channels), message, composer, reader)
