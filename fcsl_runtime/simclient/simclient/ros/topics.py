# SPDX-License-Identifier: Apache-2.0
"""The channels of a machine that its JSON maps onto ROS 2 messages, by topic, and the conversions of their messages, which
are those of the machine's library.

Channels of one direction that name the same topic are parts of one message.
"""

from __future__ import annotations

import weakref
from ctypes import byref, c_uint32
from dataclasses import dataclass

from fcsl_compiler.api.ros import Source

from ..c_run import CError
from ..descriptor import Channel, Machine, RosMessage
from ..errors import TwinError
from ..run import Run
from . import native
from .composer import Composer
from .reader import REASONS, Reader


@dataclass(frozen=True)
class RosTopic:
    """A topic of a machine's `ros` blocks.

    `name` is relative to the node's namespace unless it begins with a slash; `type` is the full name of its message;
    `type_hash` that of its definition at build time; `direction` is "sensor" (the machine receives it) or "actuator" or
    "report" (the machine sends it); frames may be empty.
    """

    name: str
    type: str
    type_hash: str
    frame: str
    child_frame: str
    direction: str
    channels: tuple[Channel, ...]
    message: RosMessage


def topics_of(machine: Machine) -> tuple[RosTopic, ...]:
    """The topics of a machine, in the order of its JSON."""
    return tuple(_topic(machine, message) for message in machine.ros_messages)


def _topic(machine: Machine, message: RosMessage) -> RosTopic:
    first, *others = (machine.channels[index] for index in message.channels)
    frames = first.ros_frame, first.ros_child_frame
    return RosTopic(message.topic, message.type, message.type_hash, *frames, first.direction, (first, *others), message)


def reader_of(topic: RosTopic) -> Reader:
    """A reader of the topic's messages, with a column for each channel by name."""
    columns = [(c.name, c.field.type, c.field.count) for c in topic.channels]
    return Reader.compiled(topic.message.reader, columns)


def readings_of(topic: RosTopic) -> list[tuple[tuple[str | int, ...], bool]]:
    """Of each channel what its indices stand for, () without choices, and whether its list may be shorter."""
    conversion = native.CReaderConversion.from_address(topic.message.reader)
    values = [conversion.values[i] for i in range(conversion.value_count)]
    return [(_choices(conversion, value), bool(value.limited)) for value in values]


def _choices(conversion: native.CReaderConversion, value: native.CValue) -> tuple[str | int, ...]:
    if not value.choice_count:
        return ()
    if value.first_choice != native.NONE:
        return tuple(conversion.choices[value.first_choice + i] for i in range(value.choice_count))
    anchor = conversion.terms[conversion.rows[value.first_row].first_term].anchor
    parts = (conversion.parts[i] for i in range(conversion.part_count))
    part = next(part for part in parts if part.code == native.CHOICE and part.size == anchor)
    return tuple(conversion.names[part.first + i].decode() for i in range(part.count))


def sources_of(topic: RosTopic) -> list[Source]:
    """What fills the topic's message, in a machine struct (memory 0), for another message that has some of it."""
    return [
        Source(c.ros_field, c.field.type, c.field.count, c.field.offset, axes=c.ros_axes, name=c.name)
        for c in topic.channels
    ]


def composer_of(topic: RosTopic) -> Composer:
    """A composer of the topic's message from a machine struct (memory 0)."""
    return Composer.compiled(topic.message.composer)


class SampleInput:
    """Delivers the messages of a sensor topic to a run."""

    def __init__(self, run: Run, topic: RosTopic):
        """Raises TwinError."""
        self._run, self._reader = run, reader_of(topic)
        self._names = [channel.name for channel in topic.channels]
        library, error = native.library(), CError()
        channels = (c_uint32 * len(topic.channels))(*(c.index for c in topic.channels))
        handle = library.fcsl_sample_input_new(run.handle(), self._reader.handle, channels, len(channels), byref(error))
        if not handle:
            raise TwinError(error.text.decode("utf-8", "replace"))
        self._handle, self._deliver, self._counts = (
            handle,
            library.fcsl_sample_input_deliver,
            library.fcsl_sample_input_counts,
        )
        weakref.finalize(self, library.fcsl_sample_input_free, handle)

    def deliver(self, cdr: bytes, now_ns: int, missing: frozenset[str] = frozenset()) -> int:
        """Writes the message's values (CDR) to its channels, for the next tick; returns the number of channels written.

        `now_ns`: current time of the stamps' clock. `missing`: names of channels that get nothing. A refused message
        writes none. Raises TwinError once closed.
        """
        self._run.handle()
        mask = bytes(name in missing for name in self._names) if missing else None
        return int(self._deliver(self._handle, cdr, len(cdr), now_ns, mask))

    def counts(self) -> dict[str, int]:
        """Accepted messages, and refused messages or values by reason (REASONS); zero counts are left out."""
        counts = self._counts(self._handle)
        return {reason: counts[i] for i, reason in enumerate(REASONS) if i == 0 or counts[i]}

    @property
    def behind_ns(self) -> int:
        """How far the stamp of the newest readable message lay behind its `now_ns` (negative: ahead), in ns; 0 where it
        had no stamp."""
        return int(native.library().fcsl_sample_input_behind_ns(self._handle))
