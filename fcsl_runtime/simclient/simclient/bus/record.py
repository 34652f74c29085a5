# SPDX-License-Identifier: Apache-2.0
"""Records machines on the bus into a bag of Jazzy's layout: a topic for each channel, stamped with the time of the tick,
and what reproduces the run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ..bag.bus_topics import topic_of
from ..errors import BusError
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
#: The format version of metadata.yaml that Jazzy writes.
_FORMAT = 9


class _Part:
    """A machine's part of the bag."""

    def __init__(self, writer: Writer, machine: BusMachine, reproduction: Reproduction, tell: Callable[[str], None]):
        self.reproduction = reproduction
        self.messages = 0
        self._writer, self._machine, self._tell = writer, machine, tell
        types = type_names(machine)
        self._channels = [self._add(c.name, types[c.name], definition_of(c)) for c in machine.channels]
        self._record = {name: self._add(name, *row) for name, row in RECORD_TOPICS.items()}
        self._is_described = self._has_told = False

    def _add(self, name: str, kind: str, definition: str) -> Connection:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(definition, kind))
        topic = topic_of(self._machine.prefix, name)
        return self._writer.add_connection(topic, kind, msgdef=definition, rihs01=store.hash_rihs01(kind))

    def _write(self, connection: Connection, tick: int, message: bytes) -> None:
        time_ns = min(tick * _NS // self._machine.tick_hz, _TIME_NS_MAX)
        if not self._is_described:
            self._is_described = True
            self._writer.write(self._record[DESCRIPTOR], time_ns, string_of(self._machine.text))
            self.messages += 1
        self._writer.write(connection, time_ns, message)
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
            self._tell(f"{self._machine.prefix}: reproduces the run from tick {found.tick} on")
        else:
            time_ns = found.tick * _NS // self._machine.tick_hz
            for channel, value in found.values:
                self._write(self._channels[channel.index], found.tick, message_of(channel, found.tick, time_ns, value))

    def _put_lacks(self) -> None:
        """Why the bag does not reproduce the run, as soon as that is known."""
        if self.reproduction.lacks and not self._has_told:
            self._has_told = True
            self._tell(f"{self._machine.prefix}: {self.reproduction}")
            self._write(self._record[LACKS], max(self.reproduction.last, 0), string_of(self.reproduction.lacks))


class Recording:
    """An open bag."""

    def __init__(self, writer: Writer, machines: Iterable[BusMachine], session: Session, tell: Callable[[str], None]):
        self._parts = {m.prefix: _Part(writer, m, Reproduction(m, session), tell) for m in machines}

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
            return
        for part in self._parts.values():
            part.take(None)

    def end(self) -> None:
        for part in self._parts.values():
            part.end()


@contextmanager
def recording(
    folder: Path, machines: Iterable[BusMachine], session: Session, tell: Callable[[str], None]
) -> Iterator[Recording]:
    """A bag in the new directory `folder`, complete when the block is left in whatever way. `tell` gets what a user may
    want to know meanwhile. Raises BusError.
    """
    try:
        writer = Writer(folder, version=_FORMAT, storage_plugin=StoragePlugin.MCAP)
        writer.open()
    except (WriterError, OSError) as error:
        reason = "exists already; name a new one" if folder.exists() else str(error)
        raise BusError(f"{folder}: {reason}") from None
    try:
        bag = Recording(writer, machines, session, tell)
        try:
            yield bag
        finally:
            bag.end()
    finally:
        writer.close()
