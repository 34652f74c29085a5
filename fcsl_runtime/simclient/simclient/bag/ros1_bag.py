# SPDX-License-Identifier: Apache-2.0
"""ROS 1 bags; each message is converted to the CDR of the same fields in ROS 2 (whose header has no `seq`)."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import partial

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ..errors import BagError
from .bag import Bag, Topic
from .batch import Message, batch_of
from .files import bag_files
from .losses import Loss, Losses
from .ros1_file import Connection, Damaged, Piece, Ros1File
from .time_order import Block, Part, in_time_order, sorted_by_time
from .unpack import TooLarge

_HEADER = "std_msgs/msg/Header"


class _Pass:
    """One pass over the messages of one file."""

    def __init__(self, file: Ros1File, topics: dict[int, Topic]):
        self.file = file
        self.topics = topics
        self.losses = Losses()
        #: Bytes read so far.
        self.position = 0

    @property
    def damage(self) -> str:
        """What could not be read up to now, as text."""
        end = f"breaks off after {sum(self.file.counts.values())} messages" if self.file.broken else ""
        text = "; ".join(part for part in (str(self.losses), end) if part)
        return f"{self.file.path.name} {text}" if text else ""


class Ros1Bag(Bag):
    """A ROS 1 bag, or several in one directory."""

    def _open(self) -> None:
        self.files = bag_files(self.path)
        self._types: dict[tuple[str, str], tuple[Typestore, str]] = {}
        self._ros1 = [Ros1File(file) for file in self.files]
        for file in self._ros1:
            for number, connection in file.connections.items():
                self._count(replace(self._topic_of(connection), count=file.counts.get(number, 0)))
            if damage := self._pass(file, ()).damage:
                self._damaged(file.path, damage)

    def _in_file_order(self, topics: Collection[str] | None, beyond_damage: bool) -> Iterator[Block]:
        self.read_bytes = before = 0
        for number, file in enumerate(self._ros1):
            self.reading = number
            reading = self._pass(file, topics)
            for piece in file.pieces:
                yield from self._blocks(reading, piece)
                self.read_bytes = before + reading.position
                self.lost = len(reading.losses.parts)
                if reading.losses.parts and not beyond_damage:
                    break
            self._judge(reading)
            if reading.damage and not beyond_damage:
                return
            before += file.path.stat().st_size

    def _in_time_order(self, topics: Collection[str] | None) -> Iterator[Block]:
        self.read_bytes = 0
        passes = [self._pass(file, topics) for file in self._ros1]
        parts = [
            Part(piece.first_ns or 0, partial(self._blocks, reading, piece))
            for reading in passes
            for piece in reading.file.pieces
        ]
        for block in in_time_order(parts, str(self.path)):
            self.read_bytes = sum(reading.position for reading in passes)
            yield block
        for reading in passes:
            self._judge(reading)

    def _pass(self, file: Ros1File, topics: Collection[str] | None) -> _Pass:
        chosen = {n: c for n, c in file.connections.items() if topics is None or c.topic in topics}
        return _Pass(file, {number: self._topic_of(connection) for number, connection in chosen.items()})

    def _judge(self, reading: _Pass) -> None:
        if reading.damage:
            self._damaged(reading.file.path, reading.damage)

    def _blocks(self, reading: _Pass, piece: Piece) -> Iterator[Block]:
        """The messages of a piece in the order of time, which is that of a recorder."""
        messages: list[Message] = []
        try:
            for message in reading.file.messages(piece):
                if message[0] in reading.topics:
                    messages.append(self._converted(reading.file.connections[message[0]], message))
                elif message[0] not in reading.file.connections:
                    reading.losses.undefined += 1
        except (Damaged, TooLarge) as error:
            why = f"a chunk that {error}" if isinstance(error, TooLarge) else "a damaged chunk"
            reading.losses.parts.append(Loss(piece.begin, piece.end, why))
        reading.position += piece.end - piece.begin
        # An index may give a later first time.
        reading.losses.misdated += sum(message[1] < (piece.first_ns or 0) for message in messages)
        if messages:
            yield sorted_by_time(batch_of(messages)), reading.topics

    def _converted(self, connection: Connection, message: Message) -> Message:
        number, log_ns, data = message
        try:
            return number, log_ns, bytes(self._types_of(connection)[0].ros1_to_cdr(data, connection.type))
        except SerdeError:
            return number, log_ns, b""  # no type accepts empty bytes, so the message counts as damaged

    def _topic_of(self, connection: Connection) -> Topic:
        return Topic(connection.topic, connection.type, 0, "cdr", "ros2msg", self._types_of(connection)[1])

    def _types_of(self, connection: Connection) -> tuple[Typestore, str]:
        """The types of a connection, with ROS 2's header, and their definition in ROS 2. Raises BagError."""
        kind, text = connection.type, connection.definition
        found = self._types.get((kind, text))
        if found is None:
            store = get_typestore(Stores.EMPTY)
            try:
                types = get_types_from_msg(text, kind)
                if _HEADER in types:
                    types[_HEADER] = get_typestore(Stores.ROS2_JAZZY).fielddefs[_HEADER]
                store.register(types)
                found = self._types[kind, text] = store, store.generate_msgdef(kind, ros_version=2)[0]
            except Exception as error:  # noqa: BLE001  damaged text can make the parser below raise anything
                raise BagError(f"{self.path}: the definition of {kind} is not valid: {error}") from None
        return found
