# SPDX-License-Identifier: Apache-2.0
"""Times and ticks of messages: the stamp of a header, the time of recording (log time), and the clock of a command."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable

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
        stamp_ns = self.stamp_ns(topic, data)
        return log_ns if stamp_ns is None else stamp_ns

    def stamp_ns(self, topic: str, data: bytes) -> int | None:
        """The stamp of the message's header in ns, None if it has none."""
        if not self.stamped(topic) or len(data) < _HEAD.size or not data.startswith(ENCAPSULATION):
            return None
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


#: The clocks that a user may choose.
CLOCKS = ("header", "log")
_MAX_LISTED = 5


class Clock:
    """The one clock by which a command places the messages of `topics`: header stamps, or log times.

    `wanted` is one of CLOCKS, or "": header stamps if all of the topics have them. In a recording of FCSL both are the
    same. By header stamps a message has no time if it has no header, or the stamp zero, unless its log time is zero, too.
    """

    def __init__(self, bag: Bag, topics: Iterable[str], wanted: str = ""):
        self._stamps = Stamps(bag)
        self._own = tuple(f"{machine.prefix}/" for machine in bag.machines(by_bystanders=True))
        self._without = sorted(topic for topic in topics if bag.topics[topic].count and not self._has_stamp(topic))
        self.by_header = wanted == "header" or (not wanted and not self._without)
        self._unset: Counter[str] = Counter()

    def _has_stamp(self, topic: str) -> bool:
        return self._stamps.stamped(topic) or topic.startswith(self._own)

    def time_ns(self, topic: str, log_ns: int, data: bytes) -> int | None:
        """The time of a message in ns; None if it has none."""
        if not self.by_header:
            return log_ns
        stamp_ns = self._stamps.stamp_ns(topic, data)
        if stamp_ns is None:
            return log_ns if topic.startswith(self._own) else None
        if stamp_ns == 0 != log_ns and not self._stamps.ticked(topic):
            self._unset[topic] += 1
            return None
        return stamp_ns

    @property
    def name(self) -> str:
        return "header stamps" if self.by_header else "log times"

    @property
    def timeless(self) -> list[str]:
        """Which of the messages up to now have no time."""
        without = [f"{_listed(self._without)}, without a header"] if self.by_header and self._without else []
        return without + [f"{_counted(n)} of {topic} with the stamp zero" for topic, n in self._unset.items()]

    def __str__(self) -> str:
        why = f" ({_listed(self._without)} without a header)" if self._without and not self.by_header else ""
        return self.name + why


def _counted(messages: int) -> str:
    return "1 message" if messages == 1 else f"{messages} messages"


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
    return ", ".join(names[:_MAX_LISTED]) + more
