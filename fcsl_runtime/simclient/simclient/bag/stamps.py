# SPDX-License-Identifier: Apache-2.0
"""The time of a message: the stamp of its header, else the time of recording; and its tick, if it has one."""

from __future__ import annotations

import struct

from rosbags.interfaces import Nodetype

from ..errors import BagError
from ..ros.cdr import ENCAPSULATION
from .bag import Bag

_NS = 1_000_000_000
_HEADER = "std_msgs/msg/Header"
#: After the encapsulation: seconds, nanoseconds, length of frame_id with its terminating zero.
_HEAD = struct.Struct("<4xiII")
_TICK = struct.Struct("<Q")


class Stamps:
    """Times and ticks of the messages of one bag. Caches the layout of each topic's type."""

    def __init__(self, bag: Bag):
        self._bag = bag
        self._stamped: dict[str, bool] = {}
        self._ticked: dict[str, bool] = {}

    def time_ns(self, topic: str, log_ns: int, data: bytes) -> int:
        """The stamp of the message's header in ns; `log_ns` if it has none."""
        if not self.stamped(topic) or len(data) < _HEAD.size or not data.startswith(ENCAPSULATION):
            return log_ns
        seconds, nanoseconds, _ = _HEAD.unpack_from(data)
        return int(seconds * _NS + nanoseconds)

    def stamped(self, topic: str) -> bool:
        """Whether messages of `topic` begin with a header."""
        if topic not in self._stamped:
            self._analyse(topic)
        return self._stamped[topic]

    def ticked(self, topic: str) -> bool:
        """Whether messages of `topic` have a tick behind their header, as those that FCSL defines do."""
        if topic not in self._ticked:
            self._analyse(topic)
        return self._ticked[topic]

    def tick(self, topic: str, data: bytes) -> int | None:
        """The tick of a message; None if it has none."""
        if not self.ticked(topic) or len(data) < _HEAD.size:
            return None
        at = _HEAD.size + _HEAD.unpack_from(data)[2]
        at += (len(ENCAPSULATION) - at) % _TICK.size
        return int(_TICK.unpack_from(data, at)[0]) if at + _TICK.size <= len(data) else None

    def _analyse(self, topic: str) -> None:
        """Finds whether the topic's type has a stamp and a tick; without a readable schema it has neither."""
        self._stamped[topic] = self._ticked[topic] = False
        try:
            fields = self._bag.store(topic).fielddefs[self._bag.topic(topic).type][1]
        except (BagError, KeyError):
            return
        kinds = [kind for _, kind in fields[:2]]
        self._stamped[topic] = kinds[:1] == [(Nodetype.NAME, _HEADER)]
        self._ticked[topic] = (
            self._stamped[topic] and fields[1:2] != [] and fields[1][0] == "tick" and _is_u64(fields[1][1])
        )


def _is_u64(kind: tuple[Nodetype, object]) -> bool:
    return kind[0] == Nodetype.BASE and isinstance(kind[1], tuple) and kind[1][0] == "uint64"
