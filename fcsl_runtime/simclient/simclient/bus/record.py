# SPDX-License-Identifier: Apache-2.0
"""Records machines on the bus into a bag of Jazzy's layout: a topic for each channel, stamped with the time of the tick,
and what reproduces the run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..bag.bus_topics import topic_of
from ..bag.native_bag import NativeBag
from .machine import BusMachine
from .messages import (
    CHECKPOINT,
    DESCRIPTOR,
    LACKS,
    RECORD_TOPICS,
    WRITES,
    definition_of,
    message_of,
    string_of,
    type_names,
)
from .reproduction import Event, Reproduction
from .session import Session
from .ticks import Tick
from .writes import Checkpoint, Write, tick_of

_NS = 1_000_000_000
#: Whoever is on the bus may put any tick.
_TIME_NS_MAX = (1 << 63) - 1


class _Part:
    """A machine's part of the bag."""

    def __init__(self, bag: NativeBag, machine: BusMachine, reproduction: Reproduction, report: Callable[[str], None]):
        self.reproduction = reproduction
        self.messages = 0
        self._bag, self._machine, self._report = bag, machine, report
        types = type_names(machine)
        self._channels = [self._add(c.name, types[c.name], definition_of(c)) for c in machine.channels]
        self._record = {name: self._add(name, *row) for name, row in RECORD_TOPICS.items()}
        self._is_described = self._has_reported = False

    def _add(self, name: str, kind: str, definition: str) -> int:
        return self._bag.add(topic_of(self._machine.prefix, name), kind, definition)

    def _write(self, topic: int, tick: int, message: bytes) -> None:
        time_ns = min(tick * _NS // self._machine.tick_hz, _TIME_NS_MAX)
        if not self._is_described:
            self._is_described = True
            self._bag.write(self._record[DESCRIPTOR], time_ns, string_of(self._machine.text))
            self.messages += 1
        self._bag.write(topic, time_ns, message)
        self.messages += 1

    def take(self, event: Event | None) -> None:
        for found in self.reproduction.take(event):
            self._put(found)
        self._put_lacks()

    def end(self) -> None:
        for found in self.reproduction.end():
            self._put(found)
        self._put_lacks()

    def _put(self, found: Tick | Write | Checkpoint) -> None:
        if isinstance(found, Write):
            self._write(self._record[WRITES], tick_of(found.message), found.message)
        elif isinstance(found, Checkpoint):
            self._write(self._record[CHECKPOINT], found.tick, found.message)
            self._report(f"{self._machine.prefix}: reproduces the run from tick {found.tick} on")
        else:
            time_ns = found.tick * _NS // self._machine.tick_hz
            for channel, value in found.values:
                self._write(self._channels[channel.index], found.tick, message_of(channel, found.tick, time_ns, value))

    def _put_lacks(self) -> None:
        """Why the bag does not reproduce the run, as soon as that is known."""
        if self.reproduction.lacks and not self._has_reported:
            self._has_reported = True
            self._report(f"{self._machine.prefix}: {self.reproduction}")
            self._write(self._record[LACKS], max(self.reproduction.last, 0), string_of(self.reproduction.lacks))


class Recording:
    """An open bag."""

    def __init__(self, bag: NativeBag, machines: Iterable[BusMachine], session: Session, report: Callable[[str], None]):
        self._bag = bag
        self._parts = {m.prefix: _Part(bag, m, Reproduction(m, session), report) for m in machines}

    @property
    def messages(self) -> int:
        return sum(part.messages for part in self._parts.values())

    @property
    def verdicts(self) -> dict[str, str]:
        """Of each machine by the beginning of its keys, whether the bag reproduces its run."""
        return {prefix: str(part.reproduction) for prefix, part in self._parts.items()}

    def take(self, found: tuple[BusMachine, Event] | None) -> None:
        """What came; None: nothing more has come yet."""
        if found is not None:
            self._parts[found[0].prefix].take(found[1])
        else:
            for part in self._parts.values():
                part.take(None)
        self._bag.flush_when_due()

    def end(self) -> None:
        for part in self._parts.values():
            part.end()


@contextmanager
def recording(
    folder: Path, machines: Iterable[BusMachine], session: Session, report: Callable[[str], None]
) -> Iterator[Recording]:
    """A bag in the new directory `folder`, complete when the block ends. After `kill -9` it has what a host's recorder
    would have left. `tell` gets what a user may want to know meanwhile. Raises BagError.
    """
    with NativeBag(folder) as bag:
        recorded = Recording(bag, machines, session, report)
        bag.publish()
        yield recorded
        recorded.end()
