# SPDX-License-Identifier: Apache-2.0
"""Compares the actuator channels in a bag of `fcsl bus record` with those of a replayed run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..bag import Bag, RecordedMachine
from ..bag.bus_topics import topic_of
from ..c_machine import TYPE_FORMATS
from ..descriptor import Channel
from ..errors import BagError
from ..ros.cdr import bits
from ..run import Run

#: Encapsulation, stamp, empty frame, tick; then the value.
_TICK_AT, _VALUE_AT = 20, 28


class ChannelComparison:
    """One channel's messages."""

    def __init__(self, bag: Bag, topic: str, run: Run, channel: Channel):
        self.name, self.topic = channel.name, topic
        self.outputs = [channel.name]
        self.messages = 0
        self._bag, self._run, self._channel = bag, run, channel
        self._is_blob = bag.layout(topic) is None  # alone of all values it has no fixed length
        self._scalar = np.dtype(f"<{TYPE_FORMATS[channel.field.type]}")

    @classmethod
    def all(cls, bag: Bag, recorded: RecordedMachine, run: Run) -> list[ChannelComparison]:
        """Of the actuators. Raises BagError for one that the bag has not."""
        found = []
        for channel in run.machine.channels:
            topic = topic_of(recorded.prefix[1:], channel.name)
            if channel.direction == "actuator":
                bag.topic(topic)
                found.append(cls(bag, topic, run, channel))
        return found

    def tick_of(self, data: bytes) -> int:
        if len(data) < _VALUE_AT:
            raise BagError(
                f"{self._bag.path}: a message of `{self.topic}` ({len(data)} bytes) does not match its schema"
            )
        return int.from_bytes(data[_TICK_AT:_VALUE_AT], "little")

    def differ(self, data: bytes) -> tuple[str, str, str, str, str] | None:
        """(path, recorded, replayed, recorded bits, replayed bits) of the first difference; None if equal."""
        was, now = bits(self._recorded(data)), bits(self._replayed())
        if was.shape != now.shape:
            return self.name, f"{was.size} values", f"{now.size} values", "", ""
        if was.tobytes() == now.tobytes():
            return None
        at = next(i for i in range(was.size) if was[i : i + 1].tobytes() != now[i : i + 1].tobytes())
        path = f"{self.name}[{at}]" if was.size > 1 else self.name
        return path, str(was[at]), str(now[at]), _hex(was[at]), _hex(now[at])

    def _recorded(self, data: bytes) -> Any:
        scalar = np.dtype(np.uint8) if self._is_blob else self._scalar
        begin = _VALUE_AT + (4 if self._is_blob else 0)
        size = len(data) - begin
        if size < 0 or size % scalar.itemsize:
            raise BagError(
                f"{self._bag.path}: a message of `{self.topic}` ({len(data)} bytes) does not match its schema"
            )
        return np.frombuffer(data, scalar, offset=begin)

    def _replayed(self) -> Any:
        """As the bus has it: of a blob its bytes."""
        field = self._channel.field
        values = np.frombuffer(self._run.read(field.offset, field.size), self._scalar.newbyteorder("="))
        if self._is_blob:
            return values[1 : 1 + min(int(values[0]), len(values) - 1)].astype(np.uint8)
        return values.astype(self._scalar)


def _hex(value: Any) -> str:
    return "0x" + np.asarray(value).tobytes()[::-1].hex()
