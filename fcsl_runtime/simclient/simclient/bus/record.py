# SPDX-License-Identifier: Apache-2.0
"""Records machines on the bus into a bag of Jazzy's layout: a topic for each channel, stamped with the time of the tick."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ..errors import BusError
from .machine import BusMachine
from .messages import definition_of, message_of, topic_of, type_names
from .ticks import Tick

_NS = 1_000_000_000
#: The format version of metadata.yaml that Jazzy writes.
_FORMAT = 9


class Recording:
    """An open bag."""

    def __init__(self, writer: Writer, machines: Iterable[BusMachine]):
        self.messages = 0
        self._writer = writer
        self._connections: dict[str, list[Connection]] = {}
        for machine in machines:
            self._connections[machine.prefix] = [self._add(*row) for row in _topics(machine)]

    def _add(self, topic: str, kind: str, definition: str) -> Connection:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(definition, kind))
        return self._writer.add_connection(topic, kind, msgdef=definition, rihs01=store.hash_rihs01(kind))

    def write(self, machine: BusMachine, tick: Tick) -> None:
        connections = self._connections[machine.prefix]
        time_ns = tick.tick * _NS // machine.tick_hz
        for channel, value in tick.values:
            self._writer.write(connections[channel.index], time_ns, message_of(channel, tick.tick, time_ns, value))
            self.messages += 1


def _topics(machine: BusMachine) -> list[tuple[str, str, str]]:
    types = type_names(machine)
    return [(topic_of(machine, c), types[c.name], definition_of(c)) for c in machine.channels]


@contextmanager
def recording(folder: Path, machines: Iterable[BusMachine]) -> Iterator[Recording]:
    """A bag in the new directory `folder`, complete when the block is left in whatever way. Raises BusError."""
    try:
        writer = Writer(folder, version=_FORMAT, storage_plugin=StoragePlugin.MCAP)
        writer.open()
    except (WriterError, OSError) as error:
        reason = "exists already; name a new one" if folder.exists() else str(error)
        raise BusError(f"{folder}: {reason}") from None
    try:
        yield Recording(writer, machines)
    finally:
        writer.close()
